import json
import math
from pathlib import Path
from typing import Any

import pytest
from tiny_dataset import pair, tiny_pairs, write_pairs

from mapmeld.errors import MapmeldError
from mapmeld.evaluation import DatasetError, Kind, Tolerance, read_dataset
from mapmeld.se2 import Pose2


def test_a_data_set_as_documented(tmp_path: Path) -> None:
    folder = tmp_path / "offices"
    folder.mkdir()
    write_pairs(folder, [*tiny_pairs(), pair("loose", "one", "two", Pose2(1, 2, 3), tolerance=[1, 10])])
    dataset = read_dataset(folder)
    assert dataset.name == "offices"
    assert dataset.tolerance == Tolerance.of(0.5, 5)
    first, second, third, fourth = dataset.pairs
    assert (first.id, first.env, first.kind) == ("one-two", "office", Kind.SAME)
    assert first.map_2 == folder / "maps" / "two.yaml"
    assert (first.T_1_2, first.overlap, first.centroid) == (Pose2(3.0, -2.0, 0.6), 1.0, (8.0, 6.0))
    assert (second.overlap, second.centroid, second.tolerance) == (None, None, None)
    assert (third.kind, third.T_1_2, third.env) == (Kind.DIFFERENT, None, "")
    assert fourth.tolerance == Tolerance.of(1, 10)


def test_what_is_said_of_the_whole_data_set(tmp_path: Path) -> None:
    write_pairs(tmp_path, tiny_pairs())
    about = {"name": "bent", "description": "d", "licence": "l", "tolerance": [1.0, 10]}
    (tmp_path / "dataset.json").write_text(json.dumps(about))
    dataset = read_dataset(tmp_path)
    assert (dataset.name, dataset.tolerance) == ("bent", Tolerance.of(1, 10))


@pytest.mark.parametrize("by_folder", [True, False])
def test_another_list_of_the_same_folder(tmp_path: Path, by_folder: bool) -> None:
    folder = tmp_path / "offices"
    folder.mkdir()
    write_pairs(folder, tiny_pairs()[:1], "pairs_hard.json")
    path = (folder, "pairs_hard.json") if by_folder else (folder / "pairs_hard.json",)
    dataset = read_dataset(*path)
    assert dataset.name == "offices:pairs_hard"
    assert dataset.pairs[0].map_1 == folder / "maps" / "one.yaml"


def changed(**values: Any) -> list[dict[str, Any]]:
    entry = pair("a", "one", "two", Pose2()) | values
    return [{key: value for key, value in entry.items() if value != "left out"}]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({}, "a list of at least one pair"),
        ([], "a list of at least one pair"),
        (["a"], "pair 1: an object is needed, not 'a'"),
        (changed(id="left out"), "pair 1: 'id' must be a text"),
        (changed(id="two\nlines"), "'id' must be a text of one line"),
        (changed(id=7), "'id' must be a text of one line, not 7"),
        (changed() + changed(), "two pairs have the id 'a'"),
        (changed(kind="left out"), r"pair 1 \(a\): 'kind' must be a text"),
        (changed(kind="similar"), "kind must be 'same' or 'different', not 'similar'"),
        (changed(T=None), "a pair of the same place needs T"),
        (changed(kind="different"), "T must be null"),
        (changed(T=[1, 2]), r"T \[x m, y m, theta rad\] is needed, not \[1, 2\]"),
        (changed(T=[1, 2, "3"]), "T .* is needed"),
        (changed(T=[1, 2, math.nan]), "T .* is needed"),
        (changed(T=[1, 2, True]), "T .* is needed"),
        (changed(T=[1, 2, 10**400]), "T .* is needed"),
        (changed(map2="left out"), "'map2' must be a text"),
        (changed(overlap=1.2), "overlap must be from 0 to 1, not 1.2"),
        (changed(overlap="half"), "overlap, a number from 0 to 1 is needed"),
        (changed(centroid=[1]), r"centroid \[x m, y m\] is needed"),
        (changed(tolerance=0.5), r"tolerance \[metres, degrees\] is needed"),
        (changed(tolerance=[0, 5]), "a positive number of metres"),
    ],
)
def test_mistakes_are_named_with_file_and_pair(tmp_path: Path, content: object, said: str) -> None:
    write_pairs(tmp_path, content)
    with pytest.raises(DatasetError, match=said) as caught:
        read_dataset(tmp_path)
    assert str(tmp_path / "pairs.json") in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ([], "an object is needed"),
        ({"tolerence": [1, 10]}, "unknown key 'tolerence'.*tolerance"),
        ({"tolerance": [1, 200]}, "at most 180 degrees"),
        ({"name": ""}, "'name' must be a text"),
    ],
)
def test_mistakes_in_what_is_said_of_the_whole(tmp_path: Path, content: object, said: str) -> None:
    write_pairs(tmp_path, tiny_pairs())
    write_pairs(tmp_path, content, "dataset.json")
    with pytest.raises(DatasetError, match=said):
        read_dataset(tmp_path)


@pytest.mark.parametrize("content", [b"", b"[{]", b"\xff\xfe", b"[" * 100_000])
def test_what_is_not_json(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "pairs.json").write_bytes(content)
    with pytest.raises(DatasetError, match=r"pairs\.json: is not JSON"):
        read_dataset(tmp_path)


def test_what_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="nowhere: there is no such folder or file"):
        read_dataset(tmp_path / "nowhere")
    with pytest.raises(DatasetError, match=r"the folder has no pairs\.json"):
        read_dataset(tmp_path)
    (tmp_path / "pairs.json").mkdir()
    with pytest.raises(DatasetError, match="cannot be read"):
        read_dataset(tmp_path)


def test_the_error_is_one_that_the_command_line_understands() -> None:
    assert issubclass(DatasetError, MapmeldError)
