import json
from pathlib import Path

import pytest
from running import run, run_for_real, write_maps

from mapmeld.se2 import Pose2


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    (tmp_path / "maps").mkdir()
    write_maps(tmp_path / "maps", "a", "b", "mirrored", "empty")
    return tmp_path / "maps"


def test_an_index_is_made_brought_up_to_date_and_asked(archive: Path) -> None:
    first = run("index", archive)
    assert (first.code, first.err) == (0, "")
    assert "4 maps in the index: 4 read, 0 unchanged, 0 gone, 0 skipped." in first.out
    index = archive / "mapmeld.index"
    (archive / "b.yaml").unlink()
    (archive / "notes.yaml").write_text("nothing: here\n")
    second = run("index", archive)
    assert "3 maps in the index: 0 read, 3 unchanged, 1 gone, 1 skipped." in second.out
    assert second.line.startswith("mapmeld: skipped: ")
    assert "notes.yaml" in second.line
    assert "3 read, 0 unchanged" in run("index", archive, "--force").out

    (other,) = write_maps(archive.parent, "c")
    found = run("find", other, "--in", index)
    assert (found.code, found.err) == (0, "")
    assert "of 3 maps that look most like" in found.out
    rows = [line.split() for line in found.out.splitlines()]
    assert ["a.yaml", "accepted"] in [[row[0], row[-1]] for row in rows if row]


def test_exit_code_1_if_no_map_shows_the_place(archive: Path) -> None:
    assert run("index", archive, "-o", archive.parent / "i").code == 0
    assert run("find", archive / "empty.yaml", "--in", archive.parent / "i").code == 1
    (archive / "a.yaml").rename(archive / "a.txt")
    (archive / "b.yaml").rename(archive / "b.txt")
    assert run("index", archive, "-o", archive.parent / "i").code == 0
    (other,) = write_maps(archive.parent, "c")
    outcome = run("find", other, "--in", archive.parent / "i")
    assert outcome.code == 1
    assert "accepted" not in outcome.out
    assert run("find", other, "--in", archive.parent / "i", "--candidates-only").code == 0
    lonely = run("find", archive / "empty.yaml", "--in", archive.parent / "i", "--candidates-only")
    assert lonely.code == 1
    assert "Of 2 maps in the index, none looks like" in lonely.out


def test_json_has_the_transform_into_each_map(archive: Path) -> None:
    assert run("index", archive, "-o", archive.parent / "i").code == 0
    outcome = run("find", archive / "a.yaml", "--in", archive.parent / "i", "--json")
    found = json.loads(outcome.out)
    assert (found["schema"], found["indexed"]) == ("mapmeld.find/1", 4)
    best = found["candidates"][0]  # accepted; by looks alone the mirrored map comes before it
    assert best["path"] == str(archive / "b.yaml")
    T = best["match"]["T_a_b"]
    assert Pose2(T["x"], T["y"], T["theta"]).distance_to(Pose2(3, -2, 0.6981))[0] < 0.1
    only = json.loads(
        run("find", archive / "a.yaml", "--in", archive.parent / "i", "--json", "--candidates-only").out
    )
    assert {c["match"] for c in only["candidates"]} == {None}


def test_if_no_candidate_can_be_read_that_is_no_answer(archive: Path) -> None:
    assert run("index", archive).code == 0
    for image in archive.glob("*.pgm"):
        if image.stem != "a":
            image.unlink()
    outcome = run("find", archive / "a.yaml", "--in", archive / "mapmeld.index")
    assert outcome.code == 2
    assert "no map that looks like" in outcome.err.splitlines()[-1]


def test_maps_that_went_away_since_are_said_in_a_line_each(archive: Path) -> None:
    assert run("index", archive).code == 0
    (archive / "b.pgm").unlink()
    outcome = run("find", archive / "a.yaml", "--in", archive / "mapmeld.index")
    assert outcome.code == 1
    lines = outcome.err.splitlines()
    assert len(lines) == 2
    assert "b.pgm: no such file" in lines[0]
    assert "run 'mapmeld index' again" in lines[1]
    assert "cannot be read" in outcome.out


def test_nothing_else_is_written_over(archive: Path) -> None:
    out = archive.parent / "mine"
    out.write_text("mine")
    outcome = run("index", archive, "-o", out)
    assert outcome.code == 2
    assert "exists already" in outcome.line
    assert out.read_text() == "mine"
    assert run("index", archive, "-o", out, "--force").code == 0


def test_the_index_of_another_folder_is_not_taken_over(archive: Path) -> None:
    assert run("index", archive, "-o", archive.parent / "i").code == 0
    other = archive.parent / "other"
    other.mkdir()
    write_maps(other, "a")
    outcome = run("index", other, "-o", archive.parent / "i")
    assert outcome.code == 2
    assert "is the index of another folder" in outcome.line


def test_a_damaged_index_is_one_line_and_force_mends_it(archive: Path) -> None:
    index = archive / "mapmeld.index"
    assert run("index", archive).code == 0
    index.write_bytes(index.read_bytes()[:-5])
    for command in (["find", archive / "a.yaml", "--in", index], ["index", archive]):
        outcome = run(*command)
        assert outcome.code == 2
        assert "is damaged" in outcome.line
    assert run("index", archive, "--force").code == 0


def test_an_index_by_another_version_is_one_line_and_force_mends_it(archive: Path) -> None:
    index = archive / "mapmeld.index"
    assert run("index", archive).code == 0
    index.write_bytes(b"mapmeld index 1" + index.read_bytes()[len("mapmeld index 1") :])
    for command in (["find", archive / "a.yaml", "--in", index], ["index", archive]):
        outcome = run(*command)
        assert outcome.code == 2
        assert (
            "made by another version of mapmeld; make it again with 'mapmeld index --force'" in outcome.line
        )
    assert run("index", archive, "--force").code == 0
    assert run("find", archive / "a.yaml", "--in", index, "--candidates-only").code == 0


def test_a_folder_of_maps_that_moved_away_is_said(archive: Path) -> None:
    assert run("index", archive, "-o", archive.parent / "i").code == 0
    (query,) = write_maps(archive.parent, "a")
    archive.rename(archive.parent / "elsewhere")
    outcome = run("find", query, "--in", archive.parent / "i")
    assert outcome.code == 2
    assert "a.yaml: no such file" in outcome.err
    assert "run 'mapmeld index' again" in outcome.err
    assert "Traceback" not in outcome.err


def test_folders_without_maps(tmp_path: Path) -> None:
    assert run("index", tmp_path / "none").code == 2
    (tmp_path / "bad.yaml").write_text("x: 1\n")
    outcome = run("index", tmp_path)
    assert outcome.code == 2
    assert "none of its 1 YAML files is a map" in outcome.line
    assert not (tmp_path / "mapmeld.index").exists()
    (tmp_path / "bad.yaml").unlink()
    assert "0 maps in the index" in run("index", tmp_path).out
    (query,) = write_maps(tmp_path, "a")
    nothing = run("find", query, "--in", tmp_path / "mapmeld.index")
    assert nothing.code == 1
    assert "Of 0 maps in the index, none looks like" in nothing.out


def test_workers(archive: Path) -> None:
    outcome = run_for_real("index", archive, "--workers", 2, cwd=archive)
    assert outcome.code == 0
    assert "4 read" in outcome.out


def test_a_graph_of_candidates_only(archive: Path) -> None:
    (third,) = write_maps(archive.parent, "c")
    maps = [archive / "a.yaml", archive / "b.yaml", third, archive / "mirrored.yaml"]
    outcome = run("graph", *maps, "--candidates", 1, "--json")
    graph = json.loads(outcome.out)
    assert 2 <= len(graph["pairs"]) < 6
    assert graph["components"][0] == [0, 1, 2]
    merged = run("merge", *maps[:3], "--candidates", 1, "-o", archive.parent / "m.yaml")
    assert merged.code == 0
    clash = run(
        "merge", *maps[:3], "--candidates", 1, "--strategy", "sequential", "-o", archive.parent / "n.yaml"
    )
    assert clash.code == 2
