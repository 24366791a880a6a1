"""The documentation is made of what is in the repository: pages from results, pictures, links, names, citation."""

import importlib
import importlib.util
import re
from fnmatch import fnmatch
from pathlib import Path

import pytest
import yaml

import brachis
from support.scripts import load_script

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
README = (ROOT / "README.md").read_text()
MOST_BYTES = 1_000_000


@pytest.fixture(scope="module")
def pages():
    return load_script("docs/make_pages.py")


def test_generated_pages_are_up_to_date(pages):
    assert (DOCS / "gallery.md").read_text() == pages.gallery(), (
        "run python docs/make_pages.py"
    )
    assert (DOCS / "benchmarks.md").read_text() == pages.benchmarks(), (
        "run python docs/make_pages.py"
    )


def test_every_result_is_shown_or_listed(pages):
    results = {path.stem: path for path in (ROOT / "benchmarks/results").glob("*.json")}
    page = pages.benchmarks()
    assert set(pages.SHOWN) < set(results)
    for name in set(results) - set(pages.SHOWN):
        assert f"| `{name}` |" in page


def test_every_example_has_its_picture(pages):
    numbers = {path.name.split("_")[0] for path in (ROOT / "examples").glob("[0-9]*")}
    plugins = {path.name for path in (ROOT / "examples").glob("*_plugin")}
    assert set(pages.PICTURES) == numbers | plugins
    for picture, title in pages.PICTURES.values():
        assert "_" not in title
        assert 1000 < (DOCS / "figures" / picture).stat().st_size < MOST_BYTES


def test_every_public_name_is_in_the_reference():
    page = "\n".join(path.read_text() for path in (DOCS / "reference").glob("*.md"))
    named = {
        "__version__",
        *re.findall(r":: (?:brachis\.)?(\w+)", page),
    }  # of modules: the package itself
    for module in re.findall(r"automodule:: (\S+)", page):
        named |= set(importlib.import_module(module).__dict__)
        named.add(module.rpartition(".")[2])
    assert set(brachis.__all__) - named == set()


def test_files_that_the_pages_write_into_a_clone_are_ignored():
    ignored = (ROOT / ".gitignore").read_text().split()
    pages = [ROOT / "README.md", *DOCS.glob("*.md"), *(ROOT / "robots").rglob("*.md")]
    text = "\n".join(page.read_text() for page in pages)
    pattern = r'(?:--out |save\("|[ .](?:write|report)\((?:\S+, )?")([\w.]+)'
    names = {"out13", *re.findall(pattern, text)} - {"FILE"}
    assert names > {"first.yaml", "out", "motion.html", "lines"}
    assert {
        name
        for name in names
        if not any(fnmatch(name, line.strip("/")) for line in ignored)
    } == set()


def test_links_to_files_lead_somewhere():
    for page in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *DOCS.rglob("*.md")):
        for link in re.findall(r"\]\(([^)#\s]+)", page.read_text()):
            assert "://" in link or (page.parent / link).exists(), (
                f"{page.name}: {link}"
            )


def test_every_page_stands_behind_one_of_four_doors():
    toctrees = re.findall(
        r"```{toctree}\n(.*?)```", (DOCS / "index.md").read_text(), re.DOTALL
    )
    assert len(toctrees) == 4
    entries = " ".join(tree.partition("\n\n")[2] for tree in toctrees).split()
    pages = {page.stem for page in DOCS.glob("*.md")} - {"index"}
    assert sorted(entries) == sorted(pages)


WORDS = {"README.md": 1300, "docs": 30_000, "CHANGELOG.md": 500}
"""Largest number of words, those with a letter or a digit: bars and rules of tables do not count."""


@pytest.mark.parametrize("name", WORDS)
def test_pages_stay_short(name):
    pages = [ROOT / name] if name.endswith(".md") else (ROOT / name).rglob("*.md")
    text = "\n".join(page.read_text() for page in pages)
    words = sum(bool(re.search(r"\w", word)) for word in text.split())
    assert words <= WORDS[name], f"{name} has {words} words; shorten it elsewhere"


def test_citation_is_that_of_this_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert {"cff-version", "message", "title", "authors"} <= set(
        citation
    )  # what its schema requires
    assert (
        citation["version"]
        == citation["preferred-citation"]["version"]
        == brachis.__version__
    )
    assert isinstance(citation["preferred-citation"]["year"], int)
    assert citation["references"][0]["title"] in README


def test_results_name_no_folder_of_a_machine(bench, tmp_path, monkeypatch):
    committed = bench("committed")
    monkeypatch.setattr(committed, "FOLDER", tmp_path)
    script = str(ROOT / "benchmarks/laws.py")
    given = ["--seed", "1", "--folder", str(tmp_path), "--save"]
    monkeypatch.setattr("sys.argv", [script, *given])
    committed.save("Laws", ["pair"], [["1"]])
    (written,) = tmp_path.glob("*.json")
    assert '"python benchmarks/laws.py --seed 1"' in written.read_text()
    for result in (ROOT / "benchmarks/results").glob("*.json"):
        assert not re.search(r'"command": "[^"]* /', result.read_text()), result
