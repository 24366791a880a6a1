"""Check every link inside a built site: ``python docs/check_links.py FOLDER``; exit code 1 where one is dead."""

from __future__ import annotations

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class _Page(HTMLParser):
    """Targets and links of one page."""

    def __init__(self) -> None:
        super().__init__()
        self.targets: set[str] = set()
        self.links: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what the tag defines, and what it asks for."""
        given = dict(attrs)
        self.targets |= {given[key] or "" for key in ("id", "name") if key in given}
        if tag in {"a", "img", "script", "link", "video", "source"}:
            self.links |= {given[key] or "" for key in ("href", "src") if key in given}


def dead_links(folder: Path) -> list[str]:
    """List the links to files or places that are not in the site."""
    pages = {}
    for path in folder.rglob("*.html"):
        pages[path.resolve()] = page = _Page()
        page.feed(path.read_text(encoding="utf-8"))
    dead = []
    for path, page in pages.items():
        for link in sorted(page.links):
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (
                (path.parent / unquote(parts.path)).resolve() if parts.path else path
            )
            place = unquote(parts.fragment)
            if not target.exists() or (
                place and target in pages and place not in pages[target].targets
            ):
                dead.append(f"{path.relative_to(folder.resolve())}: {link}")
    return dead


def main(folder: Path) -> int:
    """Print what is dead."""
    dead = dead_links(folder)
    count = len(list(folder.rglob("*.html")))
    print("\n".join([*dead, f"{len(dead)} dead links in {count} pages"]))  # noqa: T201
    return 1 if dead or not count else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
