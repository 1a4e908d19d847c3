from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.cli.parameters import ParametersError, effective_parameters, parameters_as_yaml
from mapmeld.matching import METHODS, Method
from mapmeld.matching.alphabet import AlphabetParameters


@dataclass(frozen=True, kw_only=True)
class Invented:
    whole: int = 1
    number: float = 2.0
    flag: bool = False
    word: str = "w"
    maybe: float | None = None
    choice: Literal["left", "right"] = "left"


@pytest.fixture
def _invented(monkeypatch: pytest.MonkeyPatch) -> None:
    method = Method(lambda *_: None, Invented, "", lambda *_: 0.0)  # type: ignore[arg-type]
    # By import_module, for the package's attribute of that name is the function.
    module = import_module("mapmeld.matching.match")
    monkeypatch.setattr(module, "METHODS", {**METHODS, "invented": method})


def test_without_settings_the_defaults_are_in_effect() -> None:
    assert effective_parameters("alphabet", None, None) == AlphabetParameters()


def test_the_file_changes_defaults_and_set_changes_the_file(tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    file.write_text("corners: 50\ncandidates: 7\nrelation_min_px: 20\n")
    parameters = effective_parameters("alphabet", file, ["candidates=8", "candidates = 9"])
    assert parameters == AlphabetParameters(corners=50, candidates=9, relation_min_px=20.0)
    assert isinstance(parameters.relation_min_px, float)


def test_an_empty_file_changes_nothing(tmp_path: Path) -> None:
    for text in ("# nothing\n", "", "---\n"):
        (tmp_path / "p.yaml").write_text(text)
        assert effective_parameters("alphabet", tmp_path / "p.yaml", []) == AlphabetParameters()


@pytest.mark.parametrize("method", METHODS)
def test_a_setting_without_a_value_lists_them_all(method: str) -> None:
    with pytest.raises(ParametersError) as caught:
        effective_parameters(method, None, ["help"])
    for key, value in asdict(METHODS[method].parameters()).items():
        assert f"{key}={value}" in str(caught.value)


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("cornrs=3", "corners"),
        ("angle_tol=3", "angle_tolerance_deg"),
        ("xyzzy=3", "there are corners, corner_quality"),
        ("corners=many", "whole number"),
        ("corners=3.5", "whole number"),
        ("corner_quality=high", "a number"),
        ("corner_quality=nan", "finite"),
        ("corners=1", "corners must be in"),
        ("corners", "KEY=VALUE"),
        ("=3", "KEY=VALUE"),
        ("", "KEY=VALUE"),
    ],
)
def test_a_bad_setting_is_explained(setting: str, said: str) -> None:
    with pytest.raises(ParametersError, match=said) as caught:
        effective_parameters("alphabet", None, [setting])
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("cornrs: 3", "corners"),
        ("corners: 3.0", "whole number"),
        ("corners: true", "whole number"),
        ("corners: [3]", "values in one another"),
        ("corners: {a: 3}", "values in one another"),
        ("corners: " + "9" * 5000, "corners must be a whole number, not '9{37}...'$"),
        ("corners: " + "9" * 300, "corners must be in .*9\\.\\.\\.$"),
        ("corners: " + "9" * 3000, "settings of method alphabet"),
        ("corners: " + "[" * 20_000, "values in one another in line 1"),
        ("[" * 20_000, "key: value"),
        ("corners:\n" + "- " * 20_000, "values in one another in line 2"),
        ("a: &a [x, x]\nb: &b [*a, *a]\nc: [*b, *b]\n", "anchor or alias in line 1"),
        ("corners: *x", "anchor or alias in line 1"),
        ("corners: 3\ncorners: 4", "gives 'corners' twice"),
        ("# " + "x" * 70_000, "is too large for a file of settings"),
        ("x" * 500 + ": 3", "no setting 'x{37}...'; there are"),
        ("corner_quality:", "a number"),
        ("- corners", "key: value"),
        ("3", "key: value"),
        ("corners: [", "values in one another"),
        ("corners: 'a", "not valid YAML"),
        ("corners: !!python/object/apply:os.getcwd []", "uses the YAML tag"),
        ("corners: 2024-02-31", "whole number, not '2024-02-31'"),
        ("corner_quality: .nan", "finite"),
        ("3: 4", "no setting '3'"),
        ("[1, 2]: 4", "values in one another"),
        ("corners: \x00", "not valid YAML"),
    ],
)
def test_a_bad_file_is_named_and_explained(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "p.yaml"
    file.write_text(text)
    with pytest.raises(ParametersError, match=said) as caught:
        effective_parameters("alphabet", file, None)
    assert "p.yaml" in str(caught.value) or "settings of method" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500


@pytest.mark.parametrize(("name", "said"), [("missing.yaml", "no such file"), (".", "is a folder")])
def test_a_file_that_cannot_be_read(tmp_path: Path, name: str, said: str) -> None:
    with pytest.raises(ParametersError, match=said):
        effective_parameters("alphabet", tmp_path / name, None)


def test_a_file_that_is_no_text(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_bytes(b"\xff\xfe\x00corners")
    with pytest.raises(ParametersError, match="UTF-8"):
        effective_parameters("alphabet", tmp_path / "p.yaml", None)


@pytest.mark.usefixtures("_invented")
@pytest.mark.parametrize(
    ("setting", "key", "value"),
    [
        ("whole=-3", "whole", -3),
        ("number=1e-5", "number", 1e-5),
        ("number=3", "number", 3.0),
        ("flag=yes", "flag", True),
        ("flag=False", "flag", False),
        ("word=3", "word", "3"),
        ("word=a=b", "word", "a=b"),
        ("word=", "word", ""),
        ("maybe=none", "maybe", None),
        ("maybe=0.5", "maybe", 0.5),
        ("choice=right", "choice", "right"),
        ("number=.inf", "number", float("inf")),
        ("number=-.INF", "number", float("-inf")),
        ("maybe=~", "maybe", None),
        ("flag=on", "flag", True),
    ],
)
def test_values_by_kind(setting: str, key: str, value: object, tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text(f"{key}: {setting.partition('=')[2]}\n")
    for file, settings in ((None, [setting]), (tmp_path / "p.yaml", None)):
        got = getattr(effective_parameters("invented", file, settings), key)
        assert got == value
        assert type(got) is type(value)


@pytest.mark.usefixtures("_invented")
@pytest.mark.parametrize("setting", ["flag=1", "maybe=x", "choice=up", "number=", "whole="])
def test_values_of_the_wrong_kind(setting: str) -> None:
    with pytest.raises(ParametersError, match=setting.split("=")[0]):
        effective_parameters("invented", None, [setting])


@given(
    st.builds(
        AlphabetParameters,
        corners=st.integers(2, 10_000),
        corner_quality=st.floats(1e-300, 1),
        relation_min_px=st.floats(0, 1e300),
        accept_similarity=st.floats(0, 1),
    )
)
def test_what_is_written_reads_back(parameters: Any) -> None:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "p.yaml"
        file.write_text(parameters_as_yaml("alphabet", parameters, "1.2.3"), encoding="utf-8")
        assert "1.2.3" in file.read_text(encoding="utf-8")
        assert effective_parameters("alphabet", file, None) == parameters
