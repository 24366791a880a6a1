"""The page on the search states the efforts as they are."""

from __future__ import annotations

from pathlib import Path

from brachis.search.guesses import SCREENED, SEARCH_LEVELS

PAGE = Path(__file__).parents[2] / "docs/fastest_motion.md"


def table(columns):
    """Cells of the page's table with so many columns, by the effort in the first one."""
    rows = [
        line.split("|")[1:-1]
        for line in PAGE.read_text().splitlines()
        if line.startswith("| `")
    ]
    named = {
        cells[0].split("`")[1]: [cell.strip() for cell in cells[1:]]
        for cells in rows
        if len(cells) == columns
    }
    return {name: cells for name, cells in named.items() if name in SEARCH_LEVELS}


def test_the_documented_efforts_are_the_real_ones():
    efforts = table(columns=4)
    assert set(efforts) == set(SEARCH_LEVELS)
    for name, (looked, ranked, refined) in efforts.items():
        level = [level for level in SEARCH_LEVELS[name] if not level.fallback][-1]
        assert looked.split(",")[0] == str(SCREENED * level.ranked)
        assert ("," in looked) is (name != "exhaustive" and not level.only_minima)
        assert (ranked, refined) == (str(level.ranked), str(level.refined))


def test_the_documented_numbers_of_decompositions_are_the_real_ones():
    text = PAGE.read_text(encoding="utf-8")
    for name, levels in SEARCH_LEVELS.items():
        count = [level for level in levels if not level.fallback][-1].decompositions
        written = "all" if count >= 10_000 else str(count)
        assert f"{written} with `{name}`" in text
