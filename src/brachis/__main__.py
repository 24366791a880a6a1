"""The command ``brachis``, also ``python -m brachis``; it handles Ctrl-C before anything else is imported."""

from __future__ import annotations

import sys

import brachis
from brachis.common import interrupts


def main() -> None:
    """Run the command line."""
    interrupts.install()
    if sys.argv[1:] == ["--version"]:  # without importing Typer
        sys.stdout.write(f"brachis {brachis.__version__}\n")
        return
    from brachis.apps.cli.main import main as run

    run()


if __name__ == "__main__":
    main()
