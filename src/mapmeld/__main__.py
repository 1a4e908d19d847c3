"""``python -m mapmeld``."""

from mapmeld.cli import main

main()
