"""The default matcher on one page: search coarsely, align finely, weigh the evidence, say how sure.

Both maps play the same part: the answer for (b, a) is the inverse of that for (a, b).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapmeld.grid import OccupancyGrid
from mapmeld.matching.correlative.alignment import refine, to_local, to_metric, turn_and_shift
from mapmeld.matching.correlative.covariance import best_fit, of_inverse
from mapmeld.matching.correlative.evidence import HIT, Evidence, quick_scores, weigh
from mapmeld.matching.correlative.parameters import CorrelativeParameters
from mapmeld.matching.correlative.prepared_map import PreparedMap, prepare
from mapmeld.matching.correlative.probability import ProbabilityModel, fitted_model, surplus_of_others
from mapmeld.matching.correlative.search import search
from mapmeld.matching.correlative.wall_map import Doubles, WallMap
from mapmeld.matching.result import Alternative, MatchResult, Verdict

COARSE_SCALES, COARSE_POINTS = (0.8, 0.6, 0.4), 160
FINE_SCALES, FINE_POINTS = (0.4, 0.3, 0.2, 0.15, 0.15), 600
LOOKED_AT = 6  # transforms for which the full evidence is measured
UNBENT_KEEPS = 0.8  # share of the walls explained as they lie that a transform found by bending must keep
RIVAL_SCORE = 0.0  # even odds if the mode stood alone
RIVAL_EXPLAINS = 0.95  # of the share of walls that the best mode explains
RIVAL_CONTRADICTED = 0.01  # more, as a share of the walls, than in the best mode
RIVAL_CLEAN = 0.05  # share of the walls contradicted from which the maps themselves tell against it
REPEAT_SCORE = 2.0  # from which, standing alone, a mode shows that the place may repeat itself
REPEAT_WALL = 0.7  # of the best mode's tested wall that it must have had tested too
REPEAT_SLOPE = 10.0  # score that it falls behind, by the share by which a metre of its wall tells less
FIXED_LEAST = 4.0  # [m] of wall that must fix every direction
WALL_LEAST = 36.0  # [m] of wall of both maps in the overlap; rooms that look alike can have less in common
AT_ODDS = 0.09, 0.13  # shares of wall explained as it lies x contradicted: doubtful from, impossible from
APART = 1.0  # [m] modes nearer than this (or than the maps bend) are one
APART_TURNED = 0.13  # [rad]
AS_GOOD = 1.0  # score by which a mode may fall behind and still be as good as the best of its kind
SLIDE_SCORES = 2.0, 10.0  # of modes that may be moved along the direction that is fixed least
SLIDE_WEAK = 15.0  # [m] by less wall than this
SLIDES = np.arange(-10, 11) * 0.1  # [m]
SLIDE_SOFTNESS = 2.0  # what scores along the way are divided by: so far they scatter
SLIDE_GAIN = 1.0  # of score, for which a mode is moved
SLIDE_KEEPS = 0.6  # share of the walls explained as they lie that it must keep
SLIDE_WITHIN = 0.5, 0.85  # [m], probability: less sure to be that near, a mode moves if it loses little by it


@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """One way to lay map 2 on map 1.

    Attributes
    ----------
    local
        (x, y, theta) between the local frames of the two wall maps.
    evidence
        What speaks for it.
    score
        Of the probability model, as if there were no other modes.
    spread
        Standard deviation [m] along the direction that is fixed least, if it was moved along it.
    """

    local: Doubles
    evidence: Evidence
    score: float
    spread: float = 0.0


def match_correlative(
    a: OccupancyGrid, b: OccupancyGrid, parameters: CorrelativeParameters | None = None
) -> MatchResult:
    """Match two maps by correlation of walls and floor, alignment of walls, and evidence.

    `probability` is calibrated, see docs/methods.md; the verdict is ``ambiguous`` where several modes
    together, but none alone, are sure enough.
    """
    parameters = parameters or CorrelativeParameters()
    prepared_a, prepared_b = prepare(a), prepare(b)
    if prepared_a is None or prepared_b is None:
        return _rejected(f"nothing to match on: map {'a' if prepared_a is None else 'b'} has no obstacle")
    if _comes_first(prepared_b.walls, prepared_a.walls):
        return _inverted(_match(prepared_b, prepared_a, parameters))
    return _match(prepared_a, prepared_b, parameters)


def _match(a: PreparedMap, b: PreparedMap, parameters: CorrelativeParameters) -> MatchResult:
    modes = ranked_modes(a, b, parameters)
    if not modes:
        return _rejected("nothing to match on: the walls fit nowhere")
    probabilities = mode_probabilities(modes, fitted_model())
    return _answer(a.walls, b.walls, modes, probabilities, parameters.accept_probability)


def ranked_modes(a: PreparedMap, b: PreparedMap, parameters: CorrelativeParameters) -> list[Mode]:
    """Return the truly different ways to lay b on a, with the evidence for each, best first."""
    hypotheses = search(a.reduced, b.reduced, parameters.hypotheses)
    if not hypotheses:
        return []
    transforms = np.array([to_local(a.walls, b.walls, h.T_a_b) for h in hypotheses])
    transforms = refine(a.walls, b.walls, transforms, COARSE_SCALES, COARSE_POINTS)
    transforms = transforms[_most_promising(a.walls, b.walls, transforms)]
    transforms = refine(a.walls, b.walls, transforms, FINE_SCALES, FINE_POINTS)
    return _distinct(_weighed(a.walls, b.walls, transforms, fitted_model()))


def _most_promising(walls_a: WallMap, walls_b: WallMap, transforms: Doubles) -> list[int]:
    """Return the rows worth a full look, none of them a repetition of a better one."""
    quick = quick_scores(walls_a, walls_b, transforms, 2 * COARSE_POINTS)
    quick[0] = np.inf  # the search's own favourite always gets its full look
    metres, radians = _apart(complex(walls_b.points[:200].mean()), transforms)
    differ = (metres > 0.4) | (radians > 0.05)
    kept: list[int] = []
    for k in np.argsort(-quick, kind="stable"):
        if differ[k, kept].all():
            kept.append(int(k))
    return kept[:LOOKED_AT]


def _weighed(walls_a: WallMap, walls_b: WallMap, transforms: Doubles, model: ProbabilityModel) -> list[Mode]:
    """Measure the evidence for each transform (k, 3); the best comes first."""

    def weighed(transforms: Doubles) -> list[Mode]:
        found = weigh(walls_a, walls_b, transforms)
        return [Mode(local, e, model.score(e)) for local, e in zip(transforms, found, strict=True)]

    modes = sorted(weighed(transforms), key=lambda mode: -mode.score)
    best = modes[0]
    if best.evidence.bend > HIT:
        # Narrow tolerances can lock onto one part of a bent map; the bending has seen all of it.
        (again,) = weighed(best.evidence.unbent[None])
        # Not at the price of walls that fitted as they lay: those are more exact than any bending.
        if again.score > best.score and again.evidence.hit >= UNBENT_KEEPS * best.evidence.hit:
            modes[0] = again
    low, high = SLIDE_SCORES
    if low < modes[0].score < high and modes[0].evidence.weak < SLIDE_WEAK:
        modes[0] = _centred(walls_a, walls_b, modes[0], model)
    return modes


def _centred(walls_a: WallMap, walls_b: WallMap, mode: Mode, model: ProbabilityModel) -> Mode:
    """Move a mode along the direction that is fixed least to the middle of where it may lie.

    Along a corridor the alignment holds on to what little crosses it, be it a door frame or clutter; the
    whole evidence, after bending, often is as good or better for half a metre to one side.
    """
    free = mode.evidence.free
    steps = np.stack([SLIDES * free.real, SLIDES * free.imag, np.zeros(len(SLIDES))], axis=1)
    scores = np.array([model.score(e) for e in weigh(walls_a, walls_b, mode.local + steps)])
    weights = np.exp((scores - scores.max()) / SLIDE_SOFTNESS)
    weights /= weights.sum()
    shift = float(weights @ SLIDES)
    local = mode.local + weights @ steps
    (evidence,) = weigh(walls_a, walls_b, local[None])
    score = model.score(evidence)
    near, sure = SLIDE_WITHIN
    gain = SLIDE_GAIN if weights[np.abs(SLIDES) < near + 1e-6].sum() > sure else -SLIDE_SOFTNESS
    if score < mode.score + gain or evidence.hit < SLIDE_KEEPS * mode.evidence.hit:
        return mode  # the walls fix it more exactly than this
    spread = math.sqrt(float(weights @ (SLIDES - shift) ** 2))
    return Mode(local, evidence, score, spread)


def _distinct(modes: Sequence[Mode]) -> list[Mode]:
    """Return modes that truly differ, best first; of those that do not, the one that fits best unbent.

    Modes are one if they are near one another as they lie, or as bending moves them: nothing in a
    building repeats itself within a metre, but maps that bend fit in several ways.
    """
    count = len(modes)
    transforms = np.array([mode.local for mode in modes] + [mode.evidence.unbent for mode in modes])
    groups: list[list[int]] = []
    left = list(range(count))
    while left:
        first = left[0]
        evidence = modes[first].evidence
        # Where the better one has its walls: elsewhere a small turn would part what is one.
        metres, radians = _apart(evidence.middle, transforms)
        metres[radians > APART_TURNED] = np.inf
        nearest = metres.reshape(2, count, 2, count).min(axis=(0, 2))[first]
        near = max(APART, 1.5 * evidence.bend)
        groups.append([k for k in left if k == first or nearest[k] <= near])
        left = [k for k in left if k not in groups[-1]]
    heads = [
        [modes[k] for k in group if modes[k].score >= modes[group[0]].score - AS_GOOD] for group in groups
    ]
    return [max(head, key=lambda mode: mode.evidence.hit) for head in heads]


def _apart(middle_b: complex, t: Doubles) -> tuple[Doubles, Doubles]:
    """How far apart (k, k) transforms t (k, 3) put a point of b [m], and how differently they turn it."""
    turn, shift = turn_and_shift(t)
    middle = turn[:, 0] * middle_b + shift[:, 0]
    turned = np.remainder(t[:, 2] - t[:, 2, None] + math.pi, math.tau) - math.pi
    return np.abs(middle - middle[:, None]), np.abs(turned)


def mode_probabilities(modes: Sequence[Mode], model: ProbabilityModel) -> Doubles:
    """Return P(right) of each mode.

    What the model says, less where it cannot know: where next to no wall fixes some direction, so that
    the maps slide along one another; with little wall; and where exact agreement and contradiction meet,
    as of two floors of one building.
    """
    trust = [_fixed(m.evidence) * _enough(m.evidence) * _consistent(m.evidence) for m in modes]
    by_chance = model.chance * surplus_of_others([mode.evidence for mode in modes], LOOKED_AT)
    scores = np.array([mode.score for mode in modes]) - by_chance
    return np.asarray(model.probabilities(_level_rivals(modes, scores)) * np.array(trust))


def _fixed(found: Evidence) -> float:
    return min(1.0, found.weak / FIXED_LEAST)


def _enough(found: Evidence) -> float:
    return min(1.0, found.wall / WALL_LEAST)


def _consistent(found: Evidence) -> float:
    """Walls that fit as they lie leave no room for drift to explain those that are contradicted."""
    at_odds = found.hit / found.wall * found.contra / found.wall
    return min(1.0, max(0.0, (AT_ODDS[1] - at_odds) / (AT_ODDS[1] - AT_ODDS[0])))


def _level_rivals(modes: Sequence[Mode], scores: Doubles) -> list[float]:
    """Return the modes' scores, those of rivals raised to the best's.

    A rival explains what it covers as well as the best does what that covers, next to nothing
    speaks against it, and it would be more likely right than not if it stood alone. Then the best
    only covers more, which in a place that repeats itself says nothing: the maps would fit equally
    well one room further on.
    """
    best = float(scores[0])
    explained, contradicted = modes[0].evidence.shares
    levelled = []
    for mode, score in zip(modes, scores.tolist(), strict=True):
        its_explained, its_contradicted = mode.evidence.shares
        rival = (
            mode.score > RIVAL_SCORE
            and its_explained >= RIVAL_EXPLAINS * explained
            and its_contradicted <= min(contradicted + RIVAL_CONTRADICTED, RIVAL_CLEAN)
        )
        levelled.append(best if rival else max(min(score, best), best - _behind(mode, modes[0])))
    return levelled


def _behind(mode: Mode, best: Mode) -> float:
    """How far a mode falls behind the best if what counts is the metre of wall, not how many there are.

    In a place that repeats itself the best mode may only have more of the same. Infinite for modes that
    do not show this: unlikely ones, or with less wall tested.
    """
    if mode.score <= REPEAT_SCORE or mode.evidence.wall < REPEAT_WALL * best.evidence.wall:
        return math.inf
    return REPEAT_SLOPE * max(0.0, 1 - mode.evidence.per_metre / best.evidence.per_metre)


# ---------------------------------------------------------------------- the answer
def _answer(
    walls_a: WallMap, walls_b: WallMap, modes: Sequence[Mode], probabilities: Doubles, accept: float
) -> MatchResult:
    # What lowers a probability may lower that of the mode with the highest score below others'.
    order = np.argsort(-probabilities, kind="stable")
    modes, probabilities = [modes[k] for k in order], probabilities[order]
    best = modes[0].evidence
    reason = _in_words(best)
    if probabilities[0] >= accept:
        verdict = Verdict.ACCEPTED
    elif best.weak < FIXED_LEAST and _enough(best) / (1 + math.exp(-modes[0].score)) > 0.5:
        verdict = Verdict.AMBIGUOUS
        reason += f"; only {best.weak:.1f} m of wall fix the place along the others"
    elif probabilities.sum() >= accept:
        verdict = Verdict.AMBIGUOUS
        reason += "; another transform explains the maps about as well"
    else:
        verdict = Verdict.REJECTED
        reason += ": not enough to be sure"
    fitted, covariance = _fitted(walls_a, walls_b, modes[0])
    return MatchResult(
        T_a_b=to_metric(walls_a, walls_b, fitted),
        verdict=verdict,
        reason=reason,
        probability=float(probabilities[0]),
        similarity=_similarity(walls_a, walls_b, best),
        overlap=min(1.0, best.overlap),
        covariance=covariance,
        alternatives=tuple(
            Alternative(
                to_metric(walls_a, walls_b, mode.local),
                _similarity(walls_a, walls_b, mode.evidence),
                float(probability),
            )
            for mode, probability in zip(modes[1:], probabilities[1:], strict=True)
        ),
    )


def _in_words(found: Evidence) -> str:
    if found.wall < 1:
        return "next to no wall of either map lies where the other map knows anything"
    return (
        f"of {found.wall:.0f} m of wall in the overlap the other map explains "
        f"{100 * found.hit_bent / found.wall:.0f} % and contradicts {100 * found.contra / found.wall:.1f} %"
    )


def _fitted(walls_a: WallMap, walls_b: WallMap, mode: Mode) -> tuple[Doubles, Doubles]:
    """Return the transform that fits all walls best (local frames), and its covariance.

    A mode that was moved to the middle of where it may lie stays there, along that direction.
    """
    found = mode.evidence
    fitted, covariance = best_fit(walls_a, walls_b, found.unbent, found.overlap)
    if mode.spread == 0:
        return fitted, covariance
    moved = _taken(fitted, found.middle) - _taken(mode.local, found.middle)
    back = (moved * found.free.conjugate()).real * found.free
    angle = walls_a.frame.theta
    free = found.free * complex(math.cos(angle), math.sin(angle))
    along = mode.spread * np.array([free.real, free.imag, 0.0])
    return fitted - np.array([back.real, back.imag, 0.0]), covariance + np.outer(along, along)


def _taken(t: Doubles, point: complex) -> complex:
    return complex(t[0], t[1]) + point * complex(math.cos(t[2]), math.sin(t[2]))


def _similarity(walls_a: WallMap, walls_b: WallMap, found: Evidence) -> float:
    """Jaccard similarity of the walls by their length: explained within `HIT` / of either map."""
    total = float(walls_a.metres.sum() + walls_b.metres.sum())
    shared = min(found.hit / 2, total / 2)
    return shared / (total - shared)


def _rejected(reason: str) -> MatchResult:
    return MatchResult(T_a_b=None, verdict=Verdict.REJECTED, reason=reason, probability=0.0)


# ---------------------------------------------------------------------- both maps play the same part
def _comes_first(b: WallMap, a: WallMap) -> bool:
    """Whether b is the one to lay the other on: the larger map, or any order that swapping respects."""
    key_a, key_b = ((w.area, len(w.points), w.shape) for w in (a, b))
    if key_a == key_b:
        return b.points.tobytes() > a.points.tobytes()
    return key_b > key_a


def _inverted(result: MatchResult) -> MatchResult:
    """Return the answer for (b, a) as that for (a, b)."""
    T_b_a = result.T_a_b
    if T_b_a is None:
        return result
    return replace(
        result,
        T_a_b=T_b_a.inverse(),
        covariance=None if result.covariance is None else of_inverse(T_b_a, result.covariance),
        alternatives=tuple(replace(other, T_a_b=other.T_a_b.inverse()) for other in result.alternatives),
    )
