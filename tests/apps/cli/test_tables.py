"""Tables fit the terminal, and no number in them is cut or wrapped, whichever command prints them."""

import re

import pytest
from rich.console import Console

from brachis.apps.cli import output
from brachis.apps.cli.output import print_table

from .conftest import ROOT

WIDTHS = (60, 80, 120)
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.])")


def print_to_text(width, columns, rows, **options):
    console = Console(width=width, highlight=False, markup=False)
    with (
        pytest.MonkeyPatch.context() as patch,
        console.capture() as capture,
    ):
        patch.setattr(output, "result_console", lambda: console)
        print_table("title", columns, rows, **options)
    return capture.get()


def test_long_words_of_text_are_broken_not_lost():
    text = print_to_text(
        30,
        ("", ""),
        [("branch", "shoulder_front_elbow_up_wrist_flipped")],
    )
    assert "shoulder_front_elbow_up_wrist_flipped" in re.sub(r"\s|│|branch", "", text)
    assert max(map(len, text.splitlines())) <= 30


def test_each_part_of_a_wide_table_fits_and_repeats_the_first_column():
    names = [f"value {i}" for i in range(9)]
    row = ["first", *(str(1_000_000 + i) for i in range(9))]
    text = print_to_text(40, ["", *names], [row], numbers=names)
    assert max(map(len, text.splitlines())) <= 40
    assert set(row) <= set(text.split())
    assert text.count("first") == text.count("title") == 3


@pytest.mark.parametrize("width, has_lines", [(50, True), (49, False)])
def test_lines_go_before_numbers_are_cut(width, has_lines):
    names = ("", "value", "other", "remark")
    row = ("first", "123456.789012", "234567.890123", "of a few short words")
    text = print_to_text(width, names, [row], numbers=names[1:3])
    assert ("━" in text) == has_lines
    assert set(row[1:3]) <= set(text.split())


SHOWING = {
    "plan": ("plan", ROOT / "examples/01_scara_line.yaml"),
    "verify": ("verify", "RESULT"),
    "inspect an arm on a rail": ("inspect", "tx90l_rail"),
    "inspect points": ("inspect", "POINTS"),
    "robots": ("robots",),
}


@pytest.mark.parametrize("case", SHOWING)
def test_no_command_cuts_numbers(case, run, line_result, result, seam, monkeypatch):
    monkeypatch.setattr("brachis.planner.plan", lambda *_, **__: line_result)
    files = {"RESULT": result, "POINTS": seam}
    arguments = [files.get(word, word) for word in SHOWING[case]]
    texts = {width: run(*arguments, columns=width).out for width in (*WIDTHS, 200)}
    numbers = set(NUMBER.findall(texts[200]))
    assert len(numbers) > 5
    for width in WIDTHS:
        assert numbers <= set(NUMBER.findall(texts[width])), width
        assert all(
            len(line) <= width
            for line in texts[width].splitlines()
            if "━" in line or "│" in line
        )
