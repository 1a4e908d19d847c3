"""Is `match(b, a)` the inverse of `match(a, b)`? Prints a Markdown table of how often not.

    python benchmarks/swapped_inputs.py DATASET... [--methods correlative,alphabet]

DATASETs are folders or lists of pairs (docs/datasets.md); truths are not needed.
"""

from __future__ import annotations

import argparse
import math

import cv2

from mapmeld.evaluation.pairs import read_dataset
from mapmeld.io import load
from mapmeld.matching import METHODS, match

METRES, DEGREES = 0.05, 0.5  # what differs by more than this is another answer


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("datasets", nargs="+")
    parser.add_argument("--methods", default="correlative", help=f"of {', '.join(METHODS)}")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    print(
        "| data set | method | pairs | other verdict | other transform, accepted | other transform, any "
        "| greatest difference where accepted |"
    )
    print("| --- | --- | --: | --: | --: | --: | --- |")
    for dataset in map(read_dataset, options.datasets):
        for method in options.methods.split(","):
            verdicts = accepted = anyhow = 0
            most = (0.0, 0.0)
            for pair in dataset.pairs:
                a, b = load(pair.map_1), load(pair.map_2)
                there, back = match(a, b, method), match(b, a, method)
                verdicts += there.verdict is not back.verdict
                if there.T_a_b is None or back.T_a_b is None:
                    anyhow += there.T_a_b is not back.T_a_b
                    continue
                # Compared where map b lies: far from it a turn would count as a shift.
                turned = back.T_a_b.inverse()
                rows, cols = b.shape
                middle = b.lattice_to_metres((cols / 2, rows / 2))
                metres = math.dist(there.T_a_b.apply(middle), turned.apply(middle))
                degrees = math.degrees(there.T_a_b.distance_to(turned)[1])
                differs = metres > METRES or degrees > DEGREES
                anyhow += differs
                if there.verdict.value == back.verdict.value == "accepted":
                    accepted += differs
                    most = max(most[0], metres), max(most[1], degrees)
            print(
                f"| {dataset.name} | {method} | {len(dataset.pairs)} | {verdicts} | {accepted} | {anyhow} "
                f"| {most[0]:.2g} m, {most[1]:.2g} deg |",
                flush=True,
            )


if __name__ == "__main__":
    main()
