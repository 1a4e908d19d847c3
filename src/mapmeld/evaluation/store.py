"""Rows on disk: a folder of Parquet files, to which a running benchmark adds one after the other.

A Parquet file cannot be added to, so each batch becomes a file of its own, written whole or not at
all; whatever kills the run, what is in the folder is valid. Together the files are one data set,
as pyarrow, pandas (``pandas.read_parquet(folder)``), polars and DuckDB read it. One run at a time may
write to a folder.
"""

from __future__ import annotations

import io
import secrets
from collections.abc import Iterable, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from mapmeld.errors import MapmeldError
from mapmeld.evaluation.rows import COLUMN_KINDS, TrialKey, TrialRow
from mapmeld.extras import required
from mapmeld.io.atomic import write_files

_NAMES = [field.name for field in fields(TrialRow)]


class StoreError(MapmeldError):
    """Stored rows that cannot be read or written."""


def read_rows(folder: Path) -> list[TrialRow]:
    """Read all rows in the order in which they were added; of two with the same key, the later one.

    Raises
    ------
    StoreError
        A file is damaged, or has other columns (written by another version of mapmeld).
    MissingExtraError
        pyarrow is not installed.
    """
    rows: dict[TrialKey, TrialRow] = {}
    for part in _parts(folder):
        for row in _read_part(part):
            rows.pop(row.key, None)
            rows[row.key] = row
    return list(rows.values())


def add_rows(folder: Path, rows: Sequence[TrialRow]) -> None:
    """Add rows as one more file; the folder is made if need be. No rows, no file.

    Raises
    ------
    StoreError
        The folder cannot be made or read.
    MapFileError
        The disk refuses; nothing was added.
    MissingExtraError
        pyarrow is not installed.
    """
    if not rows:
        return
    parquet = required("pyarrow.parquet", "benchmark")
    content = io.BytesIO()
    parquet.write_table(_table(rows), content, write_page_checksum=True)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StoreError(f"{folder}: cannot be made: {error.strerror}") from error
    number = max((_number(part) for part in _parts(folder)), default=0) + 1
    write_files([(folder / f"rows-{number:06d}-{secrets.token_hex(3)}.parquet", [content.getbuffer()])])


def gather_rows(folder: Path, first: Iterable[TrialRow] = ()) -> None:
    """Put all rows into one file, those in `first` at its start and in that order, then all others.

    If this is cut short, rows are there twice for `read_rows` to see once, but none is missing.

    Raises
    ------
    StoreError, MapFileError, MissingExtraError
        As `read_rows` and `add_rows`.
    """
    parts = _parts(folder)
    ordered = {row.key: row for row in first}
    for row in read_rows(folder):
        ordered.setdefault(row.key, row)
    add_rows(folder, list(ordered.values()))
    _remove([*parts, *folder.glob(".mapmeld-*.tmp")])  # the latter are of runs that were killed


def clear_rows(folder: Path) -> None:
    """Remove all rows; other files in the folder stay.

    Raises
    ------
    StoreError
        A file cannot be removed.
    """
    _remove(_parts(folder))


def _parts(folder: Path) -> list[Path]:
    if not folder.is_dir():
        return []
    return sorted(folder.glob("rows-*.parquet"), key=lambda part: (_number(part), part.name))


def _number(part: Path) -> int:
    digits = part.name.split("-")[1].partition(".")[0]
    return int(digits) if digits.isascii() and digits.isdigit() else 0


def _remove(files: Iterable[Path]) -> None:
    for file in files:
        try:
            file.unlink(missing_ok=True)
        except OSError as error:
            raise StoreError(f"{file}: cannot be removed: {error.strerror}") from error


def _read_part(part: Path) -> list[TrialRow]:
    pyarrow, parquet = required("pyarrow", "benchmark"), required("pyarrow.parquet", "benchmark")
    try:
        table = parquet.ParquetFile(part, page_checksum_verification=True).read()
    except (OSError, pyarrow.ArrowException) as error:
        problem = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise StoreError(
            f"{part}: damaged, cannot be read ({problem}); remove this file, its trials are then run again"
        ) from error
    if not table.schema.equals(_schema()):
        raise StoreError(
            f"{part}: has other columns than this version of mapmeld writes; "
            "use another folder, or force=True to start afresh"
        )
    return [_row(values) for values in table.to_pylist()]


def _row(values: dict[str, Any]) -> TrialRow:
    if values["covariance"] is not None:
        values["covariance"] = tuple(values["covariance"])
    return TrialRow(**values)


def _table(rows: Sequence[TrialRow]) -> Any:
    pyarrow = required("pyarrow", "benchmark")
    dicts = [asdict(row) for row in rows]
    columns = {name: [values[name] for values in dicts] for name in _NAMES}
    return pyarrow.table(columns, schema=_schema())


def _schema() -> Any:
    pyarrow = required("pyarrow", "benchmark")
    kinds = {
        "string": pyarrow.string(),
        "int64": pyarrow.int64(),
        "float64": pyarrow.float64(),
        "bool": pyarrow.bool_(),
        "list": pyarrow.list_(pyarrow.float64()),
    }
    return pyarrow.schema(
        [
            pyarrow.field(f.name, kinds[COLUMN_KINDS[str(f.type)]], nullable="None" in str(f.type))
            for f in fields(TrialRow)
        ]
    )
