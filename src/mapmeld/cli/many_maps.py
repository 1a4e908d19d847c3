"""What the commands for many maps share: known poses, and progress over pairs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from mapmeld.cli.options import Strategy
from mapmeld.cli.progress import counting, working

if TYPE_CHECKING:
    from mapmeld.merging import KnownPose


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
