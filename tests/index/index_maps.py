"""Maps for the tests of the index: two buildings, seen in different frames, in a folder."""

import math
from pathlib import Path

from drawing import cut, office, school, seen_from

from mapmeld.index import MapIndex, build_index, map_files
from mapmeld.io import save
from mapmeld.se2 import Pose2

T_B_A = Pose2(3.0, -2.0, math.radians(40))


def write_buildings(root: Path) -> None:
    """office.yaml, school.yaml, and in a folder inside the west part of the office, turned."""
    (root / "floor").mkdir(parents=True)
    save(office(), root / "office.yaml")
    save(school(), root / "school.yaml")
    save(seen_from(cut(office(), 0, 0, 11, 12), T_B_A), root / "floor" / "west.yaml")


def index_of(root: Path) -> MapIndex:
    return build_index(root, map_files(root)).index
