"""The report: ``report.html``, its pictures as files, and its figures as ``results.json``."""

from __future__ import annotations

import json
import math
import platform
import statistics
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as installed
from pathlib import Path

import cv2
import numpy as np

from mapmeld.experiment.folder import FIGURES, REPORT, STAGES
from mapmeld.experiment.pages import charts, html, maps
from mapmeld.experiment.results import Results
from mapmeld.experiment.rows import JoinRow, MatchingRow
from mapmeld.experiment.statistics import (
    PAPER_MATCHED,
    PAPER_MATCHINGS,
    PAPER_SINGLE,
    PAPER_SUCCESSES,
    Column,
    Successes,
    accepted_elsewhere,
    computing_seconds,
    joined,
    kind_of_cause,
    method_description,
    method_label,
    stated_probabilities,
    table_1,
    ways_by_kind,
)
from mapmeld.io.atomic import write_files
from mapmeld.report.canvas import Picture
from mapmeld.wording import plural

RESULTS = "results.json"
_LIBRARIES = ("numpy", "scipy", "opencv-python-headless", "numba", "mujoco", "scikit-image", "matplotlib")
_STAGE_NAMES = dict(
    zip(
        STAGES,
        (
            "environments",
            "driving and mapping",
            "matching of histories",
            "further mappings",
            "different environments",
            "navigability",
        ),
        strict=True,
    )
)


def write_report(root: Path, results: Results) -> Path:
    """Write the report of a finished experiment into its folder; return the path of the page.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    MapFileError
        A file cannot be read or written.
    """
    album = _Album()
    body = list(_body(root.resolve(), results, album))
    page = html.page("Map matching, reproduced", body).encode()
    (root / FIGURES).mkdir(exist_ok=True)
    for stale in (root / FIGURES).glob("*.png"):
        if stale.name not in album.pictures:
            stale.unlink()
    write_files(
        [
            *((root / FIGURES / name, [png]) for name, png in album.pictures.items()),
            (root / RESULTS, [(json.dumps(summary(results), indent=1) + "\n").encode()]),
            (root / REPORT, [page]),
        ],
        force=True,
    )
    return root / REPORT


class _Album:
    """Pictures that are in the page and files as well."""

    def __init__(self) -> None:
        self.pictures: dict[str, bytes] = {}

    def map(self, name: str, picture: Picture, caption: str) -> str:
        done, data = cv2.imencode(".png", picture)
        assert done
        return self.png(name, np.asarray(data, np.uint8).tobytes(), caption)

    def png(self, name: str, png: bytes, caption: str) -> str:
        self.pictures[f"{name}.png"] = png
        return html.figure(png, caption)


def summary(results: Results) -> dict[str, object]:
    """Return the figures of the report in plain types."""
    return {
        "settings": results.settings,
        "table_1": {name or "single mappings": asdict(c) for name, c in table_1(results).items()},
        "paper": {
            "single mappings": asdict(PAPER_SINGLE),
            "matched": asdict(PAPER_MATCHED),
            "successes": PAPER_SUCCESSES,
            "matchings": PAPER_MATCHINGS,
        },
        "successes": {m: asdict(Successes.of(results.matchings_of(m))) for m in results.methods},
        "causes": {m: dict(_causes(results, m)) for m in results.methods},
        "joined": {m: joined(results, m) for m in results.methods},
        "accepted_of_different_environments": {
            m: list(accepted_elsewhere(results, m)) for m in results.methods
        },
        "calibration_error": {m: stated_probabilities(results, m).calibration_error for m in results.methods},
        "navigability": {name: asdict(ways) for name, ways in ways_by_kind(results).items()},
        "computing_seconds": dict(computing_seconds(results)),
        "wall_seconds": results.wall_seconds,
    }


# ---------------------------------------------------------------------- the page, section by section
def _body(root: Path, results: Results, album: _Album) -> Iterator[str]:
    yield from _summary(results)
    yield from _pictures(root, results, album)
    yield from _table_1(results, album)
    yield from _successes(root, results, album)
    yield from _over_time(results, album)
    yield from _further(root, results, album)
    yield from _navigability(results)
    yield from _probability(results, album)
    yield from _environments(results, album, root)
    yield from _failures(root, results, album)
    yield from _times(results)
    yield from _settings(results)


def _summary(results: Results) -> Iterator[str]:
    count = len(results.matchings) // max(1, len(results.methods))
    yield "<h1>Map matching, reproduced</h1>"
    yield html.paragraph(
        f"“Map Matching for SLAM with Multiple Robots in Different Moments”, sections 3 and 4, from nothing: "
        f"{plural(len(results.environments), 'random environment')}, "
        f"{plural(len(results.mappings), 'simulated mapping')}, "
        f"{count} matchings of mapping processes, judged by the known truth.",
        "lead",
    )
    columns = table_1(results)
    items = []
    for method in results.methods:
        s = Successes.of(results.matchings_of(method))
        items.append((f"{s.right} of {s.total}", f"successes, {method_label(method)}"))
    items.append((f"{PAPER_SUCCESSES} of {PAPER_MATCHINGS}", "successes in the paper"))
    items.append((_three(columns[""].mean), "mean accuracy of single mappings"))
    first = results.methods[0]
    items.append((_three(columns[first].mean), f"mean accuracy of two merged, {method_label(first)}"))
    yield html.tiles(items)
    yield html.paragraph(
        "A success is a final transform within 0.5 m and 5 degrees of the truth at the middle of the "
        "overlap. "
        "The paper judged by eye. Methods: "
        + "; ".join(f"{method_label(m)} is {method_description(m)}" for m in results.methods)
        + ".",
        "note",
    )


def _pictures(root: Path, results: Results, album: _Album) -> Iterator[str]:
    """Figure 8."""
    yield html.heading("One environment and its matchings (Figure 8)")
    method = results.methods[0]
    good = [row for row in results.matchings_of(method) if row.right]
    environment = _most_common([row.environment for row in good]) or results.environments[0].environment
    chosen = [row for row in good if row.environment == environment][:3]
    figures = [
        album.map(
            "figure_8a",
            maps.true_map_picture(root, environment),
            f"(a) Environment {environment} as it is.",
        )
    ]
    for letter, row in zip("bcd", chosen, strict=False):
        figures.append(
            album.map(
                f"figure_8{letter}",
                maps.matching_picture(root, row),
                f"({letter}) Mappings {row.mapping_1} and {row.mapping_2}, matched by "
                f"{method_label(method)}: "
                f"{_metres(row.translation_error)} and {_degrees(row.rotation_error)} off, "
                f"accuracy {_three(row.accuracy)}.",
            )
        )
    yield html.side_by_side(figures)
    if not chosen:
        yield html.paragraph(f"There is no successful matching by {method_label(method)}.")
    yield html.paragraph(
        "Red is what the first robot mapped, blue the second, green the walls that both saw (within one "
        "cell).",
        "note",
    )


def _table_1(results: Results, album: _Album) -> Iterator[str]:
    yield html.heading("Accuracy (Table 1)")
    yield html.paragraph(
        "Equation 3: the share of the black and white cells of a map that have the same colour in the true "
        "environment. Single mappings, and the merged map of every success."
    )
    columns = table_1(results)
    head = ["", "paper: GMapping", "ours: GMapping", "paper: matched"]
    head += [f"ours: {method_label(m)}" for m in results.methods]
    lined = [PAPER_SINGLE, columns[""], PAPER_MATCHED, *(columns[m] for m in results.methods)]
    parts: tuple[tuple[str, Callable[[Column], float | None]], ...] = (
        ("Mean", lambda c: c.mean),
        ("Median", lambda c: c.median),
        ("Standard deviation", lambda c: c.deviation),
    )
    rows = [[name, *(_six(get(c)) for c in lined)] for name, get in parts]
    rows.append(["Maps", *(str(c.count) for c in lined)])
    yield html.table(head, rows)
    yield album.png(
        "accuracy",
        charts.as_png(charts.accuracy_chart(results)),
        "Every map is a point. Lines are means.",
    )


def _successes(root: Path, results: Results, album: _Album) -> Iterator[str]:
    del root
    yield html.heading("Successes")
    yield album.png(
        "successes",
        charts.as_png(charts.success_chart(results)),
        "Successes per environment and method.",
    )
    rows = []
    for method in results.methods:
        listed = results.matchings_of(method)
        s = Successes.of(listed)
        errors = [r.translation_error for r in listed if r.right and r.translation_error is not None]
        turns = [r.rotation_error for r in listed if r.right and r.rotation_error is not None]
        rows.append(
            [
                method_label(method),
                f"{s.right} of {s.total}",
                str(s.accepted_right),
                str(s.accepted_wrong),
                _metres(statistics.median(errors) if errors else None),
                _degrees(statistics.median(turns) if turns else None),
            ]
        )
    rows.append(["the paper", f"{PAPER_SUCCESSES} of {PAPER_MATCHINGS}", "", "", "", ""])
    yield html.table(
        ["", "right", "accepted and right", "accepted and wrong", "median error", "median turn"], rows
    )
    yield html.paragraph(
        "Right: the final transform, whatever the method says of it, which is how the paper counts. "
        "Accepted: "
        "what the method itself says may be merged. Errors are of successes.",
        "note",
    )
    if len(results.methods) > 1:
        yield html.paragraph(_both(results), "note")


def _both(results: Results) -> str:
    right = {
        m: {(r.environment, r.mapping_1, r.mapping_2) for r in results.matchings_of(m) if r.right}
        for m in results.methods
    }
    first, *others = results.methods
    parts = [
        f"{len(right[first] - right[m])} pairs are right by {method_label(first)} alone, "
        f"{len(right[m] - right[first])} by {method_label(m)} alone"
        for m in others
    ]
    return "; ".join(parts) + "."


def _over_time(results: Results, album: _Album) -> Iterator[str]:
    yield html.heading("While the maps grow")
    yield album.png(
        "over_time",
        charts.as_png(charts.over_time_chart(results)),
        "Left: matchings whose best transform is right at that time. Right: accuracy of the single maps, "
        "and of "
        "merged maps where the match is right. Bands hold the middle half.",
    )
    rows = []
    for method in results.methods:
        since = [r.first_right for r in results.matchings_of(method) if r.right and r.first_right is not None]
        if since:
            rows.append([method_label(method), f"{statistics.median(since):.0f} s", f"{max(since):.0f} s"])
    if rows:
        yield html.table(["", "right from then on, median", "at the latest"], rows)


def _further(root: Path, results: Results, album: _Album) -> Iterator[str]:
    yield html.heading("Three, four, five mappings (Figure 9)")
    if not results.joins:
        yield html.paragraph("There are none: that needs three mappings and a successful matching of two.")
        return
    yield html.paragraph(
        "Each success is matched, two by two, with every other mapping of its environment; a result that is "
        "right is merged and goes on, one that is wrong goes no further."
    )
    most = max(len(row.members) for row in results.joins)
    head = ["", "from two", *(f"{n} mappings" for n in range(3, most + 1)), "matchings tried", "right"]
    rows = []
    for method in results.methods:
        mine = [row for row in results.joins if row.method == method]
        reached = joined(results, method)
        rows.append(
            [
                method_label(method),
                str(len(mine)),
                *(str(reached.get(n, 0)) for n in range(3, most + 1)),
                str(sum(row.tried for row in mine)),
                str(sum(row.right for row in mine)),
            ]
        )
    yield html.table(head, rows)
    figures = []
    for number, (row, size) in enumerate(_examples(results), 1):
        caption = (
            f"({'ab'[number - 1]}) Environment {row.environment}: mappings "
            f"{_listed(row.members[:size])}, by {method_label(row.method)}; "
            f"accuracy {_three(row.accuracies[size - 2])}."
        )
        figures.append(album.map(f"figure_9{'ab'[number - 1]}", maps.join_picture(root, row, size), caption))
    yield html.side_by_side(figures)


def _examples(results: Results) -> list[tuple[JoinRow, int]]:
    """Return a merge of three and one of as many as there are, of environment 2 as in the paper if it can."""
    method = results.methods[0]
    rows = [row for row in results.joins if row.method == method] or list(results.joins)
    best = max(rows, key=lambda row: (len(row.members), row.environment == 2))
    sizes = sorted({min(3, len(best.members)), len(best.members)} - {2})
    return [(best, size) for size in sizes]


def _navigability(results: Results) -> Iterator[str]:
    yield html.heading("Can a robot drive by these maps?")
    yield html.paragraph(
        "The question that the paper leaves open. Between random places that the robots reach, the "
        "shortest way "
        f"for a robot of radius {results.settings['robot_radius']:g} m is planned on the map, and driven "
        "in the "
        "true environment, where it may give way by 0.2 m."
    )
    rows = [
        [
            name,
            str(w.maps),
            str(w.pairs),
            _percent(w.reachable_map, w.pairs),
            _percent(w.reachable_truth, w.pairs),
            _percent(w.false_passages, w.reachable_map),
            _percent(w.false_blocks, w.reachable_truth),
            "-" if w.length_ratio is None else f"{w.length_ratio:.3f}",
        ]
        for name, w in ways_by_kind(results).items()
    ]
    yield html.table(
        [
            "", "maps", "pairs", "a way on the map", "in truth", "false passages", "false blocks",
            "length / true length",
        ],
        rows,
    )  # fmt: skip
    yield html.paragraph(
        "False passage: the way planned on the map cannot be driven in truth. False block: there is a "
        "way in truth, "
        "and none on the map. Lengths: median of ways that can be driven.",
        "note",
    )
    problems = [row.problem for row in results.ways if row.problem]
    if problems:
        yield html.paragraph(
            f"On {len(problems)} maps nothing could be planned, first: {problems[0]}.", "note"
        )


def _probability(results: Results, album: _Album) -> Iterator[str]:
    yield html.heading("What a stated probability is worth")
    rows = []
    for method in results.methods:
        s = stated_probabilities(results, method)
        wrong, tried = accepted_elsewhere(results, method)
        rows.append(
            [
                method_label(method),
                f"{wrong} of {tried}",
                str(Successes.of(results.matchings_of(method)).accepted_wrong),
                str(len(s.probability)) if s.probability else "states none",
                "-" if s.calibration_error is None else f"{s.calibration_error:.3f}",
                "-" if s.brier is None else f"{s.brier:.4f}",
            ]
        )
    yield html.table(
        [
            "", "different environments accepted", "one environment accepted and wrong", "probabilities",
            "calibration error", "Brier score",
        ],
        rows,
    )  # fmt: skip
    for method in results.methods:
        chart = charts.reliability_chart(results, method)
        if chart is not None:
            yield album.png(
                f"reliability_{method}",
                charts.as_png(chart),
                f"{method_label(method).capitalize()}: stated probabilities of the final matches of one "
                "environment "
                "and of pairs of different environments.",
            )


def _environments(results: Results, album: _Album, root: Path) -> Iterator[str]:
    yield html.heading("Environments and mappings")
    rows = []
    for e in results.environments:
        own = [m for m in results.mappings if m.environment == e.environment]
        rows.append(
            [
                str(e.environment),
                str(e.seed),
                f"{e.width:g} x {e.height:g} m",
                str(e.rooms),
                str(e.furniture),
                f"{statistics.fmean(m.duration for m in own):.0f} s",
                f"{statistics.fmean(m.driven for m in own):.0f} m",
                f"{statistics.fmean(m.states for m in own):.0f}",
                f"{statistics.fmean(m.position_error for m in own):.2f} m",
                _three(statistics.fmean(m.accuracy for m in own)),
            ]
        )
    yield html.table(
        [
            "number", "seed", "ground", "rooms", "furniture", "tour", "driven", "states", "SLAM off (RMS)",
            "accuracy",
        ],
        rows,
    )  # fmt: skip
    yield html.paragraph(
        "Tours, states, errors and accuracies are means of the environment's mappings.", "note"
    )
    figures = [
        album.map(
            f"environment_{e.environment:02}",
            maps.true_map_picture(root, e.environment),
            f"Environment {e.environment}",
        )
        for e in results.environments
    ]
    yield html.folded("All environments", html.side_by_side(figures))


def _failures(root: Path, results: Results, album: _Album) -> Iterator[str]:
    yield html.heading("Failures")
    for method in results.methods:
        failed = [row for row in results.matchings_of(method) if not row.right]
        label = method_label(method)
        if not failed:
            yield html.paragraph(f"{label.capitalize()}: none.")
            continue
        causes = ", ".join(f"{count} {cause}" for cause, count in _causes(results, method))
        yield html.paragraph(f"{label.capitalize()}: {len(failed)} ({causes}).")
        figures = []
        for row in failed:
            caption = (
                f"Environment {row.environment}, mappings {row.mapping_1} and {row.mapping_2} "
                f"({round(100 * row.true_overlap)} % of the smaller is common): {row.cause}"
                f"{'; accepted all the same' if row.accepted else ''}."
            )
            name = f"failure_{method}_{row.environment:02}_{row.mapping_1}_{row.mapping_2}"
            figures.append(album.map(name, maps.failure_picture(root, row), caption))
        content = html.side_by_side(figures)
        yield html.folded(f"All {len(failed)} with pictures", content) if len(failed) > 6 else content
    yield html.paragraph(
        "Near miss: off by less than twice what is allowed. Not found: by the method's own measure the "
        "true transform "
        "would have won, but it was not among what was tried. Misled: a wrong transform is more alike "
        "than the "
        "true one.",
        "note",
    )


def _causes(results: Results, method: str) -> list[tuple[str, int]]:
    failed = (row for row in results.matchings_of(method) if not row.right)
    return Counter(kind_of_cause(row.cause) for row in failed).most_common()


def _times(results: Results) -> Iterator[str]:
    yield html.heading("Times")
    computing = computing_seconds(results)
    rows = [
        [_STAGE_NAMES[stage], f"{computing[stage]:.1f} s", f"{results.wall_seconds.get(stage, 0.0):.1f} s"]
        for stage in STAGES
    ]
    rows.append(
        ["together", f"{sum(computing.values()):.1f} s", f"{sum(results.wall_seconds.values()):.1f} s"]
    )
    yield html.table(["", "computing (CPU of one core)", "passed, over all runs"], rows)
    simulated = sum(row.duration for row in results.mappings)
    driving = sum(row.simulation_seconds for row in results.mappings)
    mapping = sum(row.slam_seconds for row in results.mappings)
    if driving > 0 and mapping > 0:
        yield html.paragraph(
            f"{simulated:.0f} s of driving were simulated {simulated / driving:.0f} times, and mapped "
            f"{simulated / mapping:.1f} times, faster than real time. What passed depends on workers and "
            "on what "
            "else the machine does.",
            "note",
        )
    per_step = [
        f"{method_label(m)} {1000 * sum(r.seconds for r in own) / sum(r.steps for r in own):.0f} ms"
        for m in results.methods
        if (own := results.matchings_of(m))
    ]
    yield html.paragraph(f"Computing per new state of a map: {', '.join(per_step)}.", "note")


def _settings(results: Results) -> Iterator[str]:
    yield html.heading("Settings, versions, seeds")
    yield html.table(
        ["", ""],
        [
            ["mapmeld", str(results.settings["mapmeld"])],
            ["Python", platform.python_version()],
            ["system", f"{platform.system()} {platform.machine()}"],
            *([name, _installed(name)] for name in _LIBRARIES),
        ],
        words=(1,),
    )
    yield html.folded("All settings", html.listing(json.dumps(results.settings, indent=2)))
    rows = [
        [
            f"{m.environment}, {m.mapping}",
            str(m.seed),
            f"{m.start[0]:.2f}, {m.start[1]:.2f}, {math.degrees(m.start[2]):.0f}°",
            f"{m.duration:.0f} s",
            f"{m.driven:.0f} m",
            f"{m.used} of {m.scans}",
            str(m.states),
            f"{m.odometry_error_end:.2f} m",
            f"{m.position_error_end:.2f} m",
            _three(m.accuracy),
        ]
        for m in results.mappings
    ]
    head = [
        "environment, mapping", "seed", "start", "tour", "driven", "scans used", "states",
        "odometry off at the end", "SLAM off at the end", "accuracy",
    ]  # fmt: skip
    yield html.folded("All mappings with their seeds", html.table(head, rows))
    yield html.folded("All matchings", html.table(*_all_matchings(results.matchings)))


def _all_matchings(rows: Iterable[MatchingRow]) -> tuple[list[str], list[list[str]]]:
    head = [
        "environment, pair", "method", "states", "common", "right", "accepted", "off", "turned",
        "probability", "similarity", "accuracy",
    ]  # fmt: skip
    return head, [
        [
            f"{r.environment}, {r.mapping_1} and {r.mapping_2}",
            r.method,
            str(r.steps),
            f"{round(100 * r.true_overlap)} %",
            "yes" if r.right else "no",
            "yes" if r.accepted else "no",
            _metres(r.translation_error),
            _degrees(r.rotation_error),
            "-" if r.probability is None else f"{r.probability:.3f}",
            f"{r.similarity:.3f}",
            _three(r.accuracy),
        ]
        for r in rows
    ]


# ---------------------------------------------------------------------- wording
def _installed(name: str) -> str:
    try:
        return installed(name)
    except PackageNotFoundError:
        return "not installed"


def _most_common(numbers: Sequence[int]) -> int | None:
    """Return the number that is there most often, the lowest of such."""
    return max(sorted(set(numbers)), key=numbers.count, default=None)


def _listed(numbers: Sequence[int]) -> str:
    *most, last = map(str, numbers)
    return f"{', '.join(most)} and {last}"


def _three(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def _six(value: float | None) -> str:
    return "-" if value is None else f"{value:.6f}"


def _metres(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f} m"


def _degrees(value: float | None) -> str:
    return "-" if value is None else f"{math.degrees(value):.1f}°"


def _percent(part: int, whole: int) -> str:
    return "-" if not whole else f"{100 * part / whole:.1f} %"
