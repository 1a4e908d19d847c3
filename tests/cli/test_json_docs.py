"""docs/json.md lists exactly the fields that are printed."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from changed_maps import write_old_and_new
from running import run, write_maps

from mapmeld.matching import Alternative, MatchResult, Verdict
from mapmeld.se2 import Pose2

ROOT = Path(__file__).parents[2]
DOCUMENT = ROOT / "docs" / "json.md"
RECORDING = ROOT / "examples" / "recording" / "two_robots.mcap"
# transform-points counts these in GeoJSON only.
GEOJSON_ONLY = {"count.positions"}


def documented(schema: str) -> set[str]:
    section = re.search(rf"^## {schema}$(.*?)(?=^## |\Z)", DOCUMENT.read_text(encoding="utf-8"), re.M | re.S)
    assert section is not None
    return set(re.findall(r"^\| `(.+?)` \|", section[1], re.M))


def paths(value: Any, prefix: str = "") -> set[str]:
    """Names as in the document; the settings of a method are the method's own business."""
    if prefix == "parameters":
        return {prefix}
    found = {prefix} if prefix else set()
    if isinstance(value, dict):
        for key, inner in value.items():
            found |= paths(inner, f"{prefix}.{key}" if prefix else key)
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for inner in value:
            found |= paths(inner, f"{prefix}[]")
    return found


def in_short(names: set[str]) -> set[str]:
    """Without the names of mere containers, which the document may list or leave out."""
    return {name for name in names if not any(n.startswith((f"{name}.", f"{name}[]")) for n in names)}


def printed_by(schema: str, folder: Path) -> Any:
    maps = write_maps(folder, "a", "b", "mirrored")
    a, b, _ = maps
    if schema == "mapmeld.match/1":
        return run("match", a, b, "--json")
    if schema == "mapmeld.find/1":
        run("index", folder, "-o", folder / "i")
        return run("find", a, "--in", folder / "i", "--json")
    if schema == "mapmeld.bag.info/1":
        return run("bag", "info", RECORDING, "--json")
    if schema == "mapmeld.merge/1":
        # One map joins, one is refused with a transform.
        return run("merge", *maps, "-o", folder / "m.yaml", "--json")
    if schema == "mapmeld.diff/1":
        return run("diff", *write_old_and_new(folder), "-o", folder / "d", "--json")
    if schema == "mapmeld.rebase/1":
        return run("rebase", b, "--onto", a, "-o", folder / "r.yaml", "--json", "--lattice")
    if schema == "mapmeld.navigability/1":
        return run("navigability", b, "--truth", a, "--align", "--pairs", "3", "--json")
    (folder / "p.yaml").write_text(
        "points: [{x: 1, y: 2}]\nposes: [{x: 1, y: 2, yaw: 3}]\n"
        "polygons: [{points: [[0, 0], [1, 0], [1, 1]]}]\n"
    )
    return run(
        "transform-points", folder / "p.yaml", "--from", a, "--to", b, "-o", folder / "o.yaml", "--json"
    )


@pytest.mark.parametrize(
    "schema",
    [
        "mapmeld.match/1",
        "mapmeld.merge/1",
        "mapmeld.find/1",
        "mapmeld.bag.info/1",
        "mapmeld.diff/1",
        "mapmeld.rebase/1",
        "mapmeld.transform-points/1",
        "mapmeld.navigability/1",
    ],
)
def test_the_document_lists_what_is_printed(tmp_path: Path, schema: str) -> None:
    printed = json.loads(printed_by(schema, tmp_path).out)
    assert printed["schema"] == schema
    found = {name for name in in_short(paths(printed)) if not name.startswith("match.parameters.")}
    assert found - {"match.parameters"} == in_short(documented(schema)) - {"match.parameters", *GEOJSON_ONLY}


@pytest.mark.parametrize(("schema", "line"), [("mapmeld.follow.step/1", -2), ("mapmeld.follow/1", -1)])
def test_the_document_lists_what_following_prints(schema: str, line: int) -> None:
    printed = json.loads(run("follow", RECORDING, "--json").out.splitlines()[line])
    assert printed["schema"] == schema
    assert in_short(paths(printed)) == in_short(documented(schema))


def test_what_the_default_method_fills_in(tmp_path: Path) -> None:
    printed = json.loads(run("match", *write_maps(tmp_path, "a", "b"), "--json").out)
    assert printed["method"] == "correlative"
    assert 0.95 < printed["probability"] <= 1
    assert [len(row) for row in printed["covariance"]] == [3, 3, 3]
    others = [other["probability"] for other in printed["alternatives"]]
    assert all(other <= printed["probability"] for other in others)
    assert printed["probability"] + sum(others) <= 1 + 1e-9


def test_an_ambiguous_answer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    second = Alternative(Pose2(4, 5, 6), 0.3, 0.41)
    answer = MatchResult(Pose2(1, 2, 3), Verdict.AMBIGUOUS, "two", 0.5, alternatives=(second,))
    monkeypatch.setattr("mapmeld.matching.match", lambda *_: answer)
    outcome = run("match", *write_maps(tmp_path, "a", "b"), "--json")
    assert outcome.code == 1
    printed = json.loads(outcome.out)
    assert printed["verdict"] == "ambiguous"
    assert printed["covariance"] is None
    assert printed["alternatives"] == [
        {"T_a_b": {"x": 4, "y": 5, "theta": 6}, "similarity": 0.3, "probability": 0.41}
    ]
