import errno
from pathlib import Path

import pytest
from listing import contents

from mapmeld.io import MapFileError
from mapmeld.io.folders import FolderError, check_folder, whole_folder


def write(folder: Path, *, force: bool = False, ours: tuple[str, ...] = (), **files: str) -> None:
    with whole_folder(folder, force=force, ours=ours) as temporary:
        for name, text in files.items():
            path = temporary / name.replace("__", "/")
            path.parent.mkdir(exist_ok=True)
            path.write_text(text)


def interrupted(folder: Path) -> None:
    with whole_folder(folder, force=False, ours=()) as temporary:
        (temporary / "a").write_text("1")
        raise RuntimeError


def write_while(folder: Path, other: str) -> None:
    """Write a folder while somebody else writes a file into it."""
    with whole_folder(folder, force=False, ours=()) as temporary:
        (temporary / "a").write_text("1")
        folder.mkdir(exist_ok=True)
        (folder / other).write_text("mine")


def full_disk(folder: Path, *, temporary_too: bool = True) -> None:
    with whole_folder(folder, force=False, ours=()) as temporary:
        path = temporary / "sub" / "a.png"
        if temporary_too:
            raise MapFileError.of(path, "cannot be written: No space left on device")
        raise OSError(errno.ENOSPC, "No space left on device", str(path))


@pytest.mark.parametrize("exists", [False, True])
def test_messages_name_the_folder_that_was_asked_for(
    tmp_path: Path, exists: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    out = Path("out")
    if exists:
        out.mkdir()
    with pytest.raises(FolderError) as caught:
        full_disk(out)
    assert str(caught.value) == "out/sub/a.png: cannot be written: No space left on device"
    with pytest.raises(FolderError) as caught:
        full_disk(out, temporary_too=False)
    assert str(caught.value) == "out: cannot be written: No space left on device"


def test_other_errors_pass_as_they_are(tmp_path: Path) -> None:
    for error in (MapFileError("other: trouble"), OSError(errno.EPIPE, "Broken pipe")):
        with pytest.raises(type(error)) as caught, whole_folder(tmp_path / "out", force=False, ours=()):
            raise error
        assert caught.value is error


def test_a_new_folder_appears_whole(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with whole_folder(out, force=False, ours=()) as temporary:
        (temporary / "a").write_text("1")
        assert not out.exists()
    assert contents(tmp_path) == {"out/a"}


def test_an_empty_folder_is_filled(tmp_path: Path) -> None:
    inode = tmp_path.stat().st_ino
    write(tmp_path, a="1", sub__b="2")
    assert contents(tmp_path) == {"a", "sub/b"}
    assert tmp_path.stat().st_ino == inode  # a shell that stands in it sees the files


def test_after_an_error_nothing_is_left(tmp_path: Path) -> None:
    for out in (tmp_path / "new", tmp_path):
        with pytest.raises(RuntimeError):
            interrupted(out)
        assert list(tmp_path.iterdir()) == []


def test_force_replaces_ours_and_keeps_the_rest(tmp_path: Path) -> None:
    write(tmp_path, a="1", stale="1", sub__stale="1")
    (tmp_path / "mine").write_text("mine")
    with pytest.raises(FolderError, match="not empty"):
        write(tmp_path, a="2")
    assert (tmp_path / "a").read_text() == "1"
    write(tmp_path, force=True, ours=("a", "stale", "sub/stale", "never/there"), a="2")
    assert contents(tmp_path) == {"a", "mine"}
    assert (tmp_path / "a").read_text() == "2"


def test_a_file_that_appears_meanwhile_is_safe(tmp_path: Path) -> None:
    with pytest.raises(FolderError, match="not empty any more"):
        write_while(tmp_path, "a")
    assert (tmp_path / "a").read_text() == "mine"
    assert contents(tmp_path) == {"a"}


def test_a_folder_that_appears_meanwhile_is_safe(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with pytest.raises(FolderError, match="cannot be written"):
        write_while(out, "mine")
    assert contents(tmp_path) == {"out/mine"}


def test_a_folder_in_the_place_of_a_file(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    with pytest.raises(FolderError, match="is a folder"):
        write(tmp_path, force=True, a="1", b="1")
    assert contents(tmp_path) == set()


def test_what_cannot_be_a_folder(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(FolderError, match="not a folder"):
        check_folder(tmp_path / "file", force=True)
    with pytest.raises(FolderError, match="does not exist"):
        check_folder(tmp_path / "no" / "out", force=True)
    (tmp_path / "dangling").symlink_to(tmp_path / "gone")
    with pytest.raises(FolderError, match="not a folder"):
        check_folder(tmp_path / "dangling", force=True)


def test_the_folder_of_the_shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write(Path(), a="1")
    assert contents(tmp_path) == {"a"}
    write(Path("b"), a="1")
    assert contents(tmp_path) == {"a", "b/a"}
