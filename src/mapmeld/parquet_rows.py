"""Rows on disk: a folder of Parquet files, to which running work adds one after the other.

A Parquet file cannot be added to, so each batch becomes a file of its own, written whole or not at
all; whatever kills the run, what is in the folder is valid. Together the files are one data set,
as pyarrow, pandas (``pandas.read_parquet(folder)``), polars and DuckDB read it. One run at a time may
write to a folder.
"""

from __future__ import annotations

import io
import secrets
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from mapmeld.errors import MapmeldError
from mapmeld.extras import required
from mapmeld.io.atomic import write_files


class StoreError(MapmeldError):
    """Stored rows that cannot be read or written."""


class Row(Protocol):
    """A flat dataclass whose fields are of the kinds in `COLUMN_KINDS`."""

    @property
    def key(self) -> Hashable:
        """What the row is about: of two rows with the same key, the later one counts."""


# Column types by the annotations of the fields: changing a field changes what is stored.
COLUMN_KINDS: Mapping[str, str] = {
    "str": "string",
    "str | None": "string",
    "int": "int64",
    "int | None": "int64",
    "bool": "bool",
    "float": "float64",
    "float | None": "float64",
    "tuple[float, ...] | None": "list",
    "tuple[float, ...]": "list",
}

R = TypeVar("R", bound=Row)


@dataclass(frozen=True, slots=True)
class RowStore(Generic[R]):
    """Rows of one dataclass in folders.

    Attributes
    ----------
    kind
        The dataclass.
    extra
        The extra of mapmeld that has pyarrow, for the message where it is missing.
    """

    kind: type[R]
    extra: str

    def open(self, folder: Path) -> list[R]:
        """Find out, before any work, that rows could not be kept in a folder, and read those that are in it.

        Raises
        ------
        StoreError, MissingExtraError
            As `read` and `add`.
        """
        required("pyarrow.parquet", self.extra)
        _make(folder)
        return self.read(folder)

    def read(self, folder: Path) -> list[R]:
        """Read all rows in the order in which they were added; of two with the same key, the later one.

        Raises
        ------
        StoreError
            A file is damaged, or has other columns (written by another version of mapmeld).
        MissingExtraError
            pyarrow is not installed.
        """
        rows: dict[Hashable, R] = {}
        for part in _parts(folder):
            for row in self._read_part(part):
                rows.pop(row.key, None)
                rows[row.key] = row
        return list(rows.values())

    def add(self, folder: Path, rows: Sequence[R]) -> None:
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
        parquet = required("pyarrow.parquet", self.extra)
        content = io.BytesIO()
        parquet.write_table(self._table(rows), content, write_page_checksum=True)
        _make(folder)
        number = max((_number(part) for part in _parts(folder)), default=0) + 1
        write_files([(folder / f"rows-{number:06d}-{secrets.token_hex(3)}.parquet", [content.getbuffer()])])

    def gather(self, folder: Path, first: Iterable[R] = ()) -> None:
        """Put all rows into one file, those in `first` at its start and in that order, then all others.

        If this is cut short, rows are there twice for `read` to see once, but none is missing.

        Raises
        ------
        StoreError, MapFileError, MissingExtraError
            As `read` and `add`.
        """
        parts = _parts(folder)
        ordered = {row.key: row for row in first}
        for row in self.read(folder):
            ordered.setdefault(row.key, row)
        self.add(folder, list(ordered.values()))
        _remove([*parts, *folder.glob(".mapmeld-*.tmp")])  # the latter are of runs that were killed

    def clear(self, folder: Path) -> None:
        """Remove all rows; other files in the folder stay.

        Raises
        ------
        StoreError
            A file cannot be removed.
        """
        _remove(_parts(folder))

    def _read_part(self, part: Path) -> list[R]:
        pyarrow, parquet = required("pyarrow", self.extra), required("pyarrow.parquet", self.extra)
        try:
            table = parquet.ParquetFile(part, page_checksum_verification=True).read()
        except (OSError, pyarrow.ArrowException) as error:
            problem = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise StoreError(
                f"{part}: damaged, cannot be read ({problem}); remove this file, what was in it is run again"
            ) from error
        if not table.schema.equals(self._schema()):
            raise StoreError(
                f"{part}: has other columns than this version of mapmeld writes; "
                "use another folder, or remove this file, and what was in it is run again"
            )
        lists = [field.name for field in self._schema() if pyarrow.types.is_list(field.type)]
        return [self._row(values, lists) for values in table.to_pylist()]

    def _row(self, values: dict[str, Any], lists: Sequence[str]) -> R:
        for name in lists:
            if values[name] is not None:
                values[name] = tuple(values[name])
        return self.kind(**values)

    def _table(self, rows: Sequence[R]) -> Any:
        pyarrow = required("pyarrow", self.extra)
        dicts = [asdict(row) for row in rows]  # type: ignore[call-overload]
        columns = {name: [values[name] for values in dicts] for name in self._schema().names}
        return pyarrow.table(columns, schema=self._schema())

    def _schema(self) -> Any:
        pyarrow = required("pyarrow", self.extra)
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
                for f in fields(self.kind)  # type: ignore[arg-type]
            ]
        )


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StoreError(f"{folder}: cannot be made: {error.strerror}") from error


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
