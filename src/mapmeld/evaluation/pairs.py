"""Data sets of map pairs with known truth; the format is described in docs/datasets.md."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from mapmeld.errors import MapmeldError
from mapmeld.evaluation.score import Tolerance
from mapmeld.se2 import Pose2

PAIRS_FILE = "pairs.json"
DATASET_FILE = "dataset.json"
_DATASET_KEYS = ("name", "description", "licence", "tolerance")


class DatasetError(MapmeldError):
    """A data set that cannot be read; the message names the file and the pair."""


class Kind(StrEnum):
    """Whether two maps show the same place."""

    SAME = "same"
    DIFFERENT = "different"


@dataclass(frozen=True, slots=True)
class Pair:
    """Two maps and how they fit.

    Attributes
    ----------
    id
        Name of the pair, once only in its data set.
    kind
        Whether the maps show the same place.
    map_1, map_2
        Files that `mapmeld.load` reads.
    T_1_2
        The truth: takes a point of map 2's metric frame into map 1's. None for different places.
    env
        Name of the environment, as "house 3"; may be empty.
    overlap
        Area known in both maps / known area of the smaller one, 0..1; None: not stated.
    centroid
        Middle of the overlap in map 1's frame [m]; None: not stated.
    tolerance
        What counts as right for this pair; None: what its data set says.
    """

    id: str
    kind: Kind
    map_1: Path
    map_2: Path
    T_1_2: Pose2 | None
    env: str = ""
    overlap: float | None = None
    centroid: tuple[float, float] | None = None
    tolerance: Tolerance | None = None


@dataclass(frozen=True, slots=True)
class Dataset:
    """Pairs that belong together.

    Attributes
    ----------
    name
        Short name, as in tables.
    file
        The file that lists the pairs.
    pairs
        In the order of the file.
    tolerance
        What counts as right, for pairs that do not say.
    """

    name: str
    file: Path
    pairs: tuple[Pair, ...]
    tolerance: Tolerance


def read_dataset(path: str | Path, pairs: str = PAIRS_FILE) -> Dataset:
    """Read a data set; its maps are not opened.

    Parameters
    ----------
    path
        The folder of the data set, or the file that lists the pairs.
    pairs
        Name of that file in the folder.

    Raises
    ------
    DatasetError
        A file is missing or is not in the format of docs/datasets.md.
    """
    path = Path(path)
    file = path / pairs if path.is_dir() else path
    if not path.exists():
        raise DatasetError(f"{path}: there is no such folder or file")
    if not file.exists():
        raise DatasetError(f"{path}: the folder has no {pairs}; name the list of pairs, or see its spelling")
    listed = _json(file)
    if not isinstance(listed, list) or not listed:
        raise DatasetError(f"{file}: a list of at least one pair is needed")
    read = tuple(_pair(entry, number, file) for number, entry in enumerate(listed, 1))
    seen: set[str] = set()
    for pair in read:
        if pair.id in seen:
            raise DatasetError(f"{file}: two pairs have the id {pair.id!r}")
        seen.add(pair.id)
    about = _about(file.parent / DATASET_FILE)
    name = about.get("name", file.absolute().parent.name or "pairs")
    if file.name != PAIRS_FILE:
        name = f"{name}:{file.stem}"
    return Dataset(name, file, read, about.get("tolerance", Tolerance()))


def _about(file: Path) -> Mapping[str, Any]:
    if not file.exists():
        return {}
    about = _json(file)
    if not isinstance(about, dict):
        raise DatasetError(f"{file}: an object is needed, as {{'tolerance': [0.5, 5]}}")
    for key in about:
        if key not in _DATASET_KEYS:
            raise DatasetError(f"{file}: unknown key {key!r} (there are: {', '.join(_DATASET_KEYS)})")
    read: dict[str, Any] = {}
    if "name" in about:
        read["name"] = _text(about, "name", str(file))
    if "tolerance" in about:
        read["tolerance"] = _tolerance(about["tolerance"], str(file))
    return read


def _pair(entry: object, number: int, file: Path) -> Pair:
    where = f"{file}: pair {number}"
    if not isinstance(entry, dict):
        raise DatasetError(f"{where}: an object is needed, not {_shown(entry)}")
    id_ = _text(entry, "id", where)
    where = f"{where} ({id_})"
    kind = _text(entry, "kind", where)
    if kind not in list(Kind):
        raise DatasetError(f"{where}: kind must be 'same' or 'different', not {_shown(kind)}")
    truth = entry.get("T")
    if kind == Kind.SAME and truth is None:
        raise DatasetError(f"{where}: a pair of the same place needs T, the truth [x m, y m, theta rad]")
    if kind == Kind.DIFFERENT and truth is not None:
        raise DatasetError(f"{where}: a pair of different places has no truth; T must be null")
    overlap = entry.get("overlap")
    if overlap is not None:
        (overlap,) = _numbers([overlap], 1, where, "overlap, a number from 0 to 1")
        if not 0 <= overlap <= 1:
            raise DatasetError(f"{where}: overlap must be from 0 to 1, not {overlap:g}")
    centroid = None
    if entry.get("centroid") is not None:
        x, y = _numbers(entry["centroid"], 2, where, "centroid [x m, y m]")
        centroid = (x, y)
    return Pair(
        id=id_,
        kind=Kind(kind),
        map_1=file.parent / _text(entry, "map1", where),
        map_2=file.parent / _text(entry, "map2", where),
        T_1_2=None if truth is None else Pose2(*_numbers(truth, 3, where, "T [x m, y m, theta rad]")),
        env="" if entry.get("env") is None else _text(entry, "env", where),
        overlap=overlap,
        centroid=centroid,
        tolerance=None if entry.get("tolerance") is None else _tolerance(entry["tolerance"], where),
    )


def _json(file: Path) -> object:
    try:
        content: object = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise DatasetError(f"{file}: cannot be read: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise DatasetError(f"{file}: is not JSON: {error}") from error
    return content


def _text(entry: Mapping[str, object], key: str, where: str) -> str:
    value = entry.get(key)
    if not isinstance(value, str) or not value.strip() or not value.isprintable():
        raise DatasetError(f"{where}: {key!r} must be a text of one line, not {_shown(value)}")
    return value


def _numbers(value: object, count: int, where: str, what: str) -> list[float]:
    if (
        isinstance(value, list)
        and len(value) == count
        and all(isinstance(v, int | float) and not isinstance(v, bool) for v in value)
        and all(abs(v) < 1e9 for v in value)  # beyond that it is no place on Earth; nan is not below it
    ):
        return [float(v) for v in value]
    raise DatasetError(f"{where}: {what} is needed, not {_shown(value)}")


def _tolerance(value: object, where: str) -> Tolerance:
    metres, degrees = _numbers(value, 2, where, "tolerance [metres, degrees]")
    try:
        return Tolerance.of(metres, degrees)
    except ValueError as error:
        raise DatasetError(f"{where}: {error}") from error


def _shown(value: object) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    text = ascii(value)
    return text if len(text) <= 60 else text[:57] + "..."
