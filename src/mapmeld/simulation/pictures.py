"""Pictures of environments and of drives in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mapmeld.report.canvas import Picture
from mapmeld.report.palette import BLUE, FLOOR_WHITE, FRAME, GREEN, INK, RED, UNKNOWN_GREY, Colour
from mapmeld.report.sheet import Panel, compose
from mapmeld.se2 import Pose2
from mapmeld.simulation.boxes import Box
from mapmeld.simulation.environment import Environment, Kind
from mapmeld.simulation.fields import rooms_of
from mapmeld.simulation.true_map import outside

_LONG_SIDE_PX = 1000
_SHIFT = 4  # OpenCV draws at sixteenths of a pixel

_WOOD: Colour = (125, 165, 195)
_SEAT: Colour = (200, 190, 175)
_CRATE: Colour = (110, 150, 165)
_SILL: Colour = (205, 225, 205)
_FILL = {Kind.CABINET: _WOOD, Kind.BOX: _CRATE, Kind.TABLE: (214, 228, 238), Kind.CHAIR: (240, 236, 230)}
_EDGE = {Kind.CABINET: (60, 95, 125), Kind.BOX: (50, 80, 95), Kind.TABLE: _WOOD, Kind.CHAIR: _SEAT}


@dataclass(frozen=True, slots=True)
class Drive:
    """One robot's way.

    Attributes
    ----------
    true
        Poses in the environment's frame.
    believed
        The same by odometry, in its own frame that begins at (0, 0, 0).
    """

    true: list[Pose2]
    believed: list[Pose2]


def environment_picture(environment: Environment, caption: str = "") -> Picture:
    """Draw a floor plan: walls black, doors green, cabinets and boxes filled, tables and chairs light."""
    plan = _Plan(environment)
    width, height = environment.size
    rooms = int(rooms_of(environment.fields).max(initial=0))
    words = caption or (
        f"{width:g} x {height:g} m, {rooms} rooms, {len(environment.doors())} doors, "
        f"{len(environment.furniture)} pieces of furniture."
    )
    return compose([Panel(plan.picture)], words, _legend(environment), plan.px_per_metre)


def drive_picture(environment: Environment, drives: Sequence[Drive], caption: str) -> Picture:
    """Draw where robots drove (red), and where odometry believed them to be (blue), on the floor plan."""
    plan = _Plan(environment)
    for drive in drives:
        if not drive.true:
            continue
        T_world_odom = drive.true[0] @ drive.believed[0].inverse()
        plan.line([(p.x, p.y) for p in (T_world_odom @ pose for pose in drive.believed)], BLUE)
        plan.line([(p.x, p.y) for p in drive.true], RED, thick=2)
        plan.start(drive.true[0])
    legend = [(RED, "true way"), (BLUE, "way by odometry"), (GREEN, "start")]
    return compose([Panel(plan.picture)], caption, legend, plan.px_per_metre)


def _legend(environment: Environment) -> list[tuple[Colour, str]]:
    kinds = {item.kind for item in environment.furniture}
    shown = [(_FILL[kind], f"{kind}") for kind in Kind if kind in kinds]
    return [(_SILL, "door"), *shown] if environment.doors() else shown


class _Plan:
    """A floor plan being drawn."""

    def __init__(self, environment: Environment) -> None:
        width, height = environment.size
        self.px_per_metre = max(4, round(_LONG_SIDE_PX / max(width, height)))
        self._height = height
        shape = (round(height * self.px_per_metre), round(width * self.px_per_metre), 3)
        self.picture: Picture = np.empty(shape, np.uint8)
        self.picture[:] = FLOOR_WHITE
        beyond = outside(environment, 1 / self.px_per_metre)[::-1]
        self.picture[beyond[: shape[0], : shape[1]]] = UNKNOWN_GREY
        for item in environment.furniture:
            self.box(item.footprint, _FILL[item.kind], _EDGE[item.kind])
            if item.kind in (Kind.TABLE, Kind.CHAIR):
                for leg in item.solids():
                    self.box(leg, INK)
        for door in environment.doors():
            self.box(door, _SILL)
        for wall in environment.walls():
            self.box(wall, INK)

    def _px(self, points: ArrayLike) -> NDArray[np.int32]:
        xy = np.asarray(points, np.float64).reshape(-1, 2)
        px = np.stack([xy[:, 0], self._height - xy[:, 1]], axis=-1) * self.px_per_metre - 0.5
        return np.rint(px * (1 << _SHIFT)).astype(np.int32)

    def box(self, box: Box, fill: Colour, edge: Colour | None = None) -> None:
        corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (box.length / 2, box.width / 2)
        points = self._px(box.pose.apply(corners))
        cv2.fillPoly(self.picture, [points], fill, cv2.LINE_AA, _SHIFT)
        if edge is not None:
            cv2.polylines(self.picture, [points], True, edge, 1, cv2.LINE_AA, _SHIFT)

    def line(self, points: ArrayLike, colour: Colour, thick: int = 1) -> None:
        cv2.polylines(self.picture, [self._px(points)], False, colour, thick, cv2.LINE_AA, _SHIFT)

    def start(self, pose: Pose2) -> None:
        """Mark a start: a disc as large as a robot, and an arrow where it looks."""
        radius = round(0.2 * self.px_per_metre) << _SHIFT
        tail, tip = self._px(pose.apply([(0.0, 0.0), (0.7, 0.0)]))
        cv2.circle(self.picture, tail.tolist(), radius, GREEN, cv2.FILLED, cv2.LINE_AA, _SHIFT)
        cv2.circle(self.picture, tail.tolist(), radius, FRAME, 1, cv2.LINE_AA, _SHIFT)
        cv2.arrowedLine(self.picture, tail.tolist(), tip.tolist(), GREEN, 2, cv2.LINE_AA, _SHIFT, 0.35)
