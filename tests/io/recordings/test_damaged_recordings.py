"""Cut off, overwritten, garbled: one clear line or a right answer, and never more than asked for."""

from __future__ import annotations

import os
import random
import shutil
import sqlite3
import tempfile
from collections.abc import Iterator
from contextlib import closing
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zstandard
from bag_files import FORMATS, Sent, mcap_bytes, sent_map, sent_text, story, write_mcap, write_rosbag1

from mapmeld.errors import MapmeldError
from mapmeld.grid import OccupancyGrid
from mapmeld.io.recordings import RecordingError, folder_scan, map_states, recording_info
from mapmeld.io.recordings.source import reason_of
from mapmeld.io.recordings.unpacking import MAX_PIECE_BYTES, unpacked

TOPIC = "/robot_1/map"


def files_of(path: Path) -> list[Path]:
    return sorted(file for file in ([path] if path.is_file() else path.iterdir()) if file.is_file())


def outcome(path: Path, damaged: Any) -> list[OccupancyGrid] | str:
    """The states, or the one line that says what is wrong; anything else fails the test."""
    try:
        recording_info(path, damaged=damaged)
        return list(map_states(path, TOPIC, damaged=damaged))
    except MapmeldError as error:
        line = str(error)
    assert "\n" not in line
    assert str(path) in line
    assert len(line) < 600
    return line


def is_part_of(found: list[OccupancyGrid], whole: list[OccupancyGrid]) -> bool:
    rest = iter(whole)
    return all(any(a == b and a.stamp == b.stamp for b in rest) for a in found)


def garbled(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data))
    kind = rng.choice(("bit", "zeros", "ones", "insert", "repeat", "remove"))
    if kind == "bit":
        return data[:at] + bytes([data[at] ^ (1 << rng.randrange(8))]) + data[at + 1 :]
    if kind in ("zeros", "ones"):
        count = min(8, len(data) - at)
        return data[:at] + (b"\0" if kind == "zeros" else b"\xff") * count + data[at + count :]
    if kind == "insert":
        return data[:at] + rng.randbytes(5) + data[at:]
    if kind == "repeat":
        return data[:at] + data[max(0, at - 40) :]
    return data[:at] + data[at + rng.randrange(1, 40) :]


# ---------------------------------------------------------------- anything, anywhere
@pytest.mark.parametrize("name", FORMATS)
def test_recordings_that_are_cut_off(name: str, tmp_path: Path) -> None:
    path = FORMATS[name](tmp_path, story())
    whole = list(map_states(path, TOPIC))
    for file in files_of(path):
        data = file.read_bytes()
        for end in range(0, len(data), max(1, len(data) // 25)):
            file.write_bytes(data[:end])
            refused, used = outcome(path, "refuse"), outcome(path, "use")
            # A metadata.yaml cut within its last lines may tell all that there is to tell.
            assert isinstance(refused, str) or is_part_of(refused, whole), end
            assert isinstance(used, str) or is_part_of(used, whole), end
        file.write_bytes(data)


@pytest.mark.parametrize("name", FORMATS)
def test_recordings_that_are_garbled(name: str, tmp_path: Path) -> None:
    path = FORMATS[name](tmp_path, story())
    rng = random.Random(name)
    for file in files_of(path):
        data = file.read_bytes()
        for _ in range(40):
            file.write_bytes(garbled(data, rng))
            outcome(path, "refuse")
            outcome(path, "use")
        file.write_bytes(data)


def test_with_checksums_nothing_garbled_is_ever_taken_for_a_map(tmp_path: Path) -> None:
    path = write_mcap(tmp_path, story(), chunk_size=200)
    data, whole = path.read_bytes(), list(map_states(path, TOPIC))
    rng = random.Random(1)
    for _ in range(150):
        path.write_bytes(garbled(data, rng))
        refused = outcome(path, "refuse")
        assert isinstance(refused, str) or is_part_of(refused, whole)


# ---------------------------------------------------------------- as it happens
def growing(count: int = 12, side: int = 40) -> list[Sent]:
    rng = np.random.default_rng(0)
    maps = [sent_map(n, rng.integers(0, 101, (side, side)), TOPIC) for n in range(count)]
    return [message for n, sent in enumerate(maps) for message in (sent, sent_text(n + 0.5, "x" * 200))]


def cut(path: Path, share: float) -> None:
    for file in files_of(path):
        if file.suffix != ".yaml":
            file.write_bytes(file.read_bytes()[: int(file.stat().st_size * share)])


@pytest.mark.parametrize(
    "name", ["rosbag1", "rosbag2-sqlite3", "rosbag2-mcap", "db3", "mcap-small-chunks", "mcap-no-chunks"]
)
def test_of_a_recording_cut_in_the_middle_the_first_half_can_be_used(name: str, tmp_path: Path) -> None:
    path = FORMATS[name](tmp_path, growing(1200 if name == "rosbag2-mcap" else 24))
    whole = list(map_states(path, TOPIC))
    cut(path, 0.6)
    with pytest.raises(
        RecordingError, match=r"is damaged, or of a kind that is not read \(.*\); 'mapmeld bag export'"
    ):
        list(map_states(path, TOPIC))
    states = map_states(path, TOPIC, damaged="use")
    found = list(states)
    assert is_part_of(found, whole)
    assert 0.3 * len(whole) <= len(found) < len(whole)
    assert sum(states.left_out.values()) >= 1
    info = recording_info(path, damaged="use")
    assert [topic.maps for topic in info.topics] == [len(found)]
    assert info.left_out


def test_any_byte_of_a_summary_that_is_wrong_is_noticed(tmp_path: Path) -> None:
    data = mcap_bytes(story())
    path = tmp_path / "run.mcap"
    begin = int.from_bytes(data[-28:-20], "little")  # of the footer: where the summary begins
    assert 0 < begin < len(data) - 200
    for at in range(begin, len(data) - 29, 5):
        path.write_bytes(data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :])
        with pytest.raises(RecordingError):
            map_states(path, TOPIC)


def test_packed_as_a_whole_and_cut_off(tmp_path: Path) -> None:
    path = FORMATS["rosbag2-mcap-file"](tmp_path, growing(1000))
    whole = list(map_states(path, TOPIC))
    cut(path, 0.6)
    with pytest.raises(RecordingError):
        map_states(path, TOPIC)
    found = list(map_states(path, TOPIC, damaged="use"))
    assert is_part_of(found, whole)
    assert 0.3 * len(whole) <= len(found) < len(whole)


def test_packed_files_that_unpack_to_too_much(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = FORMATS["rosbag2-mcap-file"](tmp_path, growing(1000))
    (packed,) = path.glob("*.zstd")
    whole = list(map_states(path, TOPIC, damaged="use"))
    size = len(zstandard.ZstdDecompressor().stream_reader(packed.read_bytes()).read())
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    monkeypatch.setattr(folder_scan, "MAX_FILE_BYTES", size)
    assert list(map_states(path, TOPIC, damaged="use")) == whole
    monkeypatch.setattr(folder_scan, "MAX_FILE_BYTES", size - 1)
    with pytest.raises(RecordingError, match=f"unpacks to more than {size - 1:,} bytes") as refused:
        map_states(path, TOPIC, damaged="use")
    assert str(packed) in str(refused.value)
    # Of others in the folder, the maps are used.
    (path / "other.mcap").write_bytes(mcap_bytes(growing()))
    states = map_states(path, TOPIC, damaged="use")
    assert list(states) == list(map_states(path / "other.mcap", TOPIC))
    assert any("unpacks to more than" in reason for reason in states.left_out)
    assert list(temporary.iterdir()) == []


def test_a_disk_that_is_nearly_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = FORMATS["rosbag2-mcap-file"](tmp_path, growing(1000))
    full = shutil.disk_usage(tmp_path)._replace(free=2000)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: full)
    with pytest.raises(RecordingError, match="unpacks to more than 1,000 bytes"):
        map_states(path, TOPIC, damaged="use")


def test_mcap_that_was_not_finished(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(mcap_bytes(growing(), chunk_size=6000, finished=False))
    with pytest.raises(RecordingError):
        list(map_states(path))
    assert len(list(map_states(path, damaged="use"))) == 10  # the last chunk was never written


def test_rosbag1_that_was_not_closed(tmp_path: Path) -> None:
    path = write_rosbag1(tmp_path, growing())
    data = bytearray(path.read_bytes())
    at = data.index(b"index_pos=") + len(b"index_pos=")
    data[at : at + 8] = bytes(8)  # what a recorder writes first and mends when it closes the file
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=r"Bag is not indexed"):
        map_states(path)
    assert len(list(map_states(path, damaged="use"))) == 12


@pytest.mark.parametrize("name", ["rosbag1-bz2", "mcap-small-chunks"])
def test_one_bad_chunk_costs_no_other(name: str, tmp_path: Path) -> None:
    path = FORMATS[name](tmp_path, growing(260, 100))
    whole = list(map_states(path, TOPIC))
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 30] = b"\x55" * 30
    path.write_bytes(data)
    with pytest.raises(RecordingError):
        list(map_states(path, TOPIC))
    states = map_states(path, TOPIC, damaged="use")
    found = list(states)
    assert is_part_of(found, whole)
    assert len(whole) / 3 <= len(found) < len(whole)
    assert found[-1] == whole[-1]
    assert [reason.partition(":")[0] for reason in states.left_out] == ["a chunk that is damaged"]


def test_bad_pages_of_a_database_cost_no_others(tmp_path: Path) -> None:
    path = FORMATS["db3"](tmp_path, growing(200))
    whole = list(map_states(path, TOPIC))
    data = bytearray(path.read_bytes())
    middle = len(data) // 2 // 4096 * 4096
    data[middle : middle + 3 * 4096] = b"\x55" * 3 * 4096
    path.write_bytes(data)
    states = map_states(path, TOPIC, damaged="use")
    found = list(states)
    assert is_part_of(found, whole)
    assert len(whole) / 2 <= len(found) < len(whole)
    assert found[-1] == whole[-1]
    assert states.left_out


def test_states_before_the_damage_come_before_the_error(tmp_path: Path) -> None:
    path = write_mcap(tmp_path, growing(), chunk_size=4000)
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 30] = b"\x55" * 30
    path.write_bytes(data)
    states = map_states(path)
    assert next(states).stamp is not None
    with pytest.raises(RecordingError):
        list(states)


# ---------------------------------------------------------------- folders
def test_a_folder_without_metadata(tmp_path: Path) -> None:
    path = FORMATS["rosbag2-sqlite3"](tmp_path, story())
    (path / "metadata.yaml").unlink()
    with pytest.raises(
        RecordingError, match=r"without metadata\.yaml.*; name the file in it \(run\.db3\), or"
    ):
        map_states(path, TOPIC)
    assert len(list(map_states(path, TOPIC, damaged="use"))) == 4
    assert len(list(map_states(path / "run.db3", TOPIC))) == 4


def test_a_file_that_is_missing_or_of_an_unknown_kind(tmp_path: Path) -> None:
    path = FORMATS["rosbag2-sqlite3"](tmp_path, story())
    metadata = path / "metadata.yaml"
    text = metadata.read_text()
    metadata.write_text(text.replace("storage_identifier: sqlite3", "storage_identifier: magnetic_tape"))
    with pytest.raises(RecordingError, match=r"Storage plugin 'magnetic_tape' not supported"):
        map_states(path, TOPIC)
    metadata.write_text(text)
    (path / "run.db3").unlink()
    with pytest.raises(RecordingError, match="Some database files are missing"):
        map_states(path, TOPIC)
    with pytest.raises(RecordingError, match=r"holds neither a \.db3 nor an \.mcap file"):
        map_states(path, TOPIC, damaged="use")
    metadata.write_bytes(b"#" * (1 << 24) + b"#")
    with pytest.raises(RecordingError, match="is too large"):
        map_states(path, TOPIC)


def test_of_several_files_the_readable_ones_are_used(tmp_path: Path) -> None:
    path = FORMATS["rosbag2-sqlite3"](tmp_path, story())
    shutil.copy(path / "run.db3", path / "run_2.db3")
    (path / "run_1.db3").write_bytes(b"SQLite format 3\0 but no more")
    states = map_states(path, TOPIC, damaged="use")
    assert len(list(states)) == 8
    assert any("run_1.db3" in reason for reason in states.left_out)
    (path / "run.db3").unlink()
    (path / "run_2.db3").unlink()
    with pytest.raises(RecordingError, match=r"run_1\.db3: is damaged"):
        map_states(path, TOPIC, damaged="use")


# ---------------------------------------------------------------- made to harm
@pytest.mark.parametrize("damaged", ["refuse", "use"])
def test_a_pipe_in_place_of_a_file_is_not_waited_for(tmp_path: Path, damaged: Any) -> None:
    path = FORMATS["rosbag2-sqlite3"](tmp_path, story())
    (path / "run.db3").unlink()
    os.mkfifo(path / "run.db3")
    for name in (path, path / "run.db3"):
        with pytest.raises(MapmeldError, match=r"run\.db3: is not a plain file"):
            map_states(name, TOPIC, damaged=damaged)


def test_the_ids_in_a_database_may_be_anything(tmp_path: Path) -> None:
    path = FORMATS["db3"](tmp_path, story())
    with closing(sqlite3.connect(path)) as database, database:
        (last,) = database.execute("SELECT max(id) FROM messages").fetchone()
        database.execute("UPDATE messages SET id = ? WHERE id = ?", (2**63 - 1, last))
        database.execute("UPDATE messages SET id = -7 WHERE id = 1")
        database.execute("INSERT INTO messages VALUES (500, 77, 0, x'00')")
        database.execute("INSERT INTO messages VALUES (501, 1, 'noon', x'00')")
    states = map_states(path, TOPIC, damaged="use")
    assert len(list(states)) == 4
    assert states.left_out == {"a row that is no message": 2}


def _chunks(compression: str, data: bytes, declared: int) -> Iterator[bytes]:
    import io

    from mcap.data_stream import RecordBuilder
    from mcap.records import Chunk

    begin = io.BytesIO(mcap_bytes([], finished=False)).getvalue()
    builder = RecordBuilder()
    Chunk(
        compression=compression,
        data=data,
        message_end_time=0,
        message_start_time=0,
        uncompressed_crc=0,
        uncompressed_size=declared,
    ).write(builder)
    yield begin
    yield builder.end()  # type: ignore[no-untyped-call]


@pytest.mark.parametrize("compression", ["", "bz2", "lz4", "zstd"])
def test_a_piece_that_says_it_is_larger_than_any_is_not_unpacked(compression: str) -> None:
    with pytest.raises(ValueError, match="more than the"):
        unpacked(b"", compression, MAX_PIECE_BYTES + 1)


@pytest.mark.parametrize("declared", [1000, 10**8, 10**10, 2**63])
@pytest.mark.parametrize("compression", ["zstd", "lz4", "", "xz"])
def test_chunks_that_are_much_larger_than_they_say(tmp_path: Path, compression: str, declared: int) -> None:
    path = tmp_path / "a.mcap"
    packed = bytes(100)
    if compression in ("zstd", "lz4"):
        library = import_module({"zstd": "zstandard", "lz4": "lz4.frame"}[compression])
        packed = library.compress(bytes(10**7))
    path.write_bytes(b"".join(_chunks(compression, packed, declared)))
    with pytest.raises(RecordingError):
        map_states(path)
    with pytest.raises(RecordingError):
        map_states(path, damaged="use")


# ---------------------------------------------------------------- what is said
def without_the_first_chunk(tmp_path: Path) -> Path:
    """All maps of a topic in one chunk that is damaged, those of another in the next."""
    maps = [sent_map(n, np.full((60, 60), n), TOPIC) for n in range(3)]
    others = [sent_map(10 + n, np.full((60, 60), n), "/robot_2/map") for n in range(30)]
    none = import_module("mcap.writer").CompressionType.NONE
    path = write_mcap(tmp_path, [*maps, *others], chunk_size=10_000, compression=none)
    data = bytearray(path.read_bytes())
    at = data.index(b"\x01" * 400)
    data[at : at + 30] = b"\x55" * 30
    path.write_bytes(data)
    return path


def test_maps_that_were_all_in_a_damaged_chunk_are_said_to_be_lost(tmp_path: Path) -> None:
    path = without_the_first_chunk(tmp_path)
    with pytest.raises(RecordingError, match=r"has no maps; .*damaged and left out: a chunk that is damaged"):
        map_states(path, TOPIC, damaged="use")
    states = map_states(path, "/robot_2/map", damaged="use")
    assert list(states)
    assert states.damage == states.left_out


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (EOFError(), "it is cut off, its end is missing"),
        (ValueError("unpack requires a buffer of 8 bytes"), "it is cut off, its end is missing"),
        (ValueError("unknown (opcode 158) record has length 9"), "a part is garbled"),
        (ValueError("Bag is not indexed."), "Bag is not indexed"),
    ],
)
def test_damage_in_words(error: Exception, said: str) -> None:
    assert reason_of(error) == said
