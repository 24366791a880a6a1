"""Developer tasks on a machine with only Python: sets up a virtual environment in .venv and runs one command in it.

    python3 tasks.py demo        plan the first example, print it and draw it into out/
    python3 tasks.py test        run the tests
    python3 tasks.py lint        ruff
    python3 tasks.py types       mypy
    python3 tasks.py docs        build the documentation into out/site, run its cells, check its links
    python3 tasks.py check       test, lint, types and docs
    python3 tasks.py bench       timings (minutes)
    python3 tasks.py size        how large and how dense the package is
    python3 tasks.py resolve     does pip find wheels of all dependencies on every platform? (network, minutes)

Arguments after the task's name go to the command. Only the standard library is needed to run this file.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent
ENVIRONMENT = ROOT / ".venv"
BIN = ENVIRONMENT / ("Scripts" if os.name == "nt" else "bin")

INSTALL = {
    "demo": ".[all]",
    "test": ".[test]",
    "lint": ".[lint]",
    "types": ".[lint]",
    "bench": ".[benchmark]",
    "docs": ".[docs]",
    "size": ".[all]",
    "resolve": ".[lint]",
}
COMMANDS = {
    "demo": [["brachis", "plan", "examples/01_scara_line.yaml", "--out", "out"]],
    "test": [["python", "-m", "pytest", "-n", "2", "--dist", "worksteal"]],
    "lint": [["ruff", "check", "."], ["ruff", "format", "--check", "."]],
    "types": [["mypy"]],
    "bench": [
        ["python", "-m", "pytest", "benchmarks", "-p", "no:xdist"],
        ["python", "benchmarks/growth.py"],
    ],
    "size": [["python", "benchmarks/size.py"]],
    "resolve": [["python", "platforms.py"]],
    "docs": [
        [
            "python",
            "-m",
            "sphinx",
            "-q",
            "-j",
            "auto",
            "-E",
            "-W",
            "--keep-going",
            "docs",
            "out/site",
        ],
        ["python", "docs/check_links.py", "out/site"],
    ],
}


def prepare(extra: str) -> None:
    """Make the virtual environment if it is missing, and install the project with one of its extras."""
    python = BIN / "python"
    if not python.exists():
        print(f"making a virtual environment in {ENVIRONMENT.name}", flush=True)
        venv.create(ENVIRONMENT, with_pip=True)
    stamp = ENVIRONMENT / f"installed-{extra.strip('.[]') or 'core'}"
    kernel = ROOT / "src/brachis/kernel"
    sources = [
        ROOT / "pyproject.toml",
        *kernel.glob("*.[ch]"),
        *kernel.glob("compile.py"),
    ]
    newest = max(source.stat().st_mtime for source in sources)
    if stamp.exists() and stamp.stat().st_mtime > newest:
        return
    print(f"installing {extra}", flush=True)
    subprocess.run(
        [python, "-m", "pip", "install", "--quiet", "--editable", extra],
        cwd=ROOT,
        check=True,
    )
    stamp.touch()


def run(task: str, arguments: list[str]) -> int:
    """Run one task; returns its exit code."""
    if task == "check":
        return max(run(each, []) for each in ("test", "lint", "types", "docs"))
    prepare(INSTALL[task])
    code = 0
    for command in COMMANDS[task]:
        print("+", *command, *arguments, flush=True)
        code = max(
            code,
            subprocess.run(
                [BIN / command[0], *command[1:], *arguments], cwd=ROOT, check=False
            ).returncode,
        )
    if task == "demo" and code == 0:
        print(
            f"look at out/overview.png; then '. {ENVIRONMENT.name}/bin/activate', and README.md goes on from there"
        )
    return code


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("task", choices=[*COMMANDS, "check"])
    options, rest = parser.parse_known_args()
    sys.exit(run(options.task, rest))


if __name__ == "__main__":
    main()
