"""How many instructions `work.py` takes, with the interpreter's: counted by Valgrind."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from brachis.kernel.compile import find_compiler

WORK = Path(__file__).with_name("work.py")
COUNTED = {"gcc 12, Python 3.11": 9_539_300}
"""Instructions by compiler and interpreter: others make other code. Write the new number down where it falls, or where
a growth is meant."""
GROWTH = 1.1


def compiler() -> str:
    """Name and major version of the C compiler."""
    command = find_compiler()
    if command is None:
        return "none"
    about = subprocess.run(
        [*command, "--version"], capture_output=True, text=True, check=True
    )
    version = re.search(r" (\d+)\.\d+", about.stdout)
    name = "clang" if "clang" in about.stdout else "gcc"
    return f"{name} {version.group(1) if version else ''}"


def count_instructions(folder: Path, repetitions: int) -> int:
    """Count the instructions of a process that does the work so many times."""
    command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder / 'out'}"]
    command += [sys.executable, str(WORK), str(repetitions)]
    fixed = {**os.environ, "PYTHONHASHSEED": "0", "OMP_NUM_THREADS": "1"}
    run = subprocess.run(command, capture_output=True, text=True, check=True, env=fixed)
    found = re.search(r"Collected : (\d+)", run.stderr)
    assert found is not None, run.stderr
    return int(found.group(1))


@pytest.mark.skipif(
    shutil.which("valgrind") is None, reason="Valgrind is not installed"
)
def test_the_kernel_takes_no_more_instructions(tmp_path):
    setting = f"{compiler()}, Python {sys.version_info.major}.{sys.version_info.minor}"
    known = COUNTED.get(setting)
    if known is None:
        pytest.skip(f"not counted with {setting}")
    once, more = (count_instructions(tmp_path, count) for count in (1, 11))
    found = (more - once) // 10
    assert known / GROWTH < found < known * GROWTH, f"{found:,} instructions"
