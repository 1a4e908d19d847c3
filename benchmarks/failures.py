"""Draws every pair that the default method does not accept though it should, or should not though it does.

    python benchmarks/failures.py DATASET... -o DIR [--tolerance NAME=m,deg]

DATASETs are folders or lists of pairs with known truth (docs/datasets.md). A picture shows the maps as
the answer lays them, beside the truth where there is one; a line says by how much it is off
and what the matcher says of it. The pictures show the data sets' maps: mind their licences.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import cv2

from mapmeld.evaluation.pairs import Pair, read_dataset
from mapmeld.evaluation.score import Tolerance, overlap_centroid, pose_errors
from mapmeld.grid import OccupancyGrid
from mapmeld.io import load
from mapmeld.matching import MatchResult, Verdict, match
from mapmeld.report import overlay, write_picture
from mapmeld.report.sheet import Panel, compose
from mapmeld.se2 import Pose2
from mapmeld.wording import probability_text


def failure(pair: Pair, tolerance: Tolerance, a: OccupancyGrid, b: OccupancyGrid, found: MatchResult) -> str:
    """Say what is wrong with an answer; empty if nothing is."""
    accepted = found.verdict is Verdict.ACCEPTED
    if pair.T_1_2 is None:
        return "accepted, but of different places" if accepted else ""
    centroid = pair.centroid or overlap_centroid(a, b, pair.T_1_2)
    if found.T_a_b is None or centroid is None:
        return "nothing found"
    errors = pose_errors(found.T_a_b, pair.T_1_2, centroid)
    off = f"off by {errors.translation:.2f} m and {math.degrees(errors.rotation):.1f} deg"
    if not errors.within(tolerance):
        return f"{'accepted' if accepted else found.verdict.value}, {off}"
    return "" if accepted else f"right ({off}), but {found.verdict.value}"


def main() -> None:
    """Match, draw, and say."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("datasets", nargs="+")
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--tolerance", action="append", default=[], metavar="NAME=m,deg")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    special = {}
    for text in options.tolerance:
        name, _, values = text.partition("=")
        metres, degrees = (float(v) for v in values.split(","))
        special[name] = Tolerance.of(metres, degrees)
    options.out.mkdir(parents=True, exist_ok=True)
    for dataset in map(read_dataset, options.datasets):
        for pair in dataset.pairs:
            a, b = load(pair.map_1), load(pair.map_2)
            found = match(a, b)
            tolerance = pair.tolerance or special.get(dataset.name, dataset.tolerance)
            wrong = failure(pair, tolerance, a, b, found)
            if not wrong:
                continue
            overlap = "" if pair.overlap is None else f", true overlap {pair.overlap:.2f}"
            words = f"{wrong}; P {probability_text(found.probability)}{overlap}; {found.reason}"
            print(f"{dataset.name} {pair.id}: {words}", flush=True)
            panels = [
                Panel(overlay([a, b], [Pose2(), T], ["map 1", "map 2"]), name)
                for name, T in (("the answer", found.T_a_b), ("the truth", pair.T_1_2))
                if T is not None
            ]
            name = f"{dataset.name.replace(':', '_')}_{pair.id.replace('/', '_')}.png"
            if panels:
                write_picture(compose(panels, f"{pair.id}: {words}"), options.out / name, force=True)


if __name__ == "__main__":
    main()
