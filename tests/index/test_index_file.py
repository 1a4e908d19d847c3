import contextlib
import json
import os
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawing import hall, office, school
from hypothesis import given
from hypothesis import strategies as st
from index_maps import index_of, write_buildings

from mapmeld.errors import MapmeldError
from mapmeld.index import (
    MapIndexError,
    candidates_for,
    index_file,
    is_index,
    read_index,
    signature_of,
    write_index,
)
from mapmeld.index.index_file import MAGIC, MAX_BYTES
from mapmeld.index.signature import word_count
from mapmeld.io import save


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    root = tmp_path_factory.mktemp("maps")
    write_buildings(root)
    write_index(index_of(root), root / "i")
    return (root / "i").read_bytes()


def parts(data: bytes) -> tuple[dict[str, Any], bytes]:
    head, rest = data[len(MAGIC) :].split(b"\n", 1)
    return json.loads(head), rest


def joined(head: Any, rest: bytes) -> bytes:
    return MAGIC + json.dumps(head).encode() + b"\n" + rest


def refused(path: Path, data: bytes) -> str:
    path.write_bytes(data)
    with pytest.raises(MapIndexError) as caught:
        read_index(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message


def test_what_is_written_is_read(tmp_path: Path) -> None:
    write_buildings(tmp_path / "maps")
    index = index_of(tmp_path / "maps")
    write_index(index, tmp_path / "i")
    found = read_index(tmp_path / "i")
    assert found.root == (tmp_path / "maps").resolve()
    assert [m.name for m in found.maps] == ["floor/west.yaml", "office.yaml", "school.yaml"]
    for a, b in zip(index.maps, found.maps, strict=True):
        assert (a.image, a.stamps) == (b.image, b.stamps)
    for what in ("weights", "owners", "lengths"):
        assert np.array_equal(getattr(index.ranking, what), getattr(found.ranking, what))
    assert is_index(tmp_path / "i")
    assert not is_index(tmp_path / "maps" / "office.yaml")
    assert not is_index(tmp_path / "none")


def test_folder_and_index_can_be_moved_together(tmp_path: Path) -> None:
    write_buildings(tmp_path / "x" / "maps")
    write_index(index_of(tmp_path / "x" / "maps"), tmp_path / "x" / "i")
    (tmp_path / "x").rename(tmp_path / "y")
    found = read_index(tmp_path / "y" / "i")
    assert all(m.path(found.root).is_file() for m in found.maps)


@given(data=st.data())
def test_a_truncated_or_changed_file_is_one_line(
    data: st.DataObject, written: bytes, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.getbasetemp() / "broken"
    if data.draw(st.booleans()):
        broken = written[: data.draw(st.integers(1, len(written) - 1))]
    else:
        at = data.draw(st.integers(0, len(written) - 1))
        broken = written[:at] + bytes([written[at] ^ data.draw(st.integers(1, 255))]) + written[at + 1 :]
    path.write_bytes(broken)
    # A changed letter of a name or digit of a time is no damage that can be seen; all other is said.
    with contextlib.suppress(MapmeldError):
        read_index(path)


def test_truncated_anywhere_in_the_words(tmp_path: Path, written: bytes) -> None:
    assert "bytes of signatures instead of" in refused(tmp_path / "i", written[:-1])
    assert "bytes of signatures instead of" in refused(tmp_path / "i", written + b"\0")
    assert "is damaged" in refused(tmp_path / "i", written[: len(MAGIC) + 30])


def test_only_the_rows_of_a_query_are_read_and_they_rank_the_same(tmp_path: Path, written: bytes) -> None:
    (tmp_path / "i").write_bytes(written)
    whole = read_index(tmp_path / "i").ranking
    for asked in (whole.signature(0), signature_of(hall())):
        part = read_index(tmp_path / "i", asked).ranking
        assert len(part.weights) == np.count_nonzero(asked.weights) < len(whole.weights)
        assert np.array_equal(part.scores(asked), whole.scores(asked))


def test_an_index_read_for_one_map_does_not_answer_for_another(tmp_path: Path, written: bytes) -> None:
    (tmp_path / "i").write_bytes(written)
    part = read_index(tmp_path / "i", signature_of(hall())).ranking
    with pytest.raises(ValueError, match="for another signature"):
        part.scores(signature_of(school()))
    with pytest.raises(ValueError, match="for another signature"):
        part.signature(0)


def test_a_damaged_row_is_said_when_it_is_read(tmp_path: Path, written: bytes) -> None:
    (tmp_path / "i").write_bytes(written)
    asked = read_index(tmp_path / "i").ranking.signature(0)
    for word in (np.flatnonzero(asked.weights)[0], np.flatnonzero(asked.weights == 0)[0]):
        at = len(written) - (word_count() - int(word)) * 3  # 3 maps
        broken = written[:at] + bytes([written[at] ^ 1]) + written[at + 1 :]
        assert "a checksum in it is wrong" in refused(tmp_path / "i", broken)
        if asked.weights[word]:
            with pytest.raises(MapIndexError, match="a checksum in it is wrong"):
                read_index(tmp_path / "i", asked)
        else:
            assert read_index(tmp_path / "i", asked).ranking.scores(asked)[0] == pytest.approx(1)


def test_an_index_without_maps_and_one_of_one_map(tmp_path: Path) -> None:
    (tmp_path / "none").mkdir()
    write_index(index_of(tmp_path / "none"), tmp_path / "i")
    none = read_index(tmp_path / "i", signature_of(office()))
    assert none.maps == ()
    assert candidates_for(office(), none) == ()
    save(office(), tmp_path / "none" / "a.yaml")
    write_index(index_of(tmp_path / "none"), tmp_path / "i")
    (only,) = candidates_for(office(), read_index(tmp_path / "i", signature_of(office())))
    assert only.path.name == "a.yaml"
    assert only.score == pytest.approx(1, abs=1e-6)


def test_names_in_any_script(tmp_path: Path) -> None:
    folder = tmp_path / "Büro 二階"
    folder.mkdir()
    save(office(), folder / "маппа \N{SNOWMAN}.yaml")
    write_index(index_of(tmp_path), folder / "индекс")
    (found,) = read_index(folder / "индекс").maps
    assert found.name == "Büro 二階/маппа \N{SNOWMAN}.yaml"
    assert found.is_unchanged(tmp_path)


def test_a_head_without_end_is_not_read_to_its_end(
    tmp_path: Path, written: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(index_file, "MAX_HEAD_BYTES", 100)
    assert "is damaged" in refused(tmp_path / "i", written)


def test_a_file_larger_than_any_index_is_not_read(tmp_path: Path) -> None:
    with (tmp_path / "i").open("wb") as file:
        file.write(MAGIC)
        file.truncate(MAX_BYTES + 1)  # takes no space
    with pytest.raises(MapIndexError, match="too large"):
        read_index(tmp_path / "i")


def test_another_version(tmp_path: Path, written: bytes) -> None:
    assert "another version" in refused(tmp_path / "i", written.replace(b"index 3\n", b"index 2\n", 1))
    head, rest = parts(written)
    assert "another version" in refused(tmp_path / "i", joined({**head, "signatures": "old"}, rest))


def test_no_index_at_all(tmp_path: Path) -> None:
    assert "is not an index" in refused(tmp_path / "i", b"PK\x03\x04" + bytes(100))
    assert "is not an index" in refused(tmp_path / "i", b"m")


@pytest.mark.parametrize("count", [1 << 70, -1, 1.5, True, "7", None])
def test_sizes_are_not_believed(tmp_path: Path, written: bytes, count: object) -> None:
    head, rest = parts(written)
    head["maps"][0][2] = count
    assert "is damaged" in refused(tmp_path / "i", joined(head, rest))


@pytest.mark.parametrize(
    "name",
    [
        "../secret.yaml",
        "/etc/secret.yaml",
        "a/../../b.yaml",
        "",
        "passwd",
        "x\0.yaml",
        7,
        "school.yaml",
        "\ud800.yaml",
    ],
)
def test_names_that_lead_out_of_the_folder_or_to_no_map(tmp_path: Path, written: bytes, name: object) -> None:
    head, rest = parts(written)
    head["maps"][0][0] = name
    assert "is damaged" in refused(tmp_path / "i", joined(head, rest))


@pytest.mark.parametrize("head", [[], {}, {"maps": 3}, None, "x"])
def test_heads_that_are_something_else(tmp_path: Path, head: object) -> None:
    assert "is damaged" in refused(tmp_path / "i", joined(head, b""))


@pytest.mark.parametrize("maps", [3, [3], [[]], [["a.yaml"]], {"a": 1}, None])
def test_maps_that_are_something_else(tmp_path: Path, written: bytes, maps: object) -> None:
    head, _ = parts(written)
    nothing = zlib.crc32(b"")
    assert "is damaged" in refused(tmp_path / "i", joined({**head, "maps": maps, "checksum": nothing}, b""))


def test_deep_nesting(tmp_path: Path) -> None:
    assert "is damaged" in refused(tmp_path / "i", MAGIC + b"[" * 200_000 + b"\n")


@pytest.mark.parametrize("length", [np.nan, np.inf, -1.0])
def test_lengths_that_cannot_be(tmp_path: Path, written: bytes, length: float) -> None:
    head, rest = parts(written)
    changed = np.array(length, "<f4").tobytes() + rest[4:]
    head["checksum"] = zlib.crc32(changed)
    assert "is damaged" in refused(tmp_path / "i", joined(head, changed))


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "i")
    with pytest.raises(MapmeldError, match="not a plain file"):
        read_index(tmp_path / "i")
