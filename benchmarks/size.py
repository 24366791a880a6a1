"""How large and how dense the package is, and how much of it a simple plan passes: ``python3 tasks.py size``.

Usage: python benchmarks/size.py [--installation]

`--installation` also installs the project without extras into a new environment, and measures it (minutes).
"""

from __future__ import annotations

import argparse
import ast
import io
import re
import sys
import tempfile
import tokenize
import venv
from collections.abc import Iterable, Iterator
from pathlib import Path
from subprocess import run

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "src/brachis"
LAYOUT = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENCODING,
    tokenize.ENDMARKER,
}
IRREGULAR = (
    "told found made known begun given held kept left said shown bent drawn laid"
)
NOT_PARTICIPLES = "speed seed need feed embed exceed proceed shed bed"
UNCLEAR = re.compile(r"\b(?:is|are) (?:no|none)\b|hardly meant")


def docstring_lines(tree: ast.AST) -> set[int]:
    """Return the lines of strings that stand alone."""
    alone = (
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )
    return {line for node in alone for line in range(node.lineno, node.end_lineno + 1)}


def code_tokens(text: str, skipped: set[int]) -> Iterator[tokenize.TokenInfo]:
    """List the tokens outside docstrings that are not layout."""
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in LAYOUT and token.start[0] not in skipped:
            yield token


def is_tuple_assignment(node: ast.AST) -> bool:
    """Tell whether a tuple is assigned to a tuple."""
    return (
        isinstance(node, ast.Assign)
        and isinstance(node.targets[0], ast.Tuple)
        and isinstance(node.value, ast.Tuple)
    )


def is_named_by_participle(node: ast.AST) -> bool:
    """Tell whether a function is named by a participle; properties, and names with is_ or has_, are not."""
    if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
        return False
    if any("property" in ast.unparse(each) for each in node.decorator_list):
        return False
    name = node.name.strip("_")
    last = name.split("_")[-1]
    if re.match(r"(is|has|are|was)_", name) or last.endswith("speed"):
        return False
    if last in NOT_PARTICIPLES.split():
        return False
    return last.endswith("ed") or last in IRREGULAR.split()


def is_numeric_constant(node: ast.AST) -> bool:
    """Tell whether a statement of a module names a number."""
    value = getattr(node, "value", None)
    value = value.operand if isinstance(value, ast.UnaryOp) else value
    return (
        isinstance(node, ast.Assign | ast.AnnAssign)
        and isinstance(value, ast.Constant)
        and isinstance(value.value, int | float)
    )


def modules_passed() -> int:
    """Count the modules of brachis of which the plan of example 01 runs a function."""
    import brachis

    names: set[str] = set()

    def note(frame: object, event: str, _argument: object) -> None:
        if event == "call":
            names.add(frame.f_globals.get("__name__", ""))  # type: ignore[attr-defined]

    task = ROOT / "examples/01_scara_line.yaml"
    brachis.plan(task)  # a module's own lines run when it is imported
    sys.setprofile(note)
    try:
        brachis.plan(task)
    finally:
        sys.setprofile(None)
    return sum(name.startswith("brachis.") for name in names)


def installation() -> str:
    """Install the project without extras, and return how much that takes on the disk."""
    with tempfile.TemporaryDirectory() as folder:
        venv.create(folder, with_pip=True)
        python = Path(folder) / "bin/python"
        run([python, "-m", "pip", "install", "--quiet", ROOT], check=True)
        files = (path for path in Path(folder).rglob("*") if not path.is_symlink())
        total = sum(path.stat().st_size for path in files if path.is_file())
    return f"{total / 1e6:.0f} MB"


def measure(paths: Iterable[Path]) -> dict[str, float]:
    """Measure files of Python."""
    tokens = 0
    code: int = 0
    found = {
        "tuple assignments": 0,
        "functions named by participles": 0,
        "numeric constants at module level": 0,
        '"is no", "is none", "hardly meant"': 0,
    }
    count = 0
    for path in paths:
        count += 1
        text = path.read_text()
        tree = ast.parse(text)
        skipped = docstring_lines(tree)
        parts = list(code_tokens(text, skipped))
        tokens += len(parts)
        code += len(
            {line for part in parts for line in range(part.start[0], part.end[0] + 1)}
        )
        for node in ast.walk(tree):
            found["tuple assignments"] += is_tuple_assignment(node)
            found["functions named by participles"] += is_named_by_participle(node)
        for node in tree.body:
            found["numeric constants at module level"] += is_numeric_constant(node)
        found['"is no", "is none", "hardly meant"'] += len(UNCLEAR.findall(text))
    return {
        "tokens": tokens,
        "tokens a code line": round(tokens / code, 2),
        "modules": count,
        **found,
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--installation", action="store_true")
    options = parser.parse_args()
    rows: dict[str, object] = dict(measure(sorted(SOURCE.rglob("*.py"))))
    private = {"__init__.py", "__main__.py", "__pycache__", "py.typed"}
    rows["entries at the top"] = len({path.name for path in SOURCE.iterdir()} - private)
    rows["modules that example 01 passes"] = modules_passed()
    if options.installation:
        rows["size of an installation"] = installation()
    for name, value in rows.items():
        print(f"{name:38} {value}")


if __name__ == "__main__":
    main()
