"""A sign of life while a command works, on a terminal only."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

T = TypeVar("T")


@contextmanager
def working(what: str) -> Iterator[None]:
    """Show a spinner on stderr while the block runs; nothing if stderr is no terminal."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    from rich.text import Text

    with Console(stderr=True).status(Text(what)):
        yield


def counted(items: Iterable[T], what: str) -> Iterator[T]:
    """Give the items, and show on stderr, if that is a terminal, how many there were so far."""
    if not sys.stderr.isatty():
        yield from items
        return
    from rich.console import Console
    from rich.text import Text

    with Console(stderr=True).status(Text(what)) as status:
        for number, item in enumerate(items, start=1):
            status.update(Text(f"{what}: {number}"))
            yield item
