import pytest

from mapmeld.se2 import Pose2
from mapmeld.simulation import Command, KeyboardDriver, Sight

SIGHT = Sight(0.0, Pose2())


def after(keys: str) -> Command | None:
    pressed = iter([keys])
    return KeyboardDriver(lambda: next(pressed, "")).command(SIGHT)


@pytest.mark.parametrize(
    ("key", "v", "w"),
    [
        ("i", 1, 0),
        ("o", 1, -1),
        ("j", 0, 1),
        ("l", 0, -1),
        ("u", 1, 1),
        (",", -1, 0),
        (".", -1, 1),
        ("m", -1, -1),
        ("k", 0, 0),
        ("5", 0, 0),
        ("I", 1, 0),
        ("<", -1, 0),
        ("J", 0, 0),
    ],
)
def test_the_keys_of_teleop_twist_keyboard(key: str, v: int, w: int) -> None:
    assert after(key) == Command(v * 0.8, w * 1.61)


def test_a_command_holds_until_the_next_key() -> None:
    keys = iter(["i", "", "", "x", "", "k", ""])
    driver = KeyboardDriver(lambda: next(keys))
    said = [driver.command(SIGHT) for _ in range(7)]
    assert [c and c.v for c in said] == pytest.approx([0.8, 0.8, 0.8, 0.72, 0.72, 0.0, 0.0])


@pytest.mark.parametrize(
    ("keys", "v", "w"),
    [
        ("zu", 0.9, 0.9),
        ("xu", 0.9, 1.0),
        ("cu", 1.0, 0.9),
        ("zqu", 0.99, 0.99),
        ("xwu", 0.99, 1.0),
        ("ceu", 1.0, 0.99),
        ("qqqu", 1.0, 1.0),  # never more than the robot can
    ],
)
def test_speeds_change_by_tenths(keys: str, v: float, w: float) -> None:
    assert after(keys) == pytest.approx((v * 0.8, w * 1.61))


def test_ctrl_c_ends_the_drive() -> None:
    assert after("i\x03") is None
