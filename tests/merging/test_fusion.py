import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mapmeld.merging import FUSIONS, UnknownFusionError, fuse

stacks = arrays(np.int8, st.tuples(st.integers(1, 5), st.just(3), st.just(4)), elements=st.integers(-1, 100))

# One column per case: what three maps say of a cell.
UNKNOWN_ALL, ONE_ALONE, FREE_WALL, WALL_FREE, TWO_FREE = (
    (-1, -1, -1),
    (-1, 100, -1),
    (0, 100, -1),
    (100, 0, -1),
    (0, 0, 100),
)
CASES = np.array([UNKNOWN_ALL, ONE_ALONE, FREE_WALL, WALL_FREE, TWO_FREE], np.int8).T[:, None, :]


@pytest.mark.parametrize(
    ("fusion", "expected"),
    [
        ("colour", [-1, 100, 100, 100, 100]),  # grey, then white, then black on top
        ("newest", [-1, 100, 100, 0, 100]),
        ("vote", [-1, 100, 100, 100, 0]),  # a tie is a wall
        ("average", [-1, 100, 50, 50, 33]),
    ],
)
def test_rules_on_cases_counted_by_hand(fusion: str, expected: list[int]) -> None:
    assert fuse(list(CASES), fusion).tolist() == [expected]


def test_the_colour_rule_lays_white_over_what_is_neither_black_nor_white() -> None:
    assert fuse(
        [np.array([[40, 40, -1]], np.int8), np.array([[10, 70, 50]], np.int8)], "colour"
    ).tolist() == [[10, 70, 50]]


def test_blocks_do_not_change_the_result(monkeypatch: pytest.MonkeyPatch) -> None:
    layers = list(np.random.default_rng(1).integers(-1, 101, (3, 20, 7)).astype(np.int8))
    whole = {name: fuse(layers, name) for name in FUSIONS}
    monkeypatch.setattr("mapmeld.merging.fusion._BLOCK_CELLS", 15)
    for name in FUSIONS:
        np.testing.assert_array_equal(fuse(layers, name), whole[name])


def test_log_odds_add_up() -> None:
    agree = fuse([np.array([[70]], np.int8)] * 2, "log-odds")
    odds = (0.7 / 0.3) ** 2
    assert agree.tolist() == [[round(100 * odds / (1 + odds))]]
    opposite = fuse([np.array([[70]], np.int8), np.array([[30]], np.int8)], "log-odds")
    assert opposite.tolist() == [[50]]
    # The sure wall (0.97) outweighs the sure floor (0.12), and two floors outweigh it.
    wall, floor = np.array([[100]], np.int8), np.array([[0]], np.int8)
    assert fuse([wall, floor], "log-odds")[0, 0] > 65
    assert fuse([wall, floor, floor], "log-odds")[0, 0] < 50


@pytest.mark.parametrize("fusion", FUSIONS)
@given(stack=stacks)
def test_every_rule_knows_what_any_map_knows_and_nothing_else(fusion: str, stack: np.ndarray) -> None:
    fused = fuse(list(stack), fusion)
    assert fused.dtype == np.int8
    np.testing.assert_array_equal(fused >= 0, (stack >= 0).any(axis=0))
    assert fused.max() <= 100


@pytest.mark.parametrize("fusion", FUSIONS)
@given(stack=stacks)
def test_a_map_merged_with_unknown_is_itself(fusion: str, stack: np.ndarray) -> None:
    cells = stack[0]
    if fusion == "vote":  # says wall or floor where there is no doubt, and else the cell itself
        cells = np.where(cells >= 65, 100, np.where((cells >= 0) & (cells <= 25), 0, cells)).astype(np.int8)
    nothing = np.full_like(cells, -1)
    np.testing.assert_array_equal(fuse([nothing, stack[0], nothing], fusion), cells)


@pytest.mark.parametrize("fusion", sorted(set(FUSIONS) - {"newest"}))
@given(stack=stacks)
def test_order_matters_to_newest_only(fusion: str, stack: np.ndarray) -> None:
    np.testing.assert_array_equal(fuse(list(stack), fusion), fuse(list(stack[::-1]), fusion))


def test_an_unknown_rule_is_named_beside_those_that_exist() -> None:
    with pytest.raises(UnknownFusionError, match=r"'blend'.*colour.*vote"):
        fuse([CASES[0]], "blend")
