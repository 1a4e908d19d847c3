"""The ament_python package: what can be read and built without a ROS installation."""

import ast
import configparser
import json
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
import yaml

from mapmeld import __version__
from mapmeld.ros.parameters import PARAMETERS

PACKAGE = Path(__file__).parents[2] / "ros/mapmeld_ros"
NAME = "mapmeld_ros"


def test_the_file_of_parameters_has_all_with_their_defaults_and_meanings() -> None:
    path = PACKAGE / "config/mapmeld.yaml"
    given = yaml.safe_load(path.read_text())["mapmeld"]["ros__parameters"]
    assert given == {name: about.default for name, about in PARAMETERS.items()}
    assert {name: type(value) for name, value in given.items()} == {
        name: type(about.default) for name, about in PARAMETERS.items()
    }
    for about in PARAMETERS.values():
        assert f"# {about.text}" in path.read_text()


def test_package_xml() -> None:
    root = ET.parse(PACKAGE / "package.xml").getroot()
    assert (root.tag, root.get("format")) == ("package", "3")
    assert root.findtext("name") == NAME
    assert root.findtext("version") == __version__
    assert root.findtext("export/build_type") == "ament_python"
    needed = {element.text for element in root.findall("exec_depend")}
    assert needed >= {
        "rclpy",
        "nav_msgs",
        "tf2_msgs",
        "map_msgs",
        "diagnostic_msgs",
        "std_srvs",
        "launch_ros",
    }


def test_setup_installs_where_ros_looks(tmp_path: Path) -> None:
    """Built by setuptools, as colcon does; ``ros2 run`` looks in lib/NAME, ``ros2 launch`` in share/NAME."""
    pytest.importorskip("setuptools")
    prefix = tmp_path / "install"
    built = subprocess.run(
        [
            sys.executable, "setup.py", "egg_info", "--egg-base", str(tmp_path),
            "build", "--build-base", str(tmp_path / "build"),
            "install", "--prefix", str(prefix), "--record", str(tmp_path / "record.txt"),
            "--single-version-externally-managed",
        ],
        cwd=PACKAGE, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr[-2000:]
    share = prefix / "share"
    assert (share / f"ament_index/resource_index/packages/{NAME}").is_file()
    for path in ("package.xml", "launch/mapmeld.launch.py", "config/mapmeld.yaml", "rviz/mapmeld.rviz",
                 "foxglove/mapmeld.json"):  # fmt: skip
        assert (share / NAME / path).read_bytes() == (PACKAGE / path).read_bytes()
    assert (prefix / f"lib/{NAME}/mapmeld").is_file()
    config = configparser.ConfigParser()
    config.read(PACKAGE / "setup.cfg")
    assert config["install"]["install_scripts"] == f"$base/lib/{NAME}"


def test_the_launch_file_starts_what_the_package_installs() -> None:
    tree = ast.parse((PACKAGE / "launch/mapmeld.launch.py").read_text())
    words = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}
    assert {NAME, "mapmeld", "mapmeld.yaml", "mapmeld.rviz", "use_sim_time", "robots"} <= words
    assert any(isinstance(n, ast.FunctionDef) and n.name == "generate_launch_description" for n in tree.body)


def test_the_layouts_show_what_the_node_publishes() -> None:
    rviz = yaml.safe_load((PACKAGE / "rviz/mapmeld.rviz").read_text())
    displays = rviz["Visualization Manager"]["Displays"]
    topics = {d["Topic"]["Value"] for d in displays if isinstance(d.get("Topic"), dict)}
    assert "/merged_map" in topics
    assert "/merged_map" in json.dumps(json.loads((PACKAGE / "foxglove/mapmeld.json").read_text()))


def test_the_node_of_the_package_says_in_one_line_what_a_user_can_mend() -> None:
    program = "import sys; sys.modules['rclpy'] = None; from mapmeld_ros.node import main; main()"
    run = subprocess.run(
        [sys.executable, "-c", program], cwd=PACKAGE, capture_output=True, text=True, check=False
    )
    assert run.returncode == 1
    assert run.stderr.startswith("mapmeld: ")
    assert len(run.stderr.splitlines()) == 1
