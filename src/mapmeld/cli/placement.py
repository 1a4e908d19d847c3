"""How one map lies on another: matched, or given with ``--transform``."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

import typer

from mapmeld.cli.errors import NO_MATCH, say
from mapmeld.cli.schemas import FOLLOW_SCHEMA, MATCH_SCHEMA

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mapmeld.grid import OccupancyGrid
    from mapmeld.matching import MatchResult
    from mapmeld.se2 import Pose2

_GREATEST = 1e9  # [m]
_LIKELY = 0.5  # little common wall makes a right transform no more than this probable, too


class Placement(NamedTuple):
    """How map b lies on map a, and the match that says so; None if it was given."""

    T_a_b: Pose2
    match: MatchResult | None


def accepted_match(a: OccupancyGrid, b: OccupancyGrid, method: str, parameters: object) -> Placement:
    """Match two maps; say why and exit with 1 if the match is not accepted."""
    from mapmeld.matching import Verdict, match

    result = match(a, b, method, parameters)
    if result.verdict is not Verdict.ACCEPTED or result.T_a_b is None:
        refuse(f"{result.verdict}: {result.reason}")
    return Placement(result.T_a_b, result)


def refuse(reason: str) -> NoReturn:
    """Say that there is no match to build on, and exit with 1."""
    say(f"{reason}; nothing written (--transform lays the map down as you say)")
    raise typer.Exit(NO_MATCH)


def note_if_unlikely(
    what: str, T_a_b: Pose2, a: OccupancyGrid, b: OccupancyGrid, names: Sequence[str]
) -> None:
    """Say on stderr that the walls do not support what was given for two maps; it is used all the same."""
    from mapmeld.matching.correlative.assess import assess
    from mapmeld.wording import probability_text

    weighed = assess(a, b, [T_a_b])
    if weighed.T_a_b is None or (weighed.probability or 0.0) >= _LIKELY:
        return  # nothing to say, or nothing to object to
    probability = probability_text(weighed.probability)
    say(
        f"note: the walls of {names[0]} and {names[1]} do not support {what} "
        f"(probability {probability}: {weighed.reason}); used as given"
    )


def given_transform(text: str, a: str, b: str) -> Pose2:
    """Return what ``--transform`` says of how map b lies on map a, T_a_b.

    Parameters
    ----------
    text
        "x,y,degrees", or the name of a ``.json`` file with the answer of ``mapmeld match --json`` for the
        two maps, in either order, or the ``transform.json`` of ``mapmeld follow`` for histories with them.
    a, b
        The maps as they were named.

    Raises
    ------
    MapFileError
        The file is no such answer, or one for other maps.
    typer.BadParameter
        Not three numbers.
    typer.Exit
        The match in the file was not accepted.
    """
    if Path(text).suffix.lower() == ".json":
        return _from_file(text, a, b)
    return transform_of_numbers(text)


def transform_of_numbers(text: str, option: str = "--transform", what: str = " or a .json file") -> Pose2:
    """Return the transform that "x,y,degrees" says; `what` else the option takes."""
    from mapmeld.se2 import Pose2

    try:
        x, y, degrees = (float(part) for part in text.split(","))
        if not all(abs(v) <= _GREATEST for v in (x, y, degrees)):
            raise ValueError
    except ValueError:
        raise typer.BadParameter(
            f"three numbers x,y,degrees{what} are needed, not {text!r}", param_hint=option
        ) from None
    return Pose2(x, y, math.radians(degrees))


def _from_file(path: str, a: str, b: str) -> Pose2:
    from mapmeld.io import MapFileError
    from mapmeld.io.plain_json import read_object
    from mapmeld.se2 import Pose2

    content = read_object(path)
    if content.get("schema") == FOLLOW_SCHEMA:
        content = _as_of_match(content)
        if not _of_recordings(content):  # a process is a folder of maps
            a, b = (os.path.dirname(name) or "." for name in (a, b))  # noqa: PTH120  (texts as given)
    elif content.get("schema") != MATCH_SCHEMA:
        raise MapFileError.of(
            path,
            f"is neither the answer of 'mapmeld match --json' (schema {MATCH_SCHEMA}) nor the transform.json "
            "of 'mapmeld follow'",
        )
    maps = _texts(content.get("maps"), ("a", "b"))
    if maps is None:
        raise MapFileError.of(path, "does not say which maps were matched")
    swapped = _swapped(maps, (a, b))
    if swapped is None:
        raise MapFileError.of(
            path,
            f"is about {maps[0]} and {maps[1]}, not surely {a} and {b}; give x,y,degrees instead",
        )
    if content.get("verdict") != "accepted":
        refuse(f"{path}: {content.get('verdict')}: {content.get('reason')}")
    found = content.get("T_a_b")
    numbers: list[Any] = [found.get(key) for key in ("x", "y", "theta")] if isinstance(found, dict) else []
    if len(numbers) != 3 or not all(_is_number(v) for v in numbers):
        raise MapFileError.of(path, "its T_a_b is not x, y and theta")
    T = Pose2(*map(float, numbers))
    return T.inverse() if swapped else T


def _as_of_match(outcome: dict[str, Any]) -> dict[str, Any]:
    """Return the outcome of ``mapmeld follow`` as if its two processes were two maps."""
    processes, best = outcome.get("processes"), outcome.get("best")
    named = processes if isinstance(processes, dict) else {}
    return {
        "maps": {"a": named.get("1"), "b": named.get("2")},
        "verdict": outcome.get("standing"),
        "reason": best.get("reason") if isinstance(best, dict) else "there was nothing to match",
        "T_a_b": outcome.get("T_1_2"),
    }


def _of_recordings(content: dict[str, Any]) -> bool:
    from mapmeld.io.recordings.address import is_recording

    return all(isinstance(name, str) and is_recording(name) for name in content["maps"].values())


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= _GREATEST


def _texts(value: Any, keys: tuple[str, str]) -> tuple[str, str] | None:
    if not isinstance(value, dict):
        return None
    one, other = (value.get(key) for key in keys)
    return (one, other) if isinstance(one, str) and isinstance(other, str) else None


def _swapped(said: tuple[str, str], asked: tuple[str, str]) -> bool | None:
    """Whether the maps that are said are those asked for the other way round; None if that is not sure."""
    for key in (str, os.path.realpath, lambda path: Path(path).name):
        try:
            one, other = [tuple(key(path) for path in pair) for pair in (said, asked)]
        except ValueError:  # a null character in a name
            continue
        straight, crossed = one == other, one == other[::-1]
        if straight != crossed:
            return crossed
        if straight:
            break
    return None
