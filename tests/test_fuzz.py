"""The first 30 cases of ``benchmarks/fuzz.py``: broken inputs end with an error of brachis or a valid outcome."""

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[1] / "benchmarks/fuzz.py"


@pytest.mark.skipif(
    not Path("/proc/self/status").exists(), reason="the memory limit is read off /proc"
)
def test_broken_inputs():
    done = subprocess.run(
        [sys.executable, SCRIPT, "--cases", "30"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "30 cases" in done.stdout
    assert done.stdout.count("valid") >= 3  # not everything is refused
