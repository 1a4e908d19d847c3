"""The process around the commands: its streams, and an exit code for whatever happens."""

from __future__ import annotations

import contextlib
import io
import os
import signal
import sys
import traceback
from types import FrameType

from mapmeld.cli.errors import BAD_INPUT, FAULT, INTERRUPTED, say, silence

# Who ends a process, or closes its terminal, wants no half-written files left behind either.
_ENDINGS = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]


def run_process() -> None:
    """Run the command line on ``sys.argv`` and exit."""
    if sys.stderr is None:  # closed: what is not wanted shall disturb nobody
        sys.stderr = open(os.devnull, "w")  # noqa: PTH123, SIM115  (until the end)
    if sys.stdout is None:
        # Worse than useless: the next file to be opened would take its place.
        say("standard output is closed; if it is not wanted, send it to /dev/null")
        sys.exit(BAD_INPUT)
    if isinstance(sys.stdout, io.TextIOWrapper) and isinstance(sys.stdout.buffer, io.RawIOBase):
        # `python -u` keeps nothing of what could not be written; to tell an error of stdout, something must.
        encoding = sys.stdout.encoding
        sys.stdout = io.TextIOWrapper(io.BufferedWriter(sys.stdout.detach()), encoding)
    for stream in (sys.stdout, sys.stderr):
        # File names may hold bytes that are no text; to print them must not fail.
        if isinstance(stream, io.TextIOWrapper):
            with contextlib.suppress(ValueError):
                stream.reconfigure(errors="backslashreplace")
    for number in _ENDINGS:
        if signal.getsignal(number) is signal.SIG_DFL:  # nohup has others ignored
            signal.signal(number, _interrupt)
    try:
        from mapmeld.cli.commands import app

        code = app(prog_name="mapmeld", standalone_mode=False)
    except KeyboardInterrupt:
        say("interrupted")
        code = INTERRUPTED
    except Exception:
        # Python's own exit code for this is 1, which here means that maps do not match.
        with contextlib.suppress(Exception):
            traceback.print_exc()
        code = FAULT
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            silence(stream)
    sys.exit(code)


def _interrupt(number: int, frame: FrameType | None) -> None:
    """Let an ending be an interruption; a second one shall not disturb the tidying up."""
    for ending in _ENDINGS:
        signal.signal(ending, signal.SIG_IGN)
    raise KeyboardInterrupt
