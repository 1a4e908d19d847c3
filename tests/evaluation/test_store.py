import sys
from dataclasses import fields, replace
from pathlib import Path

import pyarrow  # type: ignore[import-untyped]
import pyarrow.parquet  # type: ignore[import-untyped]
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tiny_dataset import elsewhere, row, wrong

from mapmeld.errors import MapmeldError
from mapmeld.evaluation import TrialRow
from mapmeld.evaluation.rows import COLUMN_KINDS
from mapmeld.evaluation.store import StoreError, add_rows, clear_rows, gather_rows, read_rows
from mapmeld.extras import MissingExtraError

KINDS = {
    "str": st.text(st.characters(exclude_categories=["Cs"])),
    "int": st.integers(-(2**63), 2**63 - 1),
    "float": st.floats(allow_nan=False),
    "bool": st.booleans(),
    "tuple[float, ...]": st.lists(st.floats(allow_nan=False), max_size=9).map(tuple),
}


def any_row() -> st.SearchStrategy[TrialRow]:
    values = {}
    for field in fields(TrialRow):
        kind, _, optional = str(field.type).partition(" | ")
        values[field.name] = st.none() | KINDS[kind] if optional else KINDS[kind]
    return st.builds(TrialRow, **values)


def parts(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@settings(max_examples=25)  # each example is written to disk, down to the platter
@given(st.lists(any_row(), min_size=1, max_size=4, unique_by=lambda r: r.key))
def test_what_is_written_is_read(tmp_path_factory: pytest.TempPathFactory, rows: list[TrialRow]) -> None:
    folder = tmp_path_factory.mktemp("store") / "rows"
    add_rows(folder, rows)
    assert read_rows(folder) == rows


def test_every_column_has_a_type() -> None:
    assert {str(field.type) for field in fields(TrialRow)} <= set(COLUMN_KINDS)


def test_rows_come_back_in_the_order_in_which_they_were_added(tmp_path: Path) -> None:
    rows = [row(str(n)) for n in range(25)]
    for one in rows:
        add_rows(tmp_path, [one])
    assert read_rows(tmp_path) == rows
    assert len(parts(tmp_path)) == 25


def test_of_two_rows_with_the_same_key_the_later_counts(tmp_path: Path) -> None:
    add_rows(tmp_path, [row("a", seconds=1.0), row("b")])
    add_rows(tmp_path, [row("a", seconds=2.0)])
    assert read_rows(tmp_path) == [row("b"), row("a", seconds=2.0)]


def test_no_rows_make_no_file(tmp_path: Path) -> None:
    add_rows(tmp_path / "rows", [])
    assert not (tmp_path / "rows").exists()
    assert read_rows(tmp_path / "rows") == []


def test_gathering_makes_one_file_in_the_given_order(tmp_path: Path) -> None:
    stranger = row("a", version="older")
    for batch in ([row("c"), stranger], [row("b")], [row("a")]):
        add_rows(tmp_path, batch)
    (tmp_path / ".mapmeld-0123456789abcdef.tmp").write_text("of a run that was killed while it wrote")
    (tmp_path / "notes.txt").write_text("mine")
    gather_rows(tmp_path, [row("a"), row("b"), wrong("c")])
    assert read_rows(tmp_path) == [row("a"), row("b"), wrong("c"), stranger]
    assert len(parts(tmp_path)) == 2
    assert "notes.txt" in parts(tmp_path)


def test_gathering_that_is_cut_short_loses_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    add_rows(tmp_path, [row("a")])
    add_rows(tmp_path, [row("b")])

    def cut(self: Path, missing_ok: bool = False) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as m:
        m.setattr(Path, "unlink", cut)
        with pytest.raises(KeyboardInterrupt):
            gather_rows(tmp_path)
    assert read_rows(tmp_path) == [row("a"), row("b")]


def test_clearing_leaves_other_files(tmp_path: Path) -> None:
    add_rows(tmp_path, [row()])
    (tmp_path / "notes.txt").write_text("mine")
    clear_rows(tmp_path)
    assert parts(tmp_path) == ["notes.txt"]
    clear_rows(tmp_path / "nowhere")


def damage(part: Path, how: str) -> None:
    content = part.read_bytes()
    if how == "empty":
        part.write_bytes(b"")
    elif how == "cut":
        part.write_bytes(content[: len(content) // 2])
    elif how == "text":
        part.write_bytes(b"not a table at all, but long enough to be one")
    elif how == "digit":  # the frame is whole, and so is the text; only its checksum tells
        assert b"name of the pair" in content
        part.write_bytes(content.replace(b"name of the pair", b"name of the pain"))


@pytest.mark.parametrize("how", ["empty", "cut", "text", "digit"])
def test_a_damaged_file_is_named_with_what_to_do(tmp_path: Path, how: str) -> None:
    add_rows(tmp_path, [row("a")])
    add_rows(tmp_path, [row("name of the pair")])
    part = tmp_path / parts(tmp_path)[1]
    damage(part, how)
    with pytest.raises(StoreError, match=r"damaged, cannot be read.*remove this file") as caught:
        read_rows(tmp_path)
    assert str(part) in str(caught.value)
    assert "\n" not in str(caught.value)
    part.unlink()
    assert read_rows(tmp_path) == [row("a")]


def test_other_columns_are_refused(tmp_path: Path) -> None:
    add_rows(tmp_path, [row()])
    part = tmp_path / parts(tmp_path)[0]
    table = pyarrow.parquet.read_table(part).drop_columns(["seconds"])
    pyarrow.parquet.write_table(table, part)
    with pytest.raises(StoreError, match=r"other columns.*force=True"):
        read_rows(tmp_path)


def test_the_folder_is_one_table_for_others(tmp_path: Path) -> None:
    add_rows(tmp_path, [row("a"), elsewhere("b")])
    add_rows(tmp_path, [replace(row("c"), covariance=(1.0,) * 9)])
    table = pyarrow.parquet.read_table(tmp_path)
    assert table.column("pair").to_pylist() == ["a", "b", "c"]
    assert table.column("covariance").to_pylist() == [None, None, [1.0] * 9]


def test_a_file_in_the_place_of_the_folder(tmp_path: Path) -> None:
    (tmp_path / "rows").write_text("a file")
    with pytest.raises(StoreError, match="rows: cannot be made"):
        add_rows(tmp_path / "rows", [row()])


def test_without_pyarrow_the_command_that_installs_it_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    with pytest.raises(MissingExtraError, match=r'pip install "mapmeld\[benchmark\]"') as caught:
        add_rows(tmp_path, [row()])
    assert isinstance(caught.value, MapmeldError)
    assert parts(tmp_path) == []
