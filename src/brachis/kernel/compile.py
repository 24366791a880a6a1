"""Compile the kernel.

    python src/brachis/kernel/compile.py

Installing the package does the same. The script uses the machine's C compiler (`CC`, or `cc`). If there is none, it
uses the compiler of the package ziglang. The script needs only the standard library.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).resolve()
FOLDER = SCRIPT.parent
VARIANTS = {"baseline": (), "avx2": ("-mavx2",)}
"""Names of the library variants, and the compiler flags for the processor features that they may use."""
# Without contraction of operations, all variants give the same digits.
_FLAGS = ("-O3", "-std=c11", "-fPIC", "-shared", "-ffp-contract=off", "-fno-math-errno")
_QUIET = ("-Wno-psabi",)


def library_path(variant: str) -> Path:
    """Return the path of a variant's library. The file need not exist."""
    return FOLDER / f"kernel_{variant}.so"


def describe_file(library: Path) -> str:
    """Return the size and digest of a library, as recorded beside the library when it is compiled."""
    content = library.read_bytes()
    return f"{len(content)} bytes, SHA-256 {hashlib.sha256(content).hexdigest()}"


def source_digest() -> str:
    """Return a digest of the C source code. It shows whether a library was compiled from this code."""
    digest = hashlib.sha256()
    for file in sorted([*FOLDER.glob("*.h"), *FOLDER.glob("*.c")]):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def find_compiler() -> list[str] | None:
    """Return the command of the machine's C compiler; None if there is none."""
    stated = os.environ.get("CC")
    if stated:
        return shlex.split(stated)
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name) and _runs([name, "--version"]):
            return [name]
    return None


def _runs(command: list[str]) -> bool:
    """Tell whether a command can be run. On macOS, `cc` may only tell how to install a compiler."""
    try:
        return not _run(command).returncode
    except OSError:
        return False


def _run(command: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603


def compile_kernel() -> list[Path]:
    """Compile every variant for this type of machine.

    Returns
    -------
    list of path
        The libraries and their records, beside this file.

    Raises
    ------
    RuntimeError
        There is no C compiler, or it fails.
    """
    compiler = find_compiler()
    if compiler is None:
        if importlib.util.find_spec("ziglang") is None:
            raise RuntimeError(
                "no C compiler was found: looked for $CC, cc, gcc, clang and the package ziglang; "
                "try: python -m pip install ziglang"
            )
        compiler = [sys.executable, "-m", "ziglang", "cc", "-mcpu=baseline"]
    digest = source_digest()
    sources = [str(file) for file in sorted(FOLDER.glob("*.c"))]
    made = []
    for variant, flags in VARIANTS.items():
        if flags and platform.machine().lower() not in ("x86_64", "amd64"):
            continue
        library = library_path(variant)
        # Compile under another name and then move the file, so that a process that loads the library meanwhile gets
        # either the old or the new one.
        aside = library.with_suffix(f".{os.getpid()}.tmp")
        command = [
            *compiler,
            *_FLAGS,
            *flags,
            *_QUIET,
            f'-DSOURCE="{digest}"',
            *sources,
        ]
        command += ["-o", str(aside), "-lm"]
        try:
            run = _run(command)
        except OSError as error:
            raise RuntimeError(f"the C compiler cannot be run: {error}") from error
        if run.returncode:
            raise RuntimeError(
                f"the C compiler fails: {shlex.join(command)}\n{run.stderr.strip()}"
            )
        record = library.with_suffix(".sha256")
        record.write_text(describe_file(aside), encoding="ascii")
        aside.replace(library)
        made += [library, record]
    return made


if __name__ == "__main__":
    compile_kernel()
