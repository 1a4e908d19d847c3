import os
import stat
from pathlib import Path

import pytest

from mapmeld.io import MapFileError
from mapmeld.io.atomic import check_targets, whole_file, write_files


def names(folder: Path) -> list[str]:
    return sorted(entry.name for entry in folder.iterdir())


def test_files_are_written_whole_from_pieces(tmp_path: Path) -> None:
    write_files([(tmp_path / "a", (b"one ", memoryview(b"two"))), (str(tmp_path / "b"), ())])
    assert (tmp_path / "a").read_bytes() == b"one two"
    assert (tmp_path / "b").read_bytes() == b""
    assert names(tmp_path) == ["a", "b"]


def test_permissions_are_those_of_any_new_file(tmp_path: Path) -> None:
    (tmp_path / "plain").touch()
    write_files([(tmp_path / "a", (b"x",))])
    assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == stat.S_IMODE((tmp_path / "plain").stat().st_mode)


def test_nothing_is_overwritten_unasked(tmp_path: Path) -> None:
    (tmp_path / "b").write_text("old")
    with pytest.raises(
        MapFileError, match=r"b: exists already; choose another name, or force=True to replace it"
    ):
        write_files([(tmp_path / "a", (b"new",)), (tmp_path / "b", (b"new",))])
    assert names(tmp_path) == ["b"]
    assert (tmp_path / "b").read_text() == "old"


def test_force_replaces(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("something longer")
    write_files([(tmp_path / "a", (b"new",))], force=True)
    assert (tmp_path / "a").read_text() == "new"
    assert names(tmp_path) == ["a"]


def test_a_dangling_link_is_something_that_exists(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to("elsewhere")
    with pytest.raises(MapFileError, match="exists already"):
        write_files([(tmp_path / "a", (b"new",))])


def test_a_replaced_link_still_points_where_it_did(tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "target").write_text("old")
    (tmp_path / "a").symlink_to("deep/target")
    write_files([(tmp_path / "a", (b"new",))], force=True)
    assert (tmp_path / "a").is_symlink()
    assert (tmp_path / "deep" / "target").read_text() == "new"
    assert names(tmp_path / "deep") == ["target"]


def test_only_plain_files_are_replaced(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    for name in ("folder", "pipe"):
        with pytest.raises(MapFileError, match="not a plain file, so it is not replaced"):
            write_files([(tmp_path / name, (b"x",))], force=True)
    assert names(tmp_path) == ["folder", "pipe"]


@pytest.mark.parametrize("force", [False, True])
def test_a_missing_folder_is_named(tmp_path: Path, force: bool) -> None:
    with pytest.raises(MapFileError, match=r"the folder .*nowhere does not exist; make it first"):
        check_targets([tmp_path / "nowhere" / "a"], force=force)


def test_names_no_file_can_have(tmp_path: Path) -> None:
    with pytest.raises(MapFileError, match="not a usable file name"):
        write_files([(tmp_path / "a\0b", (b"x",))])
    with pytest.raises(MapFileError, match="File name too long"):
        write_files([(tmp_path / ("a" * 300), (b"x",))])
    assert names(tmp_path) == []


@pytest.mark.parametrize("force", [False, True])
def test_a_full_disk_leaves_nothing_new(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, force: bool) -> None:
    (tmp_path / "old").write_text("old")

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(MapFileError, match=r"a: cannot be written: No space left on device"):
        write_files([(tmp_path / "a", (b"x",)), (tmp_path / "b", (b"x",))], force=force)
    assert names(tmp_path) == ["old"]


def test_an_interruption_leaves_nothing_new(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(descriptor: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_files([(tmp_path / "a", (b"x",))])
    assert names(tmp_path) == []


@pytest.mark.parametrize("links", [True, False])
def test_a_file_that_appears_in_the_last_moment_is_safe(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool
) -> None:
    fsync, link = os.fsync, os.link

    def rival(descriptor: int) -> None:
        fsync(descriptor)
        (tmp_path / "b").write_text("rival")

    def refused(source: Path, target: Path) -> None:
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(os, "fsync", rival)
    monkeypatch.setattr(os, "link", link if links else refused)
    with pytest.raises(MapFileError, match="b: exists already"):
        write_files([(tmp_path / "a", (b"x",)), (tmp_path / "b", (b"x",))])
    assert names(tmp_path) == ["b"]
    assert (tmp_path / "b").read_text() == "rival"


def test_file_systems_without_hard_links(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(source: Path, target: Path) -> None:
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(os, "link", refused)
    write_files([(tmp_path / "a", (b"x",)), (tmp_path / "b", (b"y",))])
    assert names(tmp_path) == ["a", "b"]
    assert (tmp_path / "b").read_text() == "y"


def test_a_file_that_is_written_bit_by_bit_appears_at_the_end(tmp_path: Path) -> None:
    with whole_file(tmp_path / "a") as file:
        file.write(b"one ")
        assert not (tmp_path / "a").exists()
        file.write(b"two")
    assert (tmp_path / "a").read_bytes() == b"one two"
    assert names(tmp_path) == ["a"]


def test_a_file_that_fails_half_way_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "b").write_text("old")
    for force, name in ((False, "a"), (True, "b")):
        with pytest.raises(ZeroDivisionError), whole_file(tmp_path / name, force=force) as file:
            file.write(b"half" * (1 // 0))
    assert names(tmp_path) == ["b"]
    assert (tmp_path / "b").read_text() == "old"


def test_a_file_that_appears_while_another_is_written_is_safe(tmp_path: Path) -> None:
    with pytest.raises(MapFileError, match="exists already"), whole_file(tmp_path / "a"):
        (tmp_path / "a").write_text("theirs")
    assert (tmp_path / "a").read_text() == "theirs"
    assert names(tmp_path) == ["a"]


def test_a_file_bit_by_bit_where_none_can_be(tmp_path: Path) -> None:
    with pytest.raises(MapFileError, match="does not exist"), whole_file(tmp_path / "nowhere" / "a"):
        pass
