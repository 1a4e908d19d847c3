"""Where an experiment lies on disk, and how work that is done is found again."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from dataclasses import MISSING, asdict, fields
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Any, TypeVar, Union, get_args, get_origin, get_type_hints

from mapmeld.experiment.settings import ExperimentError, ExperimentSettings
from mapmeld.fingerprint import code_version
from mapmeld.io import MapFileError
from mapmeld.io.atomic import write_files
from mapmeld.io.plain_json import read_object

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    Row = TypeVar("Row", bound=DataclassInstance)

SETTINGS = "settings.json"
TIMES = "times.json"
ENVIRONMENTS, MAPPINGS, MATCHINGS = "environments", "mappings", "matchings"
JOINS, ELSEWHERE, NAVIGABILITY = "joins", "elsewhere", "navigability"
STAGES = (ENVIRONMENTS, MAPPINGS, MATCHINGS, JOINS, ELSEWHERE, NAVIGABILITY)
REPORT, FIGURES, TABLES = "report.html", "figures", "tables"

_LEFT = ".mapmeld-*.tmp"
_CODE = (
    "evaluation/navigability.py", "evaluation/score.py", "experiment/stages", "history", "merging",
    "recording.py", "simulation", "slam",
)  # fmt: skip


def version() -> str:
    """Return the version of mapmeld with a fingerprint of the code that the outcome depends on."""
    return code_version(*_CODE)


def open_folder(root: Path, settings: ExperimentSettings, *, force: bool = False) -> None:
    """Make the folder of an experiment, or find that it is one of the same settings and code.

    Parameters
    ----------
    root
        Its parent exists.
    force
        Throw away an experiment that lies there, and nothing else.

    Raises
    ------
    ExperimentError
        It holds something else, or an experiment of other settings or code.
    """
    wanted = {"mapmeld": version(), **settings.as_json()}
    try:
        if not root.exists():
            if not root.absolute().parent.is_dir():
                raise ExperimentError(f"{root}: the folder {root.parent} does not exist; make it first")
            root.mkdir()
        elif not root.is_dir():
            raise ExperimentError(f"{root}: exists and is not a folder")
        ours = (root / SETTINGS).is_file()
        if not ours and any(True for _ in root.iterdir()):
            raise ExperimentError(f"{root}: is not empty and holds no experiment; choose another folder")
        clear_leftovers(root)
        if ours and not force:
            _check_same(root, read_object(root / SETTINGS), wanted)
            return
        if ours:
            _clear(root)
        write_files([(root / SETTINGS, [_text(wanted)])], force=True)
        for stage in STAGES:
            (root / stage).mkdir(exist_ok=True)
    except OSError as error:
        raise ExperimentError(f"{root}: cannot be written: {error.strerror or error}") from error


def _check_same(root: Path, found: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
    wanted = json.loads(_text(wanted))
    for key in wanted:
        if found.get(key) != wanted[key]:
            what = "code" if key == "mapmeld" else "settings"
            raise ExperimentError(
                f"{root}: holds an experiment of other {what} ({key}: {_short(found.get(key))}, "
                f"now {_short(wanted[key])}); choose another folder, or force=True to begin it anew"
            )


def _short(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _clear(root: Path) -> None:
    for name in (*STAGES, FIGURES, TABLES):
        if (root / name).is_dir():
            shutil.rmtree(root / name)
    for name in (REPORT, TIMES, SETTINGS):
        (root / name).unlink(missing_ok=True)


def clear_leftovers(root: Path) -> None:
    """Remove what work that was cut off had begun to write."""
    for place in (root, *(root / stage for stage in STAGES)):
        for left in place.glob(_LEFT):
            if left.is_dir():
                shutil.rmtree(left, ignore_errors=True)
            else:
                left.unlink(missing_ok=True)


def environment_folder(root: Path, environment: int) -> Path:
    """Return the folder of an environment."""
    return root / ENVIRONMENTS / f"{environment:02}"


def mapping_folder(root: Path, environment: int, mapping: int) -> Path:
    """Return the folder of a mapping."""
    return root / MAPPINGS / f"{environment:02}-{mapping}"


def _text(content: Mapping[str, Any]) -> bytes:
    return (json.dumps(content, indent=1, allow_nan=False) + "\n").encode()


def write_row(path: Path, row: DataclassInstance) -> None:
    """Write a row as a JSON file, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_files([(path, [_text(asdict(row))])], force=True)


def read_row(path: Path, kind: type[Row]) -> Row:
    """Read a row.

    Raises
    ------
    ExperimentError
        It is no such row, or cannot be read.
    """
    try:
        content = read_object(path)
    except MapFileError as error:
        raise ExperimentError(f"{error}; remove it, and the same command makes it again") from error
    types = get_type_hints(kind)
    wanted = {field.name for field in fields(kind) if field.default is MISSING}
    if wanted != set(content):
        raise ExperimentError(f"{path}: is damaged; remove it, and the same command makes it again")
    try:
        return kind(**{name: _typed(value, types[name]) for name, value in content.items()})
    except (TypeError, ValueError) as error:
        raise ExperimentError(
            f"{path}: is damaged ({error}); remove it, and the same command makes it again"
        ) from error


def _typed(value: Any, kind: Any) -> Any:
    """Return what JSON made of a value as the value it was: tuples, and floats that look whole."""
    origin, parts = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        if value is None:
            return None
        (only,) = (part for part in parts if part is not type(None))
        return _typed(value, only)
    if origin is tuple:
        if not isinstance(value, list):
            raise TypeError(f"a list is needed, not {value!r}")
        kinds = [parts[0]] * len(value) if parts[-1] is ... else list(parts)
        return tuple(_typed(v, k) for v, k in zip(value, kinds, strict=True))
    if kind is float and type(value) is int:
        return float(value)
    if type(value) is not kind:
        raise TypeError(f"{kind.__name__} is needed, not {value!r}")
    return value


def add_time(root: Path, stage: str, seconds: float) -> None:
    """Add wall time [s] to what a stage took so far, over all runs."""
    times = stage_times(root)
    times[stage] = times.get(stage, 0.0) + seconds
    write_files([(root / TIMES, [_text(times)])], force=True)


def stage_times(root: Path) -> dict[str, float]:
    """Return the wall time [s] that each stage took so far."""
    if not (root / TIMES).is_file():
        return {}
    return {stage: float(seconds) for stage, seconds in read_object(root / TIMES).items()}
