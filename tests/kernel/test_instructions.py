"""How many instructions `work.py` takes, with the interpreter's: counted by Valgrind.

Valgrind counts only between two calls of a small library that is compiled here: imports would take most of the time.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from brachis.kernel.compile import find_compiler
from kernel.work import TIMES

WORK = Path(__file__).with_name("work.py")
HEADER = Path("/usr/include/valgrind/callgrind.h")
MARKS = f"""
#include "{HEADER}"
void begin(void) {{ CALLGRIND_START_INSTRUMENTATION; CALLGRIND_ZERO_STATS; }}
void end(void) {{ CALLGRIND_DUMP_STATS; CALLGRIND_STOP_INSTRUMENTATION; }}
"""
"""C source of the functions that `work.py` calls before and after what is counted."""
COUNTED = {"gcc 12, Python 3.11": 16_289_819}
"""Instructions by compiler and interpreter: others make other code. Write the new number down where it falls, or where
a growth is meant."""
GROWTH = 1.1


def compiler():
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


def compile_marks(folder):
    """Compile the library that tells Valgrind what to count."""
    source, library = folder / "marks.c", folder / "marks.so"
    source.write_text(MARKS)
    command = [*find_compiler(), "-shared", "-fPIC", "-o", str(library), str(source)]
    subprocess.run(command, capture_output=True, check=True)
    return library


def count_instructions(folder):
    """Count the instructions of doing the work once, by a process that marks where that begins and ends."""
    command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder / 'out'}"]
    command += ["--instr-atstart=no", sys.executable, str(WORK)]
    command += [str(compile_marks(folder))]
    fixed = {**os.environ, "PYTHONHASHSEED": "0", "OMP_NUM_THREADS": "1"}
    subprocess.run(command, capture_output=True, check=True, env=fixed)
    marked = (folder / "out.1").read_text()
    found = re.search(r"^summary: (\d+)", marked, re.MULTILINE)
    assert found is not None, marked[:1000]
    return int(found.group(1)) // TIMES


@pytest.mark.skipif(
    shutil.which("valgrind") is None or not HEADER.exists(),
    reason="Valgrind, or its callgrind.h, is not installed",
)
def test_the_kernel_takes_no_more_instructions(tmp_path):
    setting = f"{compiler()}, Python {sys.version_info.major}.{sys.version_info.minor}"
    known = COUNTED.get(setting)
    if known is None:
        pytest.skip(f"not counted with {setting}")
    found = count_instructions(tmp_path)
    assert known / GROWTH < found < known * GROWTH, f"{found:,} instructions"
