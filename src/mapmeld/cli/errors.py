"""Exit codes and the one line on stderr.

Imports next to nothing: it must work from the first moment on.
"""

from __future__ import annotations

import contextlib
import os
import sys
from typing import TextIO

from mapmeld.io import printable

NO_MATCH = 1
BAD_INPUT = 2
FAULT = 70  # EX_SOFTWARE of BSD's sysexits.h
# As shells count them: 128 and the number of the signal.
INTERRUPTED = 130
CLOSED_PIPE = 141


def say(message: str) -> None:
    """Print one line on stderr, if that takes it."""
    try:
        print(f"mapmeld: {printable(' '.join(message.split()))}", file=sys.stderr, flush=True)
    except OSError:  # the exit code still says it
        silence(sys.stderr)


def silence(stream: TextIO) -> None:
    """Let a stream that takes nothing more lose what it still holds; Python would fail on it at its end."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
