"""What the commands for many maps share: known poses, what speaks against them, progress over pairs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from mapmeld.cli.errors import say
from mapmeld.cli.options import Strategy
from mapmeld.cli.progress import counting, working

if TYPE_CHECKING:
    from mapmeld.grid import OccupancyGrid
    from mapmeld.merging import KnownPose, PairMatch

_LISTED = 3  # matches in a note


def known_for(
    maps: Sequence[str], file: Path | None, no_match: bool
) -> tuple[dict[int, KnownPose] | None, bool]:
    """Return the known poses of maps by their indices, and whether to match them."""
    if file is None:
        if no_match:
            raise typer.BadParameter("needs --known-poses", param_hint="--no-match")
        return None, True
    from mapmeld.merging.graph import read_known_poses

    known, matching = read_known_poses(file, maps)
    return known, matching and not no_match


def note_doubtful_poses(
    known: Mapping[int, KnownPose] | None,
    pairs: Sequence[PairMatch],
    grids: Sequence[OccupancyGrid],
    names: Sequence[str],
) -> None:
    """Say on stderr which matches contradict known poses, and where walls do not support exact ones."""
    from mapmeld.cli.placement import note_if_unlikely
    from mapmeld.grid import overlap_share
    from mapmeld.merging.graph import MUCH_OVERLAP

    if not known:
        return
    against = [pair for pair in pairs if pair.against_known]
    if against:
        shown = [_named(pair, names) for pair in against[:_LISTED]]
        if len(against) > _LISTED:
            shown.append(f"{len(against) - _LISTED} more")
        words = "an accepted match does" if len(against) == 1 else f"{len(against)} accepted matches do"
        say(f"note: {words} not agree with the known poses ({'; '.join(shown)}); they are used as given")
    for pair in pairs:
        one, other = (known.get(k) for k in (pair.i, pair.j))
        if pair.against_known or one is None or other is None:
            continue
        if one.sigma_metres or one.sigma_theta or other.sigma_metres or other.sigma_theta:
            continue  # walls are finer than that
        a, b, T_a_b = grids[pair.i], grids[pair.j], one.T_w_i.inverse() @ other.T_w_i
        if overlap_share(a, b, T_a_b) >= MUCH_OVERLAP:
            note_if_unlikely("their known poses", T_a_b, a, b, (names[pair.i], names[pair.j]))


def _named(pair: PairMatch, names: Sequence[str]) -> str:
    """Name a match, how probable it is, and how far it lies from where the maps are."""
    from mapmeld.wording import probability_text, rounded

    facts = []
    if pair.result.probability is not None:
        facts.append(f"probability {probability_text(pair.result.probability)}")
    if pair.off is not None:
        facts.append(f"{rounded(pair.off[0], 2)} m and {rounded(math.degrees(pair.off[1]), 1)} deg off")
    return f"{names[pair.i]} - {names[pair.j]}" + (f": {', '.join(facts)}" if facts else "")


@contextmanager
def progress_of(
    count: int, strategy: Strategy, matching: bool, candidates: int | None
) -> Iterator[Callable[[], None] | None]:
    """Show a bar over the pairs of so many maps while the block runs, a spinner where none are counted."""
    if strategy is Strategy.GRAPH and matching:
        most = count * (count - 1) // 2
        # Two maps may be candidates of one another: fewer pairs, but how many is known only by and by.
        with counting(
            "Matching pairs", most if candidates is None else min(most, count * candidates)
        ) as step:
            yield step
    else:
        with working(f"Merging {count} maps"):
            yield None
