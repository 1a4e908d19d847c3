import os
import sys
from pathlib import Path

import numpy as np
import pytest
from drawing import office, school
from index_maps import index_of, write_buildings

from mapmeld.index import MapIndex, MapIndexError, build_index, building, map_files, read_index, write_index
from mapmeld.io import save


def test_maps_are_looked_for_in_folders_but_not_in_hidden_ones_or_through_links(tmp_path: Path) -> None:
    write_buildings(tmp_path)
    (tmp_path / ".hidden").mkdir()
    save(office(), tmp_path / ".hidden" / "a.yaml")
    (tmp_path / "floor" / "round").symlink_to(tmp_path)
    assert map_files(tmp_path) == ["floor/west.yaml", "office.yaml", "school.yaml"]


def test_a_folder_that_is_none(tmp_path: Path) -> None:
    with pytest.raises(MapIndexError, match="is not a folder"):
        map_files(tmp_path / "none")


def test_only_what_changed_is_read_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_buildings(tmp_path)
    first = index_of(tmp_path)
    read: list[str] = []
    described = building._described

    def watched(root: Path, name: str) -> object:
        read.append(name)
        return described(root, name)

    monkeypatch.setattr(building, "_described", watched)
    again = build_index(tmp_path, map_files(tmp_path), first)
    assert (read, again.read, again.kept, again.gone) == ([], 0, 3, ())
    assert [m.name for m in again.index.maps] == [m.name for m in first.maps]

    save(school(), tmp_path / "office.yaml", force=True)
    os.utime(tmp_path / "office.pgm", ns=(1, 1))  # the image alone tells it too
    save(office(), tmp_path / "new.yaml")
    (tmp_path / "school.yaml").unlink()
    changed = build_index(tmp_path, map_files(tmp_path), first)
    assert sorted(read) == ["new.yaml", "office.yaml"]
    assert (changed.read, changed.kept, changed.gone) == (2, 1, ("school.yaml",))
    now = [m.name for m in changed.index.maps].index("office.yaml")
    assert np.array_equal(changed.index.ranking.signature(now).weights, first.ranking.signature(2).weights)


def test_an_image_that_is_gone_is_read_again_and_skipped(tmp_path: Path) -> None:
    write_buildings(tmp_path)
    first = index_of(tmp_path)
    (tmp_path / "school.pgm").unlink()
    again = build_index(tmp_path, map_files(tmp_path), first)
    assert again.gone == ()
    ((name, problem),) = again.skipped
    assert name == "school.yaml"
    assert "no such file" in problem


def test_bad_files_are_named_and_the_rest_is_there(tmp_path: Path) -> None:
    write_buildings(tmp_path)
    (tmp_path / "bad.yaml").write_text("image: x.pgm\nresolution: 0\norigin: [0, 0, 0]\n")
    (tmp_path / "binary.yml").write_bytes(bytes(range(256)))
    done = build_index(tmp_path, map_files(tmp_path))
    assert [name for name, _ in done.skipped] == ["bad.yaml", "binary.yml"]
    assert all("\n" not in problem for _, problem in done.skipped)
    assert len(done.index.maps) == 3


def test_an_interrupted_run_keeps_what_was_done(tmp_path: Path) -> None:
    write_buildings(tmp_path)
    kept: list[MapIndex] = []
    count = 0

    def stop() -> None:
        nonlocal count
        count += 1
        if count == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        build_index(tmp_path, map_files(tmp_path), on_map=stop, on_progress=kept.append)
    assert [m.name for m in kept[-1].maps] == ["floor/west.yaml", "office.yaml"]
    rest = build_index(tmp_path, map_files(tmp_path), kept[-1])
    assert (rest.read, rest.kept) == (1, 2)


def test_it_is_kept_from_time_to_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_buildings(tmp_path)
    monkeypatch.setattr(building, "SAVE_EVERY", 0.0)
    sizes: list[int] = []
    build_index(tmp_path, map_files(tmp_path), on_progress=lambda index: sizes.append(len(index.maps)))
    assert sizes == [1, 2, 3]


def test_processes_give_the_same(tmp_path: Path) -> None:
    write_buildings(tmp_path)
    here, there = index_of(tmp_path), build_index(tmp_path, map_files(tmp_path), workers=2).index
    assert [m.name for m in here.maps] == [m.name for m in there.maps]
    assert np.array_equal(here.ranking.weights, there.ranking.weights)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere every file name is text")
def test_a_name_that_is_no_text_is_skipped_in_a_line(tmp_path: Path) -> None:
    write_buildings(tmp_path)
    for ending in (b".yaml", b".pgm"):
        os.rename(os.fsencode(tmp_path / "school") + ending, os.fsencode(tmp_path) + b"/sch\xffool" + ending)  # noqa: PTH104
    text = os.fsencode(tmp_path) + b"/sch\xffool.yaml"
    with open(text, "rb") as file:  # noqa: PTH123
        described = file.read()
    with open(text, "wb") as file:  # noqa: PTH123
        file.write(described.replace(b"school.pgm", b"office.pgm"))
    done = build_index(tmp_path, map_files(tmp_path))
    assert [m.name for m in done.index.maps] == ["floor/west.yaml", "office.yaml"]
    ((_, problem),) = done.skipped
    assert "not Unicode" in problem
    problem.encode()
    write_index(done.index, tmp_path / "i")
    assert len(read_index(tmp_path / "i").maps) == 2
