"""What is installed where: the README, the dependencies, and the task that resolves them."""

import importlib.util
import re
import sys
from pathlib import Path

import pytest

from support.scripts import load_script

ROOT = Path(__file__).parents[1]


platforms = load_script("platforms.py")


def test_ipopt_is_needed_by_an_extra_alone():
    core = " ".join(platforms.requirements("core"))
    assert "unopy" in core
    assert "ipyopt" not in core
    assert [*platforms.requirements("all")].count(*platforms.requirements("ipopt")) == 1


def test_the_pages_name_the_platforms_of_the_requirements():
    for page in ("README.md", "docs/quick_start.md"):
        text = (ROOT / page).read_text()
        for system, _, machine in platforms.PLATFORMS.values():
            assert (machine if system == "linux" else "macOS 15 or newer") in text
        assert "{} to {}".format(*platforms.PYTHONS) in text
    glibc = re.search(r"glibc 2\.(\d+)", text)
    assert int(glibc[1]) == max(platforms.GLIBC)
    assert set(platforms.PYTHONS) <= {
        *re.findall(r'"(3\.\d+)"', (ROOT / ".github/workflows/check.yml").read_text())
    }


@pytest.mark.skipif(importlib.util.find_spec("pip") is None, reason="pip is not there")
def test_pip_is_asked_with_the_markers_of_the_other_platform(monkeypatch):
    asked = []

    def run(command, **_options):
        asked.append(command)
        return platforms.subprocess.CompletedProcess(command, 1, "", "ERROR: no wheel")

    monkeypatch.setattr(platforms.subprocess, "run", run)
    monkeypatch.setattr(sys, "argv", ["platforms.py", "--platform", "macOS 15, arm64"])
    with pytest.raises(SystemExit) as ended:
        platforms.main()
    assert ended.value.code == 1
    assert len(asked) == len(platforms.PYTHONS) * len(platforms.EXTRAS)
    for command in asked:
        assert {"--only-binary=:all:", "--platform=macosx_15_0_arm64"} <= {*command}
        assert '"platform_machine": "arm64"' in command[3]
