import json
from pathlib import Path

import pytest

from mapmeld.experiment import ExperimentError, ExperimentSettings
from mapmeld.experiment import folder as folders
from mapmeld.experiment.folder import add_time, open_folder, read_row, stage_times, write_row
from mapmeld.experiment.rows import JoinRow, MatchingRow
from mapmeld.fingerprint import code_version

SETTINGS = ExperimentSettings(environments=1, mappings=2)
JOIN = JoinRow(
    environment=1,
    mapping_1=1,
    mapping_2=2,
    method="alphabet",
    members=(1, 2, 3),
    poses=((0.0, 0.0, 0.0), (1.0, 2.5, -0.1), (3.0, 0.0, 0.0)),
    tried=2,
    right=1,
    accuracies=(0.95, 0.94),
    seconds=2.0,
)
MATCHING = MatchingRow(
    environment=1,
    mapping_1=1,
    mapping_2=2,
    method="alphabet",
    strategy="paper",
    steps=7,
    truth=(1.0, 0.0, 0.0),
    T_1_2=None,
    true_overlap=0.5,
    right=False,
    accepted=False,
    translation_error=None,
    rotation_error=None,
    probability=None,
    similarity=0.0,
    similarity_of_truth=0.5,
    cause="nothing found: no corners",
    accuracy=None,
    first_right=None,
    over_time=((0.0, False, None), (5.0, True, 0.9)),
    seconds=1.0,
)


@pytest.mark.parametrize("row", [JOIN, MATCHING])
def test_a_row_comes_back_as_it_was(row: JoinRow | MatchingRow, tmp_path: Path) -> None:
    write_row(tmp_path / "deep" / "row.json", row)
    assert read_row(tmp_path / "deep" / "row.json", type(row)) == row


@pytest.mark.parametrize(
    "change",
    [
        {"members": "12"},
        {"members": [1, "2"]},
        {"poses": [[0.0, 0.0]]},
        {"tried": 1.5},
        {"right": True},
        {"method": None},
        {"more": 1},
    ],
)
def test_a_damaged_row_is_said_in_one_line(change: dict[str, object], tmp_path: Path) -> None:
    path = tmp_path / "row.json"
    write_row(path, JOIN)
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(ExperimentError, match=r"row\.json: is damaged.*makes it again"):
        read_row(path, JoinRow)


def test_a_row_that_is_no_json_is_said_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "row.json").write_text("{")
    with pytest.raises(ExperimentError, match=r"is not JSON.* remove it, and"):
        read_row(tmp_path / "row.json", JoinRow)


def test_the_same_settings_open_the_folder_again(tmp_path: Path) -> None:
    root = tmp_path / "x"
    open_folder(root, SETTINGS)
    before = (root / "settings.json").read_bytes()
    open_folder(root, SETTINGS)
    assert (root / "settings.json").read_bytes() == before


def test_other_settings_are_refused_and_named(tmp_path: Path) -> None:
    root = tmp_path / "x"
    open_folder(root, SETTINGS)
    with pytest.raises(ExperimentError, match=r"of other settings \(seed: 0, now 7\).*force=True"):
        open_folder(root, ExperimentSettings(environments=1, mappings=2, seed=7))


def test_other_code_is_refused(tmp_path: Path) -> None:
    root = tmp_path / "x"
    open_folder(root, SETTINGS)
    kept = json.loads((root / "settings.json").read_text())
    (root / "settings.json").write_text(json.dumps(kept | {"mapmeld": "0.0.1+abc"}))
    with pytest.raises(ExperimentError, match=r"of other code \(mapmeld: \"0\.0\.1\+abc\", now"):
        open_folder(root, SETTINGS)


def test_force_removes_an_experiment_and_nothing_else(tmp_path: Path) -> None:
    root = tmp_path / "x"
    open_folder(root, SETTINGS)
    write_row(root / "joins" / "alphabet" / "01-1-2.json", JOIN)
    (root / "notes.txt").write_text("mine")
    open_folder(root, ExperimentSettings(environments=1, mappings=2, seed=7), force=True)
    assert not (root / "joins" / "alphabet").exists()
    assert (root / "notes.txt").read_text() == "mine"
    assert json.loads((root / "settings.json").read_text())["seed"] == 7


@pytest.mark.parametrize("force", [False, True])
def test_a_folder_with_something_else_is_never_touched(force: bool, tmp_path: Path) -> None:
    (tmp_path / "maps").mkdir()
    with pytest.raises(ExperimentError, match="is not empty and holds no experiment"):
        open_folder(tmp_path, SETTINGS, force=force)
    assert [path.name for path in tmp_path.iterdir()] == ["maps"]


def test_a_file_or_a_missing_parent_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ExperimentError, match="is not a folder"):
        open_folder(tmp_path / "file", SETTINGS)
    with pytest.raises(ExperimentError, match="does not exist; make it first"):
        open_folder(tmp_path / "no" / "x", SETTINGS)


def test_what_was_cut_off_is_removed(tmp_path: Path) -> None:
    root = tmp_path / "x"
    open_folder(root, SETTINGS)
    (root / "mappings" / ".mapmeld-1.tmp").mkdir()
    (root / "mappings" / ".mapmeld-1.tmp" / "map.pgm").write_text("")
    (root / ".mapmeld-2.tmp").write_text("")
    open_folder(root, SETTINGS)
    assert not list(root.rglob(".mapmeld-*"))


def test_times_add_up_over_runs(tmp_path: Path) -> None:
    assert stage_times(tmp_path) == {}
    add_time(tmp_path, "mappings", 2.0)
    add_time(tmp_path, "mappings", 0.5)
    add_time(tmp_path, "joins", 1.0)
    assert stage_times(tmp_path) == {"mappings": 2.5, "joins": 1.0}


def test_the_version_knows_the_code_of_the_stages() -> None:
    home = Path(folders.__file__).parents[1]
    for part in folders._CODE:
        assert (home / part).exists()
    assert folders.version() != code_version()
