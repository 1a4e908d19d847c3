from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmeld.simulation import Configuration, Environment, Settings, SimulationError, generate, true_map
from mapmeld.simulation.fields import ARMS, DOOR, EMPTY, arms_of, edges_of, rooms_of
from mapmeld.simulation.true_map import covered, outside

BARE = Settings(furniture=0.0)

drawn = st.builds(
    generate,
    st.builds(
        Settings,
        width=st.integers(10, 26),
        height=st.integers(10, 26),
        configuration=st.builds(
            Configuration,
            st.integers(0, 3),
            st.lists(st.tuples(st.integers(3, 7), st.integers(3, 7)), min_size=1, max_size=4).map(tuple),
        ),
        extra_doors=st.sampled_from([0.0, 0.5, 1.0]),
        furniture=st.just(0.0),
    ),
    st.integers(0, 10_000),
)


def parts_of_floor(environment: Environment) -> int:
    """Count the parts that the floor falls into, doors open; by flood fill, knowing nothing of rooms."""
    floor = ~covered(environment, environment.walls(), 0.1) & ~outside(environment, 0.1)
    return int(cv2.connectedComponents(floor.astype(np.uint8), connectivity=4)[0]) - 1


@pytest.mark.parametrize("first", range(0, 300, 20))
def test_every_room_is_reached(first: int) -> None:
    for seed in range(first, first + 20):
        environment = generate(BARE, seed)
        assert parts_of_floor(environment) == 1
        assert rooms_of(environment.fields).max() >= 1 + BARE.configuration.rooms


@given(drawn)
@settings(max_examples=60)
def test_walls_join_neighbours_that_join_them(environment: Environment) -> None:
    fields = environment.fields
    arms = arms_of(fields)
    across, along = edges_of(arms)
    # Every arm is met by one of the neighbour's, and none points off the ground.
    assert np.array_equal(across, (arms[:, :-1] & 8 > 0) & (arms[:, 1:] & 4 > 0))
    assert np.array_equal(along, (arms[:-1] & 1 > 0) & (arms[1:] & 2 > 0))
    assert not (arms[0] & 2).any()
    assert not (arms[-1] & 1).any()
    assert not (arms[:, 0] & 4).any()
    assert not (arms[:, -1] & 8).any()
    walls = fields >= 0
    assert all(arms[where] == ARMS[fields[where]] for where in zip(*np.nonzero(walls), strict=True))
    assert (arms[fields == EMPTY] == 0).all()


@given(drawn)
@settings(max_examples=60)
def test_rooms_hang_together_and_doors_join_two(environment: Environment) -> None:
    assert parts_of_floor(environment) == 1
    arms, rooms = arms_of(environment.fields), np.pad(rooms_of(environment.fields), 1)
    for row, col in zip(*np.nonzero(environment.fields == DOOR), strict=True):
        sides = rooms[row : row + 2, col : col + 2]
        pair = {int(sides[0, 0]), int(sides[1, 0] if arms[row, col] == 12 else sides[0, 1])}
        assert len(pair) == 2
        assert 0 not in pair


def test_a_spanning_tree_has_one_door_less_than_rooms_and_extra_doors_come_on_top() -> None:
    def doors(extra: float) -> int:
        return len(generate(replace(BARE, extra_doors=extra), 3).doors())

    rooms = rooms_of(generate(BARE, 3).fields).max()
    assert doors(0.0) == rooms - 1
    assert doors(1.0) > doors(0.0)


def test_the_same_seed_gives_the_same_and_another_another() -> None:
    settings = Settings(width=12, height=11, configuration=Configuration(2, ((4, 5),)))
    assert generate(settings, 7) == generate(settings, 7)
    assert generate(settings, 7) != generate(settings, 8)


def test_an_empty_ground() -> None:
    environment = generate(Settings(5, 5, Configuration(0, ()), furniture=0.0))
    assert environment.fields[1:-1, 1:-1].tolist() == [[EMPTY] * 3] * 3
    assert not environment.doors()


def test_later_rooms_lie_over_earlier_ones() -> None:
    # On so small a ground seven rooms must overlap; all are there and reached.
    environment = generate(Settings(14, 14, Configuration(7, ((6, 6), (4, 5))), furniture=0.0), 1)
    assert rooms_of(environment.fields).max() >= 8
    assert parts_of_floor(environment) == 1


def test_narrow_rooms_of_two_fields_are_drawn() -> None:
    environment = generate(Settings(14, 14, Configuration(1, ((2, 6),)), furniture=0.0), 2)
    rooms = rooms_of(environment.fields)
    assert min(np.bincount(rooms.ravel())[1:]) == 5
    assert parts_of_floor(environment) == 1


@pytest.mark.parametrize(
    "configuration",
    [Configuration(1, ((2, 2),)), Configuration(400, ((4, 4),)), Configuration(1, ((20, 20),))],
)
def test_what_does_not_fit(configuration: Configuration) -> None:
    with pytest.raises(SimulationError, match="do not fit on 10 x 9 m"):
        generate(Settings(10, 9, configuration, furniture=0.0))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"width": 4}, "5 to 200 m, not 4 x 20"),
        ({"height": 201}, "201"),
        ({"extra_doors": -0.1}, "probability"),
        ({"furniture": float("nan")}, "density"),
    ],
)
def test_settings_out_of_range(change: dict[str, float], said: str) -> None:
    with pytest.raises(SimulationError, match=said):
        Settings(**change)  # type: ignore[arg-type]


def test_a_negative_seed() -> None:
    with pytest.raises(SimulationError, match="not -1"):
        generate(BARE, -1)


def test_floor_and_walls_make_up_the_true_map() -> None:
    grid = true_map(generate(BARE, 5), 0.1)
    assert grid.shape == (200, 200)
    assert grid.known_area == pytest.approx(19.2 * 19.2, abs=0.5)  # cells of 0.1 m reach beyond the wall
