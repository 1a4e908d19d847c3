from pathlib import Path

import pytest

from mapmeld.io import MapFileError
from mapmeld.se2 import Pose2
from mapmeld.simulation import STOP, Command, CommandLogDriver, Sight, read_route


def written(path: Path, text: str | bytes) -> Path:
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def test_waypoints(tmp_path: Path) -> None:
    route = read_route(written(tmp_path / "r.txt", "# kitchen\n1 2\n\n 3.5, 4e0  # table\n"))
    assert route.waypoints == ((1.0, 2.0), (3.5, 4.0))
    assert route.commands == ()


def test_commands(tmp_path: Path) -> None:
    route = read_route(written(tmp_path / "r.txt", "0 0.8 0\n1.5 0 -1.61\n1.5 0 0\n"))
    assert route.waypoints == ()
    assert route.commands == ((0.0, Command(0.8, 0.0)), (1.5, Command(0.0, -1.61)), (1.5, STOP))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is empty"),
        ("# nothing\n", "no waypoints"),
        ("1 2\n1 2 3\n", "line 2 has 3 numbers, those before it 2"),
        ("1\n", "line 1: 'x y' or 't v w'"),
        ("1 2 3 4\n", "line 1"),
        ("1 two\n", "numbers are needed, not '1 two'"),
        ("1 nan\n", "finite"),
        ("1 inf\n", "finite"),
        ("1 1 1\n0.5 1 1\n", "line 2: times"),
        ("-1 1 1\n", "line 1: times"),
        (b"\xff\xfe1 2\n", "UTF-8"),
        ("1 2\n" * 200_001, "too many lines"),
    ],
)
def test_hostile_routes(tmp_path: Path, text: str | bytes, said: str) -> None:
    with pytest.raises(MapFileError, match=said) as caught:
        read_route(written(tmp_path / "r.txt", text))
    assert "\n" not in str(caught.value)


def test_commands_are_repeated_at_their_times_after_the_first_sight() -> None:
    driver = CommandLogDriver(((0.5, Command(0.8, 0.0)), (1.0, Command(0.0, 1.0)), (1.5, STOP)))
    said = [driver.command(Sight(10.0 + t, Pose2())) for t in (0.0, 0.4, 0.5, 0.9, 1.2, 1.5)]
    ahead, turn = Command(0.8, 0.0), Command(0.0, 1.0)
    assert said == [STOP, STOP, ahead, ahead, turn, None]
