"""The command ``brachis`` and ``python -m brachis``: Ctrl-C is heard before anything else is imported."""

from __future__ import annotations

from brachis.common import interrupts


def main() -> None:
    """Run the command line."""
    interrupts.install()
    from brachis.apps.cli.main import main as run

    run()


if __name__ == "__main__":
    main()
