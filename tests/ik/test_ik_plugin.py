"""The example of a plug-in: installed into a scratch environment, its family is found and plans."""

import json
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest

import brachis
from brachis.errors import DecompositionError

PLUGIN = Path(__file__).parents[2] / "examples/ik_plugin"
TASK = PLUGIN / "crane.yaml"
LOOK = (
    "import brachis, json, sys; result = brachis.plan(sys.argv[1]);"
    "print(json.dumps([result.family, result.verified, result.t_end, result.trajectory.branch]))"
)


@pytest.fixture(scope="module")
def scratch(tmp_path_factory):
    """Python of a new environment that sees this one's packages, and the plug-in besides."""
    folder = tmp_path_factory.mktemp("scratch")
    venv.create(folder, with_pip=False, symlinks=True)
    python = folder / "bin/python"
    scheme = {"base": str(folder), "platbase": str(folder)}
    own = Path(sysconfig.get_path("purelib", "venv", vars=scheme))
    here = {sysconfig.get_path(name) for name in ("purelib", "platlib")}
    own.joinpath("shared.pth").write_text(
        "".join(f"import site; site.addsitedir({path!r})\n" for path in here)
    )
    # Nothing is fetched: the build backend and all dependencies are there already.
    install = [
        sys.executable,
        "-m",
        "pip",
        "--python",
        python,
        "install",
        "--no-index",
        "--no-deps",
    ]
    subprocess.run(
        [*install, "--no-build-isolation", "--quiet", PLUGIN],
        check=True,
        capture_output=True,
    )
    return python


def test_the_installed_family_plans(scratch):
    done = subprocess.run(
        [scratch, "-c", LOOK, TASK], capture_output=True, text=True, check=True
    )
    family, verified, t_end, branch = json.loads(done.stdout)
    assert (family, verified, branch) == ("polar", True, "forwards")
    assert 0.2 < t_end < 2.0


def test_without_the_plugin_there_is_no_closed_form():
    with pytest.raises(DecompositionError, match="no closed form"):
        brachis.plan(TASK)


def test_inspect_names_the_plugin(scratch):
    command = [
        scratch,
        "-m",
        "brachis",
        "inspect",
        PLUGIN / "crane.urdf",
        "--task-space",
        "position",
        "--json",
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    found = {
        row["redundant joints"]: row
        for row in json.loads(done.stdout)["decompositions"]
    }
    assert found["rail"]["solver"] == "polar"
    assert "come before" in found["turn"]["why not"]
