from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pytest
from small import hall, two_rooms

from mapmeld.se2 import Pose2
from mapmeld.simulation import Box, Environment, Furniture, Kind, mjcf, true_map


def test_every_wall_and_leg_is_a_box() -> None:
    table = Furniture(Kind.TABLE, Box(2.5, 2.5, 1.0, 0.6, 0.4))
    environment = Environment(two_rooms().fields, (table,))
    root = ET.fromstring(mjcf(environment))
    boxes = [geom for geom in root.iter("geom") if geom.get("type") == "box"]
    assert len(boxes) == len(environment.walls()) + 4


def test_the_model_loads_and_agrees_with_the_true_map() -> None:
    environment = two_rooms()
    model = mujoco.MjModel.from_xml_string(mjcf(environment))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    grid = true_map(environment, 0.25)
    rng = np.random.default_rng(0)
    hit = np.zeros(1, np.int32)
    for x, y in rng.uniform((0, 0), environment.size, (300, 2)):
        # Straight down from above: what is met first, floor or something standing on it?
        down = mujoco.mj_ray(model, data, (x, y, 2.0), (0, 0, -1), None, 1, -1, hit)
        col, row = np.floor(grid.metres_to_lattice((x, y))).astype(int)
        if down < 1.9:
            assert grid.occupied[row, col]


def test_robots_have_their_own_names() -> None:
    model = mujoco.MjModel.from_xml_string(mjcf(hall(), [Pose2(2, 3), Pose2(5, 3)]))
    assert model.nu == 4
    for name in ("robot_0", "robot_1"):
        assert model.body(name).id > 0
        assert model.site(f"{name}_laser").id >= 0
        assert model.actuator(f"{name}_left").id >= 0
    total = sum(model.body_mass[1:]) / 2
    assert total == pytest.approx(9.0, abs=0.2)
