import importlib.util
from pathlib import Path

import pytest
from running import run, run_for_real

needs_ros = pytest.mark.skipif(
    importlib.util.find_spec("rclpy") is None, reason='needs ROS 2 middleware: pip install "mapmeld[ros]"'
)


@pytest.mark.parametrize("arguments", [["--robts", "a"], ["stray"], ["--robts", "a", "--ros-args"]])
def test_what_is_neither_an_option_nor_for_ros_is_refused(arguments: list[str]) -> None:
    result = run("ros", *arguments)
    assert result.code == 2
    assert f"{arguments[0]} is not known; what is for ROS itself follows --ros-args" in result.line


def test_a_file_of_parameters_that_is_not_there(tmp_path: Path) -> None:
    result = run("ros", "--params-file", tmp_path / "none.yaml")
    assert result.code == 2
    assert "there is no such file of parameters" in result.line


@needs_ros
def test_a_robot_whose_name_is_impossible_is_refused_before_anything_starts(tmp_path: Path) -> None:
    result = run_for_real("ros", "--robots", "good,bad-name", cwd=tmp_path)
    assert result.code == 2
    assert "'bad-name' is no namespace" in result.line


@needs_ros
@pytest.mark.parametrize("arguments", [["--params-file", "bad.yaml"], ["--ros-args", "--nonsense"]])
def test_what_ros_cannot_read_is_said_without_a_traceback(arguments: list[str], tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text("bad: [")
    result = run_for_real("ros", *arguments, cwd=tmp_path)
    assert result.code == 2
    ours = [line for line in result.err.splitlines() if not line.startswith("[ERROR]")]  # those are ROS's own
    assert len(ours) == 1
    assert ours[0].startswith("mapmeld: ROS does not take its arguments: ")
