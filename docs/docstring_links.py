"""What single backticks in docstrings mean: a link where the page of the reference has the name, else plain emphasis.

A name that the source does not know either is dead, and Sphinx warns of it.
"""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.util.nodes import make_refnode

SOURCE = Path(__file__).parents[1] / "src"


@cache
def names_in_source() -> frozenset[str]:
    """Collect every name that the source defines: modules, classes, functions, parameters, fields, constants."""
    names: set[str] = set()
    for path in SOURCE.rglob("*.py"):
        names.add(path.stem)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef | ast.FunctionDef):
                names.add(node.name)
            elif isinstance(node, ast.arg):
                names.add(node.arg)
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                names.add(node.id)
    return frozenset(names)


def resolve(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, contnode: nodes.Element
) -> nodes.Element | None:
    """Link a name by its end, as ``Trajectory.sample`` for ``brachis.Trajectory.sample``."""
    if (node.get("refdomain"), node.get("reftype")) != ("py", "obj"):
        return None
    target, objects = node["reftarget"], env.domains["py"].objects
    last = target.rsplit(".", 1)[-1]
    ends = (
        (f".{target}", f".{last}") if target.startswith("brachis.") else (f".{target}",)
    )
    found = sorted((name for name in objects if name.endswith(ends)), key=len)
    if found and not last.islower():
        entry = objects[found[0]]
        return make_refnode(
            app.builder,
            node["refdoc"],
            entry.docname,
            entry.node_id,
            contnode,
            found[0],
        )
    return contnode if last in names_in_source() else None


def without_sections(
    _app: Sphinx,
    what: str,
    _name: str,
    _obj: object,
    _options: object,
    lines: list[str],
) -> None:
    """Make headings of a module's docstring plain ones: numpydoc leaves those of modules, which would be sections."""
    if what == "module":
        text = re.sub(
            r"^(\w+)\n-+$", r".. rubric:: \1\n", "\n".join(lines), flags=re.MULTILINE
        )
        lines[:] = text.split("\n")


def setup(app: Sphinx) -> dict[str, bool]:
    """Be an extension."""
    app.connect("autodoc-process-docstring", without_sections)
    app.connect("missing-reference", resolve)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
