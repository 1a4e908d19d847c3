"""``mapmeld bag info`` and ``mapmeld bag export``: the maps in recordings."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mapmeld.cli.errors import say
from mapmeld.cli.options import FolderOut, Force, Json
from mapmeld.wording import plural

if TYPE_CHECKING:
    from mapmeld.io.recordings import MapStates, RecordingInfo

bag = typer.Typer(
    name="bag", help="Look into recordings: rosbag1, rosbag2, MCAP (extra 'bags').", no_args_is_help=True
)


class Damaged(StrEnum):
    """The choices of `mapmeld.io.recordings.Damaged`."""

    REFUSE = "refuse"
    USE = "use"


Recording = Annotated[
    str, typer.Argument(metavar="FILE", help="A .bag or .mcap file, a rosbag2 folder, or a .db3 file of one.")
]
DamagedOption = Annotated[
    Damaged,
    typer.Option("--damaged", help="If the recording is damaged: refuse it, or use what can be read of it."),
]


@bag.command()
def info(file: Recording, json: Json = False, damaged: DamagedOption = Damaged.REFUSE) -> None:
    """List the topics of a recording on which maps were published.

    Times are in seconds after the first message of the recording: what is given after '@' in FILE#topic@time.
    """
    from mapmeld.cli.progress import working
    from mapmeld.io.recordings import recording_info

    with working("Reading"):
        found = recording_info(file, damaged=damaged.value)
    if json:
        from mapmeld.cli.json_output import as_json, bag_info_fields

        typer.echo(as_json(bag_info_fields(found, file)))
    else:
        _print(found, file)
    _say_left_out(file, found.left_out)


@bag.command()
def export(
    file: Recording,
    out: FolderOut,
    topic: Annotated[
        list[str] | None,
        typer.Option(
            "--topic", metavar="TOPIC", help="Where the map is published; repeat for a folder of each."
        ),
    ] = None,
    damaged: DamagedOption = Damaged.REFUSE,
    force: Force = False,
) -> None:
    """Write every state of a map as a folder of map_server maps, with their times in times.txt.

    Several topics get a folder each, below DIR. The folder appears when it is complete, or not at all.
    """
    from mapmeld.cli.tables import print_lines
    from mapmeld.io.folders import check_folder, whole_folder
    from mapmeld.io.recordings import map_states

    check_folder(out, force=force)
    topics = list(dict.fromkeys(topic or ()))
    written: dict[str, tuple[Path, int]] = {}
    left_out: Counter[str] = Counter()
    if len(topics) < 2:
        states = map_states(file, *topics, damaged=damaged.value)
        maps = _write(file, states, out, force)
        written[states.topic] = out, len(maps)
        left_out += states.left_out
    else:
        folders = _folders_of(topics)
        damage: Counter[str] = Counter()
        with whole_folder(out, force=force, ours=()) as folder:
            for name in topics:
                states = map_states(file, name, damaged=damaged.value)
                maps = _write(file, states, folder / folders[name], force)
                written[states.topic] = out / folders[name], len(maps)
                left_out += states.left_out - states.damage
                damage = states.damage
        left_out += damage  # the same for all
    print_lines(*(f"{name}: {plural(count, 'map')} in {place}" for name, (place, count) in written.items()))
    _say_left_out(file, left_out)


def _write(file: str, states: MapStates, folder: Path, force: bool) -> tuple[Path, ...]:
    from mapmeld.cli.progress import counted
    from mapmeld.io.history_writer import NoStatesError, write_history
    from mapmeld.io.recordings import RecordingError

    try:
        return write_history(counted(states, f"Exporting {states.topic}"), folder, force=force)
    except NoStatesError:
        lost = "; ".join(_left_out_said(states.left_out))
        problem = f"no map on {states.topic} can be read" + (f"; left out: {lost}" if lost else "")
        raise RecordingError.of(file, problem) from None


def _folders_of(topics: list[str]) -> dict[str, str]:
    """Return the name of a folder for every topic: robot_1_map for /robot_1/map."""
    folders: dict[str, str] = {}
    for topic in topics:
        name = re.sub(r"\W+", "_", topic, flags=re.ASCII).strip("_") or "map"
        taken = set(folders.values())
        folders[topic] = next(
            n for n in (name, *(f"{name}_{i}" for i in range(2, len(topics) + 2))) if n not in taken
        )
    return folders


def _print(found: RecordingInfo, file: str) -> None:
    from rich.table import Table
    from rich.text import Text

    from mapmeld.cli.tables import print_lines, print_table
    from mapmeld.io import printable
    from mapmeld.wording import rounded

    if not found.topics:
        lost = bool(found.left_out)
        print_lines("No maps could be read from this recording." if lost else "No maps in this recording.")
        return
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim", pad_edge=False)
    table.add_column("topic", overflow="fold")
    table.add_column("type", overflow="fold")
    for heading in ("maps", "updates", "first [s]", "last [s]", "cells", "cell [m]"):
        table.add_column(Text(heading), justify="right", no_wrap=True)
    table.add_column("frame", overflow="fold")
    for topic in found.topics:
        times = ["-" if time is None else rounded(time, 3) for time in (topic.first, topic.last)]
        size = "-" if topic.shape is None else f"{topic.shape[1]} x {topic.shape[0]}"
        side = "-" if topic.resolution is None else f"{topic.resolution:g}"
        texts = (topic.name, topic.type, topic.maps, topic.updates, *times, size, side, topic.frame_id or "-")
        table.add_row(*(Text(printable(str(text))) for text in texts))
    print_table(table)
    for topic in found.topics:
        if topic.problem is not None:
            print_lines(f"{topic.name}: {topic.problem}")
    readable = [topic.name for topic in found.topics if topic.problem is None]
    if readable:
        print_lines("", f"For other commands: {file}#{readable[0]}, or with @SECONDS the map at that time.")


def _say_left_out(file: str, left_out: Mapping[str, int]) -> None:
    """Say on stderr what of a recording was not used."""
    for text in _left_out_said(left_out):
        say(f"note: {file}: left out: {text}")


def _left_out_said(left_out: Mapping[str, int]) -> list[str]:
    return [reason + (f" ({times} times)" if times > 1 else "") for reason, times in sorted(left_out.items())]
