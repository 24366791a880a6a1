import re
import subprocess
import sys

import pytest
from matplotlib.figure import Figure

from brachis.apps.plots import (
    SUFFIXES,
    plot_motion,
    plot_torques,
    save_figure,
    style,
)
from brachis.errors import InputError, NotInstalledError

MAGIC = {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}


@pytest.fixture(scope="module")
def saved(line_trajectory, tmp_path_factory):
    """The same figure in two files of every format, by its suffix."""
    folder = tmp_path_factory.mktemp("figures")
    files = {suffix: [folder / f"{k}.{suffix}" for k in "ab"] for suffix in SUFFIXES}
    paths = [path for pair in files.values() for path in pair]
    for path in paths:
        save_figure(plot_torques(line_trajectory), path)
    assert set(folder.iterdir()) == set(paths)
    return files


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_suffix_gives_the_format(saved, suffix):
    assert all(path.read_bytes().startswith(MAGIC[suffix]) for path in saved[suffix])


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_same_figure_gives_the_same_file(saved, suffix):
    first, second = saved[suffix]
    assert first.read_bytes() == second.read_bytes()


@pytest.mark.parametrize("name", ["figure.jpg", "figure", "figure.csv"])
def test_the_error_of_an_unknown_suffix_lists_the_known_ones(tmp_path, name):
    path = tmp_path / name
    with pytest.raises(InputError, match=r"allowed: \.png, \.pdf, \.svg") as caught:
        save_figure(Figure(), path)
    assert caught.value.where == str(path)
    assert not path.exists()


def test_pdf_fonts_are_truetype_and_svg_text_is_text(saved):
    assert b"/CIDFontType2" in saved["pdf"][0].read_bytes()
    text = saved["svg"][0].read_text(encoding="utf-8")
    assert re.search(r"<text[^>]*>j1</text>", text)


def test_joints_look_different():
    looks = {str(style.joint_style(joint)) for joint in range(21)}
    assert len(looks) == 21


def test_a_dollar_in_a_joint_name_is_no_mathematics(line_trajectory, monkeypatch):
    monkeypatch.setattr(type(line_trajectory), "joint_names", ("a$\\x", "b$", "c"))
    figure = plot_motion(line_trajectory)
    figure.draw_without_rendering()
    assert figure.axes[0].get_lines()[0].get_label() == r"a\$\x"


LAZY = """
import sys
import brachis.apps.plots, brachis.apps.export
assert "matplotlib" not in sys.modules, "imported with the package"
import matplotlib
before = dict(dict.items(matplotlib.rcParams))  # whose own items would choose a backend
from brachis.trajectory import Trajectory
from brachis.apps.plots import PLOTS, plot_comparison, save_figure, style
style._DPI = 30
trajectory = Trajectory.load(sys.argv[1])
figures = {name: plot(trajectory) for name, plot in PLOTS.items() if name != "fit"}
save_figure(figures["overview"], f"{sys.argv[2]}/overview.png")  # has parts of all kinds
save_figure(plot_comparison([(0.0, "j1", 1.0)]), f"{sys.argv[2]}/comparison.pdf")
assert dict(dict.items(matplotlib.rcParams)) == before, "settings of Matplotlib were changed"
assert "matplotlib.figure" in sys.modules
assert "matplotlib.pyplot" not in sys.modules, "pyplot was imported"
"""


def test_matplotlib_is_imported_late_and_left_as_it_is_and_pyplot_never(
    line_trajectory, tmp_path
):
    line_trajectory.save(tmp_path / "result.npz")
    arguments = [
        sys.executable,
        "-W",
        "error",
        "-c",
        LAZY,
        str(tmp_path / "result.npz"),
        str(tmp_path),
    ]
    run = subprocess.run(arguments, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    names = {path.name for path in tmp_path.glob("*.p[nd][gf]")}
    assert names == {"overview.png", "comparison.pdf"}


def test_without_matplotlib_the_error_says_what_to_install(
    line_trajectory, monkeypatch
):
    style.figure_class.cache_clear()
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(NotInstalledError, match=r'Matplotlib.*"\.\[plots\]"'):
        plot_torques(line_trajectory)


def test_the_suffix_may_be_in_capitals(tmp_path):
    save_figure(Figure(), tmp_path / "figure.PNG")
    assert (tmp_path / "figure.PNG").read_bytes().startswith(MAGIC["png"])
