"""Sphinx: the documentation site. ``python3 tasks.py docs`` builds it with warnings as errors."""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

import brachis

ROOT = Path(__file__).parents[1]
project = "brachis"
author = project_copyright = "The brachis authors"
version = release = brachis.__version__
sys.path.insert(0, str(ROOT / "docs"))
extensions = [
    "sphinx.ext.autodoc",
    "numpydoc",
    "myst_nb",
    "sphinx_design",
    "docstring_links",
    "formulas",
    "cells",
]
nitpicky = True
templates_path: list[str] = []

myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_show_tb = True
nb_execution_timeout = 600
nb_merge_streams = True

autodoc_typehints = "none"  # the sections of numpydoc have them, with shapes and units
autodoc_default_options = {"exclude-members": "model_config"}
default_role = "py:obj"  # docstring_links.py says what becomes of it
numpydoc_show_class_members = False

html_math_renderer = "pictures"
html_theme = "furo"
html_title = f"brachis {version}"
html_logo = "_static/logo.svg"
html_static_path = ["_static"]
html_css_files = ["site.css"]


STARTUP = """\
import os
import subprocess
import warnings
os.chdir({folder!r})

plain = {{key: value for key, value in os.environ.items() if "COLOR" not in key}}

def system(command):
    done = subprocess.run(
        command, shell=True, text=True, stdout=-1, stderr=-2, env=plain
    )
    print(done.stdout.rstrip())
    done.check_returncode()  # a command that fails is an error of its page

get_ipython().system = system
# Cells have few knot intervals, so that they are quick; a kernel's file names say nothing.
warnings.filterwarnings("ignore", message=".*the same joint path can be travelled in")
warnings.formatwarning = lambda message, category, *place: f"{{category.__name__}}: {{message}}\\n"
"""


def _isolated_clone(folder: Path) -> None:
    """Have cells run in a folder that looks like the repository and may be written to."""
    for name in ("robots", "examples"):
        (folder / name).symlink_to(ROOT / name)
    startup = folder / ".ipython/profile_default/startup"
    startup.mkdir(parents=True)
    (startup / "clone.py").write_text(STARTUP.format(folder=str(folder)))
    os.environ["IPYTHONDIR"] = str(folder / ".ipython")


os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
os.environ["COLUMNS"] = "105"  # of tables that commands print
os.environ.pop(
    "PYTHONDONTWRITEBYTECODE", None
)  # else every page would compile the package
_CLONE = tempfile.TemporaryDirectory(prefix="brachis-docs-")  # until Sphinx ends
_isolated_clone(Path(_CLONE.name))
