"""The page on the search states the efforts as they are."""

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
    in_charts, in_closed_forms = table(columns=4), table(columns=5)
    assert set(in_charts) == set(in_closed_forms) == set(SEARCH_LEVELS)
    for name, (looked, plans, refined) in in_charts.items():
        level = [level for level in SEARCH_LEVELS[name] if not level.fallback][-1]
        assert looked.split(",")[0] == str(SCREENED * level.in_charts)
        assert ("," in looked) is (name != "exhaustive" and not level.only_minima)
        assert (plans, refined) == (str(level.in_charts), str(level.refined))
    for name, (decompositions, seeds, plans, refined) in in_closed_forms.items():
        level = [level for level in SEARCH_LEVELS[name] if not level.fallback][-1]
        assert decompositions == {1: "the first one", 6: "6", 20: "20"}.get(
            level.decompositions, "all"
        )
        assert seeds.split(",")[0] == str(level.joint_paths)
        assert ("and 8" in seeds) is (level.numeric == 8)
        assert plans == (
            str(level.in_closed_forms) if level.in_closed_forms < 10_000 else "all"
        )
        assert refined == str(level.refined)
