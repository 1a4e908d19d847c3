"""The command line: one thin file per command; `mapmeld.cli.commands` ties them together.

Here nothing is imported before it can be interrupted without a traceback.
"""

import sys

__all__ = ["main"]


def main() -> None:
    """Run the command line on ``sys.argv`` and exit."""
    try:
        from mapmeld.cli.process import run_process
    except KeyboardInterrupt:
        print("mapmeld: interrupted", file=sys.stderr)
        sys.exit(130)
    run_process()
