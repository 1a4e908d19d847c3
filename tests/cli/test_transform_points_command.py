import json
import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from listing import contents
from running import T_A_B, T_B_A, run, write_maps

POINTS = "points:\n  - {name: charger, x: 1.0, y: 2.0}\nposes:\n  - {name: dock, x: 1.0, y: 2.0, yaw: 0.5}\n"


def write(folder: Path, name: str, text: str = POINTS) -> Path:
    (folder / name).write_text(text)
    return folder / name


def test_from_one_map_to_another(tmp_path: Path) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    points = write(tmp_path, "p.yaml")
    outcome = run("transform-points", points, "--from", a, "--to", b, "-o", tmp_path / "o.yaml")
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out.startswith("T_to_from: x ")
    assert f"Written: {tmp_path / 'o.yaml'} (1 point, 1 pose)\n" in outcome.out
    moved = yaml.safe_load((tmp_path / "o.yaml").read_text())
    (point,), (pose,) = moved["points"], moved["poses"]
    assert point["name"] == "charger"
    assert (point["x"], point["y"]) == pytest.approx(tuple(T_B_A.apply((1.0, 2.0))), abs=0.05)
    assert pose["yaw"] == pytest.approx(0.5 + T_B_A.theta, abs=0.01)


def test_geojson(tmp_path: Path) -> None:
    content = {
        "type": "FeatureCollection",
        "features": [
            {
                "type": "Feature",
                "geometry": {"type": "Point", "coordinates": [1, 0, 9]},
                "properties": {"a": [1, 0]},
            }
        ],
    }
    points = write(tmp_path, "p.geojson", json.dumps(content))
    outcome = run("transform-points", points, "--transform", "1,2,90", "-o", tmp_path / "o.json")
    assert outcome.code == 0
    (feature,) = json.loads((tmp_path / "o.json").read_text())["features"]
    assert feature["geometry"]["coordinates"] == [1.0, 3.0, 9]
    assert feature["properties"] == {"a": [1, 0]}


def test_json_of_transform_points(tmp_path: Path) -> None:
    points = write(tmp_path, "p.yml")
    outcome = run("transform-points", points, "--transform", "1,2,90", "-o", tmp_path / "o.yaml", "--json")
    printed = json.loads(outcome.out)
    assert printed["schema"] == "mapmeld.transform-points/1"
    assert printed["T_to_from"] == {"x": 1, "y": 2, "theta": math.radians(90)}
    assert printed["count"] == {"points": 1, "poses": 1}
    assert printed["maps"] == {"from": None, "to": None}
    assert printed["files"] == [str(tmp_path / "o.yaml")]


@pytest.mark.parametrize("order", ["ab", "ba"])
@pytest.mark.parametrize("names", ["full", "short", "moved"])
def test_the_answer_of_a_match_knows_its_direction(
    tmp_path: Path, order: str, names: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_maps(tmp_path, "a", "b")
    monkeypatch.chdir(tmp_path)
    first, second = (str(tmp_path / f"{n}.yaml") if names == "full" else f"{n}.yaml" for n in order)
    asked = {"full": "{}.yaml", "short": f"{tmp_path}/./{{}}.yaml", "moved": "elsewhere/{}.yaml"}[names]
    answer = run("match", first, second, "--json").out
    write(tmp_path, "m.json", answer)
    points = write(tmp_path, "p.yaml")
    for number, (one, other, T) in enumerate([("a", "b", T_B_A), ("b", "a", T_A_B)]):
        out = tmp_path / f"{number}.yaml"
        arguments = ["--from", asked.format(one), "--to", asked.format(other), "--transform", "m.json"]
        assert run("transform-points", points, *arguments, "-o", out).code == 0
        (point,) = yaml.safe_load(out.read_text())["points"]
        assert (point["x"], point["y"]) == pytest.approx(tuple(T.apply((1.0, 2.0))), abs=0.05)


MATCH = {
    "schema": "mapmeld.match/1",
    "maps": {"a": "x/map.yaml", "b": "y/map.yaml"},
    "verdict": "accepted",
    "reason": "as a test",
    "T_a_b": {"x": 1, "y": 2, "theta": 0.5},
}


def test_a_transform_is_weighed_where_the_maps_are_there(tmp_path: Path) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    points = write(tmp_path, "p.yaml")
    arguments = ["--from", a, "--to", b, "-o", tmp_path / "o.yaml", "--transform", "1,2,10"]
    outcome = run("transform-points", points, *arguments)
    assert outcome.code == 0
    assert "do not support --transform" in outcome.line


FOLLOWED = {
    "schema": "mapmeld.follow/1",
    "processes": {"1": "runs/a", "2": "runs/b"},
    "standing": "accepted",
    "T_1_2": {"x": 1, "y": 2, "theta": 0.5},
    "best": {"reason": "as a test"},
}
ROBOTS = {"1": "run.mcap#/robot_1/map", "2": "run.mcap#/robot_2/map"}


@pytest.mark.parametrize(
    ("change", "to_map", "from_map", "code", "said"),
    [
        ({}, "runs/a/9.yaml", "runs/b/8.yaml", 0, (1, 2)),
        ({}, "runs/b/8.yaml", "runs/a/9.yaml", 0, None),
        ({}, "runs/c/8.yaml", "runs/a/9.yaml", 2, "is about runs/a and runs/b"),
        ({}, "a.yaml", "b.yaml", 2, "is about runs/a and runs/b"),
        ({"processes": ROBOTS}, ROBOTS["1"], ROBOTS["2"], 0, (1, 2)),
        (
            {"standing": "withdrawn", "T_1_2": None},
            "runs/a/9.yaml",
            "runs/b/8.yaml",
            1,
            "withdrawn: as a test",
        ),
        ({"processes": None}, "runs/a/9.yaml", "runs/b/8.yaml", 2, "which maps"),
    ],
)
def test_the_outcome_of_following_can_be_given(
    tmp_path: Path, change: dict[str, object], to_map: str, from_map: str, code: int, said: object
) -> None:
    outcome = write(tmp_path, "transform.json", json.dumps({**FOLLOWED, **change}))
    points = write(tmp_path, "p.yaml", "points: [{x: 0.0, y: 0.0}]\n")
    arguments = ["--to", to_map, "--from", from_map, "--transform", outcome, "-o", tmp_path / "o.yaml"]
    done = run("transform-points", points, *arguments)
    assert done.code == code, done.err
    if isinstance(said, str):
        assert said in done.line
    else:
        (point,) = yaml.safe_load((tmp_path / "o.yaml").read_text())["points"]
        assert ((point["x"], point["y"]) == (1, 2)) is (said is not None)


@pytest.mark.parametrize(
    ("change", "maps", "code", "said"),
    [
        ({}, ("x/map.yaml", "y/map.yaml"), 0, ""),
        ({}, ("z/map.yaml", "w/map.yaml"), 2, "not surely"),  # which is which?
        ({}, ("other.yaml", "y/map.yaml"), 2, "x/map.yaml and y/map.yaml"),
        ({"schema": "mapmeld.merge/1"}, ("x/map.yaml", "y/map.yaml"), 2, "mapmeld.match/1"),
        ({"verdict": "rejected"}, ("x/map.yaml", "y/map.yaml"), 1, "rejected: as a test"),
        ({"verdict": None}, ("x/map.yaml", "y/map.yaml"), 1, "nothing written"),
        ({"T_a_b": None}, ("x/map.yaml", "y/map.yaml"), 2, "T_a_b"),
        ({"T_a_b": {"x": 1, "y": 2}}, ("x/map.yaml", "y/map.yaml"), 2, "T_a_b"),
        ({"T_a_b": {"x": 1, "y": 2, "theta": "3"}}, ("x/map.yaml", "y/map.yaml"), 2, "T_a_b"),
        ({"T_a_b": {"x": 1, "y": 2e9, "theta": 3}}, ("x/map.yaml", "y/map.yaml"), 2, "T_a_b"),
        ({"maps": None}, ("x/map.yaml", "y/map.yaml"), 2, "which maps"),
        ({"maps": {"a": "x/map.yaml"}}, ("x/map.yaml", "y/map.yaml"), 2, "which maps"),
        ({"maps": {"a": "\0", "b": "y/map.yaml"}}, ("x/map.yaml", "y/map.yaml"), 2, "not surely"),
    ],
)
def test_files_that_are_given_for_a_match(
    tmp_path: Path, change: dict[str, object], maps: tuple[str, str], code: int, said: str
) -> None:
    match = write(tmp_path, "m.json", json.dumps({**MATCH, **change}))
    points = write(tmp_path, "p.yaml")
    arguments = ["--to", maps[0], "--from", maps[1], "--transform", match, "-o", tmp_path / "o.yaml"]
    outcome = run("transform-points", points, *arguments)
    assert outcome.code == code
    if code:
        assert said in outcome.line
        assert not (tmp_path / "o.yaml").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "--from"),
        (["--from", "a.yaml"], "other map"),
        (["--to", "a.yaml", "--transform", "1,2,3"], "other map"),
        (["--transform", "m.json"], "names of both maps"),
        (["--transform", "1,2"], "--transform"),
        (["--transform", "1,2,nan"], "--transform"),
        (["--transform", "1,2e9,0"], "--transform"),
        (["--transform", "none.json", "--from", "a.yaml", "--to", "b.yaml"], "none.json: no such file"),
        (["--from", "a.yaml", "--to", "none.yaml"], "none.yaml: no such file"),
    ],
)
def test_wrong_usage(
    tmp_path: Path, arguments: list[str], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_maps(tmp_path, "a", "b")
    points = write(tmp_path, "p.yaml")
    outcome = run("transform-points", points, *arguments, "-o", tmp_path / "o.yaml")
    assert outcome.code == 2
    assert said in outcome.line
    assert not (tmp_path / "o.yaml").exists()


@pytest.mark.parametrize(
    ("name", "text", "out", "said"),
    [
        ("p.yaml", POINTS, "o.geojson", "another kind"),
        ("p.geojson", "{}", "o.yaml", "another kind"),
        ("p.csv", POINTS, "o.csv", "no known kind"),
        ("p.yaml", "a: b", "o.yaml", "none of points, poses, polygons"),
        ("p.geojson", "{}", "o.geojson", "p.geojson: has an object of the type 'None'"),
        ("p.json", "[" * 100_000, "o.json", "too deep"),
        ("p.json", '{"type": "Point", "coordinates": [1e999, 0]}', "o.json", "too large"),
        ("p.yaml", POINTS, "nowhere/o.yaml", "does not exist"),
    ],
)
def test_files_that_cannot_be(
    tmp_path: Path, name: str, text: str, out: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    points = write(tmp_path, name, text)
    before = contents(tmp_path)
    monkeypatch.setattr("mapmeld.matching.match", lambda *_: pytest.fail("matched before it looked"))
    outcome = run("transform-points", points, "--from", a, "--to", b, "-o", tmp_path / out)
    assert outcome.code == 2
    assert said in outcome.line
    assert contents(tmp_path) == before


def test_no_match_and_nothing_replaced_unasked(tmp_path: Path) -> None:
    a, empty = write_maps(tmp_path, "a", "empty")
    points = write(tmp_path, "p.yaml")
    outcome = run("transform-points", points, "--from", a, "--to", empty, "-o", tmp_path / "o.yaml")
    assert outcome.code == 1
    assert "nothing to match on" in outcome.line
    assert not (tmp_path / "o.yaml").exists()
    assert run("transform-points", points, "--transform", "1,2,3", "-o", points).code == 2
    assert points.read_text() == POINTS
    assert run("transform-points", points, "--transform", "1,2,0", "-o", points, "--force").code == 0
    np.testing.assert_allclose([yaml.safe_load(points.read_text())["points"][0][k] for k in "xy"], [2, 4])
