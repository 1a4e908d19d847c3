from pathlib import Path

import pytest

from mapmeld.io import MapFileError
from mapmeld.io.plain_yaml import Nested, Scalar, read_fields, read_tree, short


def write(folder: Path, text: str) -> Path:
    (folder / "f.yaml").write_text(text)
    return folder / "f.yaml"


def test_values_stay_as_they_are_written(tmp_path: Path) -> None:
    file = write(tmp_path, "a: 1e-5\nb: 'yes'\nc:\nd: [1, {x: y}]\ne: {x: y}\n--- 7\n")
    fields = read_fields(file, "a file")
    assert fields["a"] == Scalar("1e-5", quoted=False)
    assert fields["b"] == Scalar("yes", quoted=True)
    assert fields["c"] == Scalar("", quoted=False)
    assert isinstance(fields["d"], list)
    assert fields["d"][0] == Scalar("1", quoted=False)
    assert isinstance(fields["e"], Nested)


@pytest.mark.parametrize("text", ["", "# a comment\n", "---\n", "---\n...\n"])
def test_nothing_is_a_file_only_where_it_may_be(tmp_path: Path, text: str) -> None:
    file = write(tmp_path, text)
    assert read_fields(file, "a file", may_be_empty=True) == {}
    with pytest.raises(MapFileError, match=r"is empty|is not a file"):
        read_fields(file, "a file")


@pytest.mark.parametrize("text", ["''", "null", "- 1", "word"])
def test_no_mapping_is_refused_though_nothing_would_do(tmp_path: Path, text: str) -> None:
    with pytest.raises(MapFileError, match="is not a file"):
        read_fields(write(tmp_path, text), "a file", may_be_empty=True)


def test_how_deep_it_may_be(tmp_path: Path) -> None:
    assert read_fields(write(tmp_path, "a: 1"), "a file", depth=1) == {"a": Scalar("1", quoted=False)}
    for text in ("a: [1]", "a: {b: 1}", "a: " + "[" * 20_000):
        with pytest.raises(MapFileError, match="values in one another in line 1, which a file never does"):
            read_fields(write(tmp_path, text), "a file", depth=1)
    assert len(read_fields(write(tmp_path, "a: [1]"), "a file", depth=2)) == 1


def test_a_long_text_is_cut_in_messages() -> None:
    assert short("a" * 40) == repr("a" * 40)
    assert short("a" * 41) == repr("a" * 37 + "...")


# ---------------------------------------------------------------------- with all that is nested
def test_a_tree_holds_everything(tmp_path: Path) -> None:
    file = write(tmp_path, "a: [1, {b: [], c: 'x'}]\nd: {e: {f: 2}}\ng:\n")
    one, two, x, nothing = (Scalar(v, quoted=v == "x") for v in ("1", "2", "x", ""))
    assert read_tree(file, "a file", depth=9, max_bytes=99) == {
        "a": [one, {"b": [], "c": x}],
        "d": {"e": {"f": two}},
        "g": nothing,
    }


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: [[[1]]]", "more than 3 levels"),
        ("a: {b: 1, b: 2}", "'b' twice"),
        ("a: {[1]: 2}", "no plain word"),
        ("a: &x [1]\nb: *x", "anchor"),
        ("a: !!set {}", "tag"),
        ("a: 1\n---\nb: 2", "second document"),
        ("a: 1" + " " * 99, "too large"),
        ("", "is empty"),
        ("# nothing", "no 'key: value' lines"),
        ("[1]", "no 'key: value' lines"),
        ("a: [1", "not valid YAML"),
    ],
)
def test_a_tree_that_is_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(MapFileError, match=said):
        read_tree(write(tmp_path, text), "a file", depth=3, max_bytes=99)
