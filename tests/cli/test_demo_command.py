import json
from pathlib import Path

import pytest
from listing import contents
from running import run, run_for_real

import mapmeld
from mapmeld.cli.example_maps import ExamplesError, example_map
from mapmeld.report import FIGURE_NAMES


def test_the_demo_does_the_whole_job(tmp_path: Path) -> None:
    outcome = run_for_real("demo", cwd=tmp_path)
    assert outcome.code == 0, outcome.err
    assert outcome.err == ""
    out = tmp_path / "mapmeld-demo"
    assert contents(out) == {
        "merged.yaml",
        "merged.pgm",
        "overlay.png",
        "references.png",
        "explain/index.md",
        "explain/parameters.yaml",
        "explain/result.json",
        *(f"explain/{name}" for name in FIGURE_NAMES),
    }
    for said in ("T_a_b", "accepted", "merged.yaml", "overlay.png", "references.png", "explain/index.md"):
        assert said in outcome.out
    explained = json.loads((out / "explain" / "result.json").read_text())
    assert (explained["verdict"], explained["method"]) == ("accepted", "alphabet")
    # The answer that is printed and merged is the default method's, the only one that knows how sure it is.
    assert "probability   > 0.999" in outcome.out
    a = mapmeld.load(example_map("robot_1.yaml"))
    assert mapmeld.load(out / "merged.yaml").known_area > 1.2 * a.known_area


def test_the_second_run_refuses_and_force_repeats_it(tmp_path: Path) -> None:
    out = tmp_path / "demo"
    assert run("demo", "-o", out).code == 0
    before = contents(out)
    (out / "merged.yaml").write_text("changed")
    outcome = run("demo", "-o", out)
    assert outcome.code == 2
    assert "--force" in outcome.line
    assert (out / "merged.yaml").read_text() == "changed"
    assert run("demo", "-o", out, "--force").code == 0
    assert contents(out) == before
    assert "resolution" in (out / "merged.yaml").read_text()


def test_the_example_maps_of_an_installed_package_come_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "site-packages" / "mapmeld"
    (package / "examples").mkdir(parents=True)
    (package / "examples" / "robot_1.yaml").touch()
    monkeypatch.setattr(mapmeld, "__file__", str(package / "__init__.py"))
    assert example_map("robot_1.yaml") == package / "examples" / "robot_1.yaml"
    with pytest.raises(ExamplesError, match=r"robot_2\.yaml"):
        example_map("robot_2.yaml")
