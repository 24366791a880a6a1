"""Ask pip for wheels of all dependencies on every platform that the README names.

    python3 tasks.py resolve [--python 3.11 3.14] [--extra core all] [--platform "macOS 15, arm64"]

Nothing is compiled or installed: pip downloads wheels into a temporary folder, some 0.3 GB for every line of the table
(from its cache the next time). The exit code is 1 if a wheel is missing.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent
PLATFORMS = {
    "Linux, x86_64": ("linux", "Linux", "x86_64"),
    "Linux, aarch64": ("linux", "Linux", "aarch64"),
    "macOS 15, arm64": ("darwin", "Darwin", "arm64"),
    "macOS 15, x86_64": ("darwin", "Darwin", "x86_64"),
}
"""What `sys_platform`, `platform_system` and `platform_machine` are on the platforms."""
GLIBC = range(28, 4, -1)
"""Minor versions of glibc 2 up to that of the oldest Linux that the README names (RHEL 8, Debian 10)."""
PYTHONS = ("3.11", "3.14")
"""The oldest and the newest Python that the README names."""
EXTRAS = ("core", "all")
PIP = """
import json, runpy, sys
from pip._vendor.packaging import markers
there = markers.default_environment() | json.loads(sys.argv.pop(1))
markers.default_environment = lambda: dict(there)
runpy.run_module("pip", run_name="__main__")
"""
"""Runs pip with the markers of another platform: ``pip download --platform`` chooses wheels by tags, and evaluates the
markers of dependencies for the machine that it runs on."""


def pip_tags(system: str, machine: str) -> list[str]:
    """Tags of the wheels that run on a platform."""
    if system == "darwin":
        return [f"macosx_15_0_{machine}"]
    tags = [f"manylinux_2_{minor}_{machine}" for minor in GLIBC]
    return [*tags, f"manylinux2014_{machine}", f"linux_{machine}"]


def requirements(extra: str) -> Iterator[str]:
    """Yield what the package, or one of its extras, needs."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    project = tomllib.loads(text)["project"]
    if extra == "core":
        yield from project["dependencies"]
        return
    for line in project["optional-dependencies"][extra]:
        nested = re.fullmatch(r"brachis\[(.*)\]", line)
        if nested is None:
            yield line
        else:
            for name in nested[1].split(","):
                yield from requirements(name)


def find_problem(platform: str, python: str, extra: str) -> str | None:
    """Ask pip for all wheels of an extra; return what it says if one is missing."""
    system, name, machine = PLATFORMS[platform]
    markers = {
        "sys_platform": system,
        "platform_system": name,
        "platform_machine": machine,
        "python_version": python,
        "python_full_version": f"{python}.0",
    }
    names = {*requirements("core"), *requirements(extra)}
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", PIP, json.dumps(markers)]
        command += ["download", "--quiet", "--only-binary=:all:", f"--dest={folder}"]
        command += ["--implementation=cp", f"--python-version={python}"]
        command += [f"--platform={tag}" for tag in pip_tags(system, machine)]
        done = subprocess.run(
            [*command, *sorted(names)], capture_output=True, text=True, check=False
        )
    if not done.returncode:
        return None
    errors = [line for line in done.stderr.splitlines() if line.startswith("ERROR")]
    return errors[-1] if errors else done.stderr


def main() -> None:
    """Print a line for every platform, Python and extra."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--platform", nargs="+", choices=PLATFORMS, default=PLATFORMS)
    parser.add_argument("--python", nargs="+", default=PYTHONS)
    parser.add_argument("--extra", nargs="+", default=EXTRAS)
    options = parser.parse_args()
    has_failed = False
    for platform in options.platform:
        for python in options.python:
            for extra in options.extra:
                problem = find_problem(platform, python, extra)
                has_failed |= problem is not None
                answer = problem or "all wheels exist"
                print(f"{platform:<18}Python {python}  {extra:<6}{answer}", flush=True)
    sys.exit(has_failed)


if __name__ == "__main__":
    main()
