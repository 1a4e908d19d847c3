from pathlib import Path

import pytest

from mapmeld.io import MapFileError
from mapmeld.io.plain_json import read_object


def test_an_object(tmp_path: Path) -> None:
    (tmp_path / "o.json").write_bytes(b'\xef\xbb\xbf{"a": [1, 2.5, null], "b": "\\u00fc"}')
    assert read_object(tmp_path / "o.json") == {"a": [1, 2.5, None], "b": "ü"}


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "is empty"),
        (b"[1]", "no object"),
        (b"{", "line 1"),
        (b'{"a": 1}\n{"b": 2}', "line 2"),
        (b'{"a": NaN}', "NaN is no number"),
        (b'{"a": -Infinity}', "-Infinity is no number"),
        (b'{"a": 1e999}', "'1e999' is too large a number"),
        (b'{"a": ' + b"9" * 5000 + b"}", "is not JSON"),
        (b"\xff\xfe\xff", "not Unicode"),
        (b'{"a": ' + b"[" * 200_000, "too deep"),
    ],
)
def test_what_is_none(tmp_path: Path, data: bytes, said: str) -> None:
    file = tmp_path / "o.json"
    file.write_bytes(data)
    with pytest.raises(MapFileError) as refused:
        read_object(file)
    assert said in str(refused.value)
    assert str(refused.value).startswith(str(file))
    assert "\n" not in str(refused.value)


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(MapFileError, match="no such file"):
        read_object(tmp_path / "none.json")
