"""``python -m brachis``."""

from brachis.cli.main import main

main()
