"""The two mapping processes that a command names."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from typing import NoReturn

import typer

from mapmeld.cli.maps import same_map
from mapmeld.grid import OccupancyGrid
from mapmeld.io.history import read_history
from mapmeld.io.recordings.address import is_recording, parse_address

Processes = tuple[Iterable[OccupancyGrid], Iterable[OccupancyGrid]]


def processes(
    sources: Sequence[str], topics: tuple[str, str] | None, stack: ExitStack
) -> tuple[tuple[str, str], Processes]:
    """Return what to call the two processes, and their states, read as they are asked for.

    `stack` closes the recordings.

    Raises
    ------
    MapFileError
        A history or recording cannot be read, or a recording does not tell which two maps are meant.
    """
    if len(sources) > 2:
        raise typer.BadParameter(f"two histories are needed, not {len(sources)}", param_hint="A [B]")
    if len(sources) == 2:
        if topics is not None:
            raise typer.BadParameter(
                "is for one recording; of two, name each as RECORDING#topic", param_hint="--topics"
            )
        first, second = sources
        if same_map(first) == same_map(second):
            _twice(second, "A [B]")
        return (first, second), (_states_of(first, stack), _states_of(second, stack))
    (source,) = sources
    if not is_recording(source):
        raise typer.BadParameter(
            f"{source} is no recording; name a second history, or a recording", param_hint="A [B]"
        )
    file, topic, time = parse_address(source)
    if topic is not None or time is not None:
        raise typer.BadParameter(f"{source} is one map; name a second one", param_hint="A [B]")
    one, two = topics or _two_topics(file)
    if one == two:
        _twice(two, "--topics")
    names = f"{file}#{one}", f"{file}#{two}"
    return names, (_recorded(file, one, stack), _recorded(file, two, stack))


def _twice(name: str, option: str) -> NoReturn:
    raise typer.BadParameter(f"{name} is named twice; two robots are needed", param_hint=option)


def _states_of(source: str, stack: ExitStack) -> Iterable[OccupancyGrid]:
    if not is_recording(source):
        return read_history(source)
    file, topic, time = parse_address(source)
    if time is not None:
        raise typer.BadParameter(f"{source} is one state; leave out what follows '@'", param_hint="A [B]")
    return _recorded(file, topic, stack)


def _recorded(file: str, topic: str | None, stack: ExitStack) -> Iterable[OccupancyGrid]:
    from mapmeld.io.recordings import map_states

    states = map_states(file, *([] if topic is None else [topic]))
    stack.callback(states.close)
    return states


def _two_topics(file: str) -> tuple[str, str]:
    """Return the topics with maps, if there are two."""
    from mapmeld.io.recordings import map_topics

    names = [topic.name for topic in map_topics(file) if topic.problem is None and topic.maps]
    if len(names) != 2:
        found = f"maps on {', '.join(names)}" if names else "no maps"
        raise typer.BadParameter(f"{file} has {found}; choose two topics: --topics T1 T2", param_hint="A [B]")
    return names[0], names[1]
