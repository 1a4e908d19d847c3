"""Every format gives the same states; what is in a message becomes a map or an error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bag_files import (
    FORMATS,
    START,
    Sent,
    mcap_bytes,
    same_states,
    sent_map,
    sent_text,
    sent_update,
    story,
    write_mcap,
)
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from mapmeld.grid import OccupancyGrid
from mapmeld.io.recordings import MapStates, RecordingError, map_states
from mapmeld.se2 import Pose2

SMALL = np.array([[-1, 0, 100], [0, 0, -1]], np.int8)
LARGE = np.array([[-1, 0, 100, 30], [0, 0, -1, 64], [100, 100, 100, 0]], np.int8)


def changed(cells: np.ndarray[Any, Any], row: int, col: int, values: Sequence[Sequence[int]]) -> Any:
    new = cells.copy()
    block = np.array(values)
    new[row : row + block.shape[0], col : col + block.shape[1]] = block
    return new


def expected(sent_at: float, cells: Any, x: float, turn: float) -> OccupancyGrid:
    return OccupancyGrid(cells, 0.05, Pose2(x, 2.5, turn), stamp=START + sent_at, frame_id="r1")


EXPECTED = [
    expected(0.98, SMALL, -1.0, 0.5),
    expected(2.99, changed(SMALL, 0, 1, [[50, 60]]), -1.0, 0.5),
    expected(3.98, LARGE, -1.5, -3.0),
    expected(5.99, changed(LARGE, 1, 0, [[1], [2]]), -1.5, -3.0),
]


def states_of(folder: Path, *sent: Sent, damaged: Any = "refuse") -> MapStates:
    return map_states(write_mcap(folder, sent), damaged=damaged)


def only(folder: Path, *sent: Sent) -> OccupancyGrid:
    (state,) = states_of(folder, *sent)
    return state


# ---------------------------------------------------------------- the formats
@pytest.mark.parametrize("damaged", ["refuse", "use"])
@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_the_same_states(name: str, damaged: Any, tmp_path: Path) -> None:
    path = FORMATS[name](tmp_path, story())
    states = map_states(path, "/robot_1/map", damaged=damaged)
    assert states.topic == "/robot_1/map"
    assert same_states(list(states), EXPECTED)
    assert not states.left_out
    other = list(map_states(str(path), "robot_2/map", damaged=damaged))
    assert [(state.shape, state.resolution, state.frame_id) for state in other] == [
        ((1, 1), 0.1, "r2"),
        ((1, 2), 0.1, "r2"),
    ]


def test_recordings_in_several_files_are_read_in_their_order(tmp_path: Path) -> None:
    path = FORMATS["rosbag2-mcap"](tmp_path, story()[:4])
    later = FORMATS["rosbag2-mcap"](tmp_path / "later", story()[4:])
    # Ten before two: numbers, not letters, are what counts.
    (path / "run.mcap").rename(path / "run_2.mcap")
    (later / "run.mcap").rename(path / "run_10.mcap")
    (path / "metadata.yaml").unlink()
    states = map_states(path, "/robot_1/map", damaged="use")
    assert same_states(list(states), EXPECTED)


def test_messages_of_other_topics_are_neverdecoded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from mapmeld.io.recordings import messages

    seen: list[str] = []
    decode = messages.decoded

    def noting(data: bytes, kind: str, encoding: str) -> Any:
        seen.append(kind)
        return decode(data, kind, encoding)

    monkeypatch.setattr(messages, "decoded", noting)
    list(map_states(write_mcap(tmp_path, story()), "/robot_2/map"))
    assert seen == ["nav_msgs/msg/OccupancyGrid"] * 2


@pytest.mark.parametrize("name", ["rosbag1", "rosbag2-sqlite3", "mcap-zstd", "mcap-no-index"])
def test_states_come_one_by_one_and_the_file_is_closed_early(name: str, tmp_path: Path) -> None:
    path = FORMATS[name](tmp_path, story())
    states = map_states(path, "/robot_1/map")
    assert next(states) == EXPECTED[0]
    states.close()  # unclosed files would be warnings, which are errors here
    with pytest.raises(StopIteration):
        next(states)


# ---------------------------------------------------------------- topics
def test_the_only_topic_with_maps_need_not_be_named(tmp_path: Path) -> None:
    states = states_of(tmp_path, sent_text(0, "x"), sent_map(1, [[0]], "/only"))
    assert states.topic == "/only"
    assert len(list(states)) == 1


def test_several_topics_are_listed(tmp_path: Path) -> None:
    with pytest.raises(
        RecordingError, match=r"has maps on 2 topics; name one of them: /robot_1/map, /robot_2/map$"
    ):
        states_of(tmp_path, *story())


def test_a_wrong_topic_is_told_at_once(tmp_path: Path) -> None:
    path = write_mcap(tmp_path, story())
    with pytest.raises(
        RecordingError, match=r"topic /chatter has no maps; there are: /robot_1/map, /robot_2"
    ):
        map_states(path, "/chatter")


def test_many_topics_are_not_all_listed(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"/t0/map, .*/t3/map and 20 more$"):
        states_of(tmp_path, *(sent_map(n, [[0]], f"/t{n % 10}/map{'x' * (n // 10)}") for n in range(30)))


@pytest.mark.parametrize("sent", [[], [sent_text(0, "no map here")]])
def test_a_recording_without_maps(tmp_path: Path, sent: list[Sent]) -> None:
    with pytest.raises(RecordingError, match=r"run\.mcap: has no topic with maps$"):
        states_of(tmp_path, *sent)
    with pytest.raises(RecordingError, match=r"topic /map has no maps; nor has any other$"):
        map_states(tmp_path / "run.mcap", "/map")


def test_maps_in_other_encodings_are_named(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(mcap_bytes([sent_map(0, [[0]])], encoding="json"))
    with pytest.raises(
        RecordingError,
        match=r"has no topic with maps; not readable, for only cdr and ros1 are: "
        r"/map \(nav_msgs/msg/OccupancyGrid as json\)$",
    ):
        map_states(tmp_path / "a.mcap")


def test_the_grid_of_foxglove_is_named_as_not_readable(tmp_path: Path) -> None:
    import mcap.writer

    with (tmp_path / "a.mcap").open("wb") as out:
        writer = mcap.writer.Writer(out)
        writer.start(profile="", library="")
        schema = writer.register_schema("foxglove.Grid", "protobuf", b"")
        channel = writer.register_channel("/map", "protobuf", schema)
        writer.add_message(channel, 0, b"", 0)
        writer.finish()  # type: ignore[no-untyped-call]
    with pytest.raises(RecordingError, match=r"/map \(foxglove.Grid as protobuf\)$"):
        map_states(tmp_path / "a.mcap")


# ---------------------------------------------------------------- what is in a map
@given(
    cells=npst.arrays(np.int8, npst.array_shapes(min_dims=2, max_dims=2, max_side=6)),
    resolution=st.sampled_from([0.05, 0.1, 0.025, 0.3, 1.0, 0.123, 1e-3]),
    x=st.floats(-1000, 1000),
    y=st.floats(-1000, 1000),
    turn=st.floats(-math.pi, math.pi),
    ros=st.sampled_from([1, 2]),
)
def test_maps_come_back_as_they_were_sent(
    tmp_path_factory: pytest.TempPathFactory,
    cells: Any, resolution: float, x: float, y: float, turn: float, ros: int,
) -> None:  # fmt: skip
    path = tmp_path_factory.mktemp("bag") / "a.mcap"
    path.write_bytes(mcap_bytes([sent_map(1, cells, resolution=resolution, x=x, y=y, turn=turn)], ros=ros))
    (grid,) = map_states(path)
    known = (cells >= 0) & (cells <= 100)
    np.testing.assert_array_equal(grid.cells, np.where(known, cells, -1))
    assert grid.resolution == resolution
    assert (grid.origin.x, grid.origin.y) == (x, y)
    assert math.remainder(grid.origin.theta - turn, math.tau) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize(
    ("quaternion", "yaw"),
    [
        ((0.0, 0.0, 0.0, 1.0), 0.0),
        ((0.0, 0.0, 0.0, 0.0), 0.0),  # unset
        ((0.0, 0.0, 0.0, -2.0), 0.0),
        ((0.0, 0.0, 3.0, 3.0), math.pi / 2),
        ((0.0, 0.0, 1e-200, 1e-200), math.pi / 2),
        ((math.sin(0.2), 0.0, 0.0, math.cos(0.2)), 0.0),  # tilted about its own x axis
        ((0.0, math.sin(0.2), 0.0, math.cos(0.2)), 0.0),  # and about its y axis
    ],
)
def test_orientations(tmp_path: Path, quaternion: tuple[float, float, float, float], yaw: float) -> None:
    assert only(tmp_path, sent_map(0, [[0]], turn=quaternion)).origin.theta == pytest.approx(yaw, abs=1e-12)


def test_a_tilted_map_keeps_the_heading_of_its_x_axis(tmp_path: Path) -> None:
    # Turned by 0.7 about z, then tilted by 0.3 about the y axis that it has then.
    c, s, d, e = math.cos(0.35), math.sin(0.35), math.cos(0.15), math.sin(0.15)
    quaternion = (-s * e, c * e, s * d, c * d)
    assert only(tmp_path, sent_map(0, [[0]], turn=quaternion)).origin.theta == pytest.approx(0.7)


def test_without_a_stamp_the_time_of_receipt_counts(tmp_path: Path) -> None:
    first, second = states_of(
        tmp_path, sent_map(1.5, [[0]], stamp=-math.inf), sent_map(2.5, [[0]], stamp=-math.inf)
    )
    assert (first.stamp, second.stamp) == (START + 1.5, START + 2.5)


def test_maps_without_cells_are_not_yet_maps(tmp_path: Path) -> None:
    empty = np.zeros((0, 0), np.int8)
    assert only(tmp_path, sent_map(0, empty, resolution=math.nan), sent_map(1, [[0]])).stamp == START + 0.98
    assert list(states_of(tmp_path, sent_map(0, empty), sent_map(1, np.zeros((0, 4), np.int8)))) == []


@pytest.mark.parametrize(
    ("bad", "problem"),
    [
        (sent_map(1, [[0, 0]], size=(3, 3)), "a map of 3 x 3 cells with 2 values"),
        (sent_map(1, [[0, 0]], size=(0, 7)), "a map of 7 x 0 cells with 2 values"),
        (
            sent_map(1, [[0, 0]], size=(50_000, 20_000)),
            "a map of 20000 x 50000 cells, more than the 400,000,000",
        ),
        (
            sent_map(1, [[0, 0]], size=(2**32 - 1, 2**32 - 1)),
            "a map of 4294967295 x 4294967295 cells, more than",
        ),
        (sent_map(1, [[0]], resolution=0.0), "a map with cells of 0.0 m"),
        (sent_map(1, [[0]], resolution=-0.05), "a map with cells of -0.05 m"),
        (sent_map(1, [[0]], resolution=math.nan), "a map with cells of nan m"),
        (sent_map(1, [[0]], resolution=math.inf), "a map with cells of inf m"),
        (sent_map(1, [[0]], x=math.nan), r"a map with its origin at \(nan, 0.0\)"),
        (sent_map(1, [[0]], y=math.inf), r"a map with its origin at \(0.0, inf\)"),
        (sent_map(1, [[0]], x=1e300), "a map whose origin .* is too far from zero"),
        (sent_map(1, [[0]], turn=(0.0, 0.0, math.nan, 1.0)), "a map with the orientation"),
        (sent_map(1, [[0]], turn=(0.0, 0.0, math.inf, 1.0)), "a map with the orientation"),
        (sent_map(1, [[0]], turn=(1.0, 0.0, 0.0, 0.0)), "a map that stands upright or lies on its face"),
        (sent_map(1, [[0]], turn=(0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5))), "a map that stands upright"),
    ],
)
def test_messages_that_are_no_maps(tmp_path: Path, bad: Sent, problem: str) -> None:
    good = sent_map(0, [[0]]), sent_map(3, [[100]])
    states = states_of(tmp_path, good[0], bad, good[1])
    assert next(states).cells.tolist() == [[0]]
    with pytest.raises(
        RecordingError, match=rf"run\.mcap: /map has {problem}.*, 1\.000 s after the start; .*--damaged use"
    ):
        next(states)
    tolerant = states_of(tmp_path, good[0], bad, good[1], damaged="use")
    assert [state.cells.tolist() for state in tolerant] == [[[0]], [[100]]]
    assert sum(tolerant.left_out.values()) == 1


# ---------------------------------------------------------------- updates
def test_updates_before_any_map_are_passed_over(tmp_path: Path) -> None:
    states = states_of(tmp_path, sent_update(0, 0, 0, [[5]]), sent_update(1, 0, 0, [[6]]), sent_map(2, [[0]]))
    assert [state.cells.tolist() for state in states] == [[[0]]]
    assert states.left_out == {"an update that came before any map": 2}


@pytest.mark.parametrize(("row", "col"), [(-1, 0), (0, -1), (2, 0), (0, 3), (1, 2), (2**31 - 1, -(2**31))])
def test_updates_that_reach_outside_are_passed_over(tmp_path: Path, row: int, col: int) -> None:
    states = states_of(tmp_path, sent_map(0, SMALL), sent_update(1, row, col, [[7, 7]]))
    assert [state.cells.tolist() for state in states] == [SMALL.tolist()]
    assert states.left_out == {"an update that reaches outside of the map": 1}


def test_an_update_after_an_empty_map_has_nothing_to_change(tmp_path: Path) -> None:
    empty = sent_map(1, np.zeros((0, 0), np.int8))
    states = states_of(tmp_path, sent_map(0, SMALL), empty, sent_update(2, 0, 0, [[7]]))
    assert len(list(states)) == 1
    assert states.left_out == {"an update that came before any map": 1}


def test_updates_of_an_earlier_map_are_passed_over(tmp_path: Path) -> None:
    """By the headers' stamps; what has none is taken, in the order in which it came."""
    late = sent_update(2, 0, 0, [[7]])
    late.fields["stamp"] = 0.5
    unset = sent_update(3, 0, 0, [[8]])
    unset.fields["stamp"] = -math.inf
    states = states_of(tmp_path, sent_map(1, SMALL), late, unset)
    found = [int(state.cells[0, 0]) for state in states]
    assert found[1:] == [8]
    assert states.left_out == {"an update that is older than the map": 1}


def test_updates_leave_earlier_states_as_they_were(tmp_path: Path) -> None:
    first, second = states_of(tmp_path, sent_map(0, SMALL), sent_update(1, 1, 1, [[7, -128]]))
    np.testing.assert_array_equal(first.cells, SMALL)
    np.testing.assert_array_equal(second.cells, changed(SMALL, 1, 1, [[7, -1]]))
    assert (second.stamp, second.frame_id) == (START + 0.99, "map")


def test_updates_belong_to_the_map_of_their_name(tmp_path: Path) -> None:
    path = write_mcap(
        tmp_path,
        [
            sent_map(0, [[0]], "/a"),
            sent_map(0.5, [[0]], "/b"),
            sent_update(1, 0, 0, [[9]], "/b_updates"),
            sent_update(2, 0, 0, [[8]], "/updates"),
        ],
    )
    assert [state.cells.tolist() for state in map_states(path, "/a")] == [[[0]]]
    assert [state.cells.tolist() for state in map_states(path, "/b")] == [[[0]], [[9]]]


def test_updates_of_a_map_that_is_lost_are_lost_too(tmp_path: Path) -> None:
    sent = [
        sent_map(0, SMALL),
        sent_map(1, [[0, 0]], size=(9, 9)),
        sent_update(2, 0, 0, [[7]]),
        sent_map(3, SMALL),
        sent_update(4, 0, 0, [[7]]),
    ]
    states = states_of(tmp_path, *sent, damaged="use")
    assert [state.stamp for state in states] == pytest.approx([START - 0.02, START + 2.98, START + 3.99])
    assert sum(states.left_out.values()) == 2


def test_a_bad_update_is_refused_or_left_out(tmp_path: Path) -> None:
    bad = sent_update(1, 0, 0, [[7, 7]])
    bad.fields["size"] = (5, 5)
    with pytest.raises(
        RecordingError, match=r"/map_updates has a map of 5 x 5 cells with 2 values, 1\.000 s"
    ):
        list(states_of(tmp_path, sent_map(0, SMALL), bad))
    states = states_of(tmp_path, sent_map(0, SMALL), bad, sent_update(2, 0, 0, [[9]]), damaged="use")
    assert [int(state.cells[0, 0]) for state in states] == [-1, 9]


def test_damaged_has_two_choices(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="damaged must be one of refuse, use"):
        map_states(write_mcap(tmp_path, story()), damaged="perhaps")  # type: ignore[arg-type]
