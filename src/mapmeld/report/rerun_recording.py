"""A recording that the rerun viewer plays on a time line (extra ``rerun``)."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from mapmeld.extras import required
from mapmeld.grid import OccupancyGrid, resample
from mapmeld.history.step import Change, Standing, Step
from mapmeld.io import MapFileError
from mapmeld.io.atomic import check_targets, write_files
from mapmeld.merging.aligned import lattice_for_all
from mapmeld.report.canvas import Picture, paint, paint_map
from mapmeld.report.overlay import overlay_labels
from mapmeld.report.palette import BLUE, FLOOR_WHITE, GREEN, RED, UNKNOWN_GREY
from mapmeld.se2 import Pose2

SUFFIX = ".rrd"
_LEVELS = {Change.LOWERED: "WARN", Change.WITHDRAWN: "WARN", Change.NONE: "DEBUG", Change.CONFIRMED: "DEBUG"}


def check_recording_path(path: str | os.PathLike[str], *, force: bool = False) -> None:
    """Find out, before the work, that a recording could not be written.

    Raises
    ------
    MissingExtraError
        The extra "rerun" is not installed.
    MapFileError
        The name does not end in ``.rrd``, the file exists (and `force` is not set) or its folder does not.
    """
    if Path(path).suffix.lower() != SUFFIX:
        raise MapFileError.of(path, f"a recording for rerun has a name that ends in {SUFFIX}")
    check_targets([path], force=force)
    required("rerun", "rerun")


class RerunRecording:
    """Steps as rerun shows them: pictures of both maps and of the merge, curves, and a log in words.

    On the time lines ``step`` (their number) and ``time`` (seconds from the first stamp), under the names
    ``map_1``, ``map_2``, ``merge``, ``match/probability``, ``match/overlap``, ``match/T_1_2`` (x, y, theta)
    and ``log``. Nothing is written before `save`.

    Raises
    ------
    MissingExtraError
        The extra "rerun" is not installed.
    """

    def __init__(self) -> None:
        self._rerun: Any = required("rerun", "rerun")
        self._stream = self._rerun.RecordingStream("mapmeld follow")
        self._bytes = self._stream.binary_stream()
        self._begin: float | None = None
        self._stream.send_blueprint(self._layout())

    def _layout(self) -> Any:
        views = required("rerun.blueprint", "rerun")
        maps = [views.Spatial2DView(origin=name, name=name) for name in ("merge", "map_1", "map_2")]
        words = views.TextLogView(origin="log", name="log")
        curves = [
            views.TimeSeriesView(origin=f"match/{name}", name=name) for name in ("probability", "overlap")
        ]
        return views.Blueprint(
            views.Vertical(views.Horizontal(*maps), views.Horizontal(*curves, words), row_shares=[2, 1])
        )

    def take(self, step: Step) -> None:
        """Add a step."""
        stream = self._stream
        stream.set_time("step", sequence=step.number)
        if step.stamp is not None:
            self._begin = step.stamp if self._begin is None else self._begin
            stream.set_time("time", duration=step.stamp - self._begin)
        new = step.maps[step.which - 1]
        if new is not None:
            stream.log(f"map_{step.which}", self._image(paint_map(new).picture))
        map_1, map_2 = step.maps
        if map_1 is not None and map_2 is not None and step.T_1_2 is not None:
            stream.log("merge", self._image(_merge(map_1, map_2, step.T_1_2)))
        elif step.standing is not Standing.ACCEPTED:
            stream.log("merge", self._rerun.Clear(recursive=False))
        best = step.best
        if best is not None:
            if best.probability is not None:
                stream.log("match/probability", self._rerun.Scalars(best.probability))
            stream.log("match/overlap", self._rerun.Scalars(best.overlap))
            if best.T_a_b is not None:
                T = best.T_a_b
                stream.log("match/T_1_2", self._rerun.Scalars([T.x, T.y, T.theta]))
        text = f"{step.standing}, {step.change}: {step.why}"
        stream.log("log", self._rerun.TextLog(text, level=_LEVELS.get(step.change, "INFO")))

    def _image(self, picture: Picture) -> Any:
        done, data = cv2.imencode(".png", picture)
        assert done
        return self._rerun.EncodedImage(contents=np.asarray(data).tobytes(), media_type="image/png")

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> Path:
        """Write the recording, whole or not at all; return the path. No step can be added afterwards.

        Raises
        ------
        MapFileError
            As `check_recording_path`, or the disk refuses.
        """
        check_recording_path(path, force=force)
        write_files([(path, (self.close(),))], force=force)
        return Path(path)

    def close(self) -> bytes:
        """End the recording and return what it holds; one that is just dropped would complain."""
        content: bytes = self._bytes.read(flush=True) or b""
        self._stream.disconnect()
        return content


def _merge(map_1: OccupancyGrid, map_2: OccupancyGrid, T_1_2: Pose2) -> Picture:
    lattice = lattice_for_all([map_1, map_2], [Pose2(), T_1_2])
    labels = overlay_labels([resample(map_1, Pose2(), lattice), resample(map_2, T_1_2, lattice)])
    return paint(labels, [UNKNOWN_GREY, FLOOR_WHITE, RED, BLUE, GREEN]).picture
