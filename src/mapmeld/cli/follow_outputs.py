"""What ``mapmeld follow`` writes, all of it when it ends well, nothing when it is interrupted."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import typer

from mapmeld.cli.json_output import Fields, as_json, follow_fields
from mapmeld.errors import MapmeldError
from mapmeld.history import Change, Step
from mapmeld.io import save
from mapmeld.io.atomic import write_files
from mapmeld.io.folders import whole_folder
from mapmeld.io.history_writer import TIMES, state_name

if TYPE_CHECKING:
    from mapmeld.report.film import Film
    from mapmeld.report.rerun_recording import RerunRecording

TRANSFORM, MERGED, SNAPSHOTS = "transform.json", "merged.yaml", "snapshots"
_OURS = re.compile(rf"{SNAPSHOTS}/(state_\d{{5,}}\.(yaml|pgm)|{TIMES})")


@dataclass(frozen=True, slots=True)
class Interval:
    """How often something is done: every so many states, or seconds of their stamps."""

    states: int | None = None
    seconds: float | None = None


def read_interval(text: str) -> Interval:
    """Read ``10`` as states and ``30s`` as seconds."""
    if re.fullmatch(r"[0-9]{1,9}", text) and int(text) > 0:
        return Interval(states=int(text))
    if re.fullmatch(r"[0-9]{1,9}(\.[0-9]{1,9})?s", text) and float(text[:-1]) > 0:
        return Interval(seconds=float(text[:-1]))
    raise typer.BadParameter(
        f"a number of states (10) or of seconds (30s) is needed, not {text[:40]!r}", param_hint="--every"
    )


@dataclass(frozen=True, slots=True)
class Wanted:
    """What is to be written, and whether over other files."""

    folder: Path | None
    every: Interval | None
    strip: Path | None
    gif: Path | None
    rerun: Path | None
    force: bool


class Outputs:
    """Takes the steps as they come, and writes what is wanted.

    As a context it holds the folder back: unless the block ends without an error, it does not appear.
    After `finish`, `files` are the files written, and `problems` says which pictures are not there and why.

    Raises
    ------
    MapmeldError
        Something that is wanted could not be written; found out before the work.
    """

    def __init__(self, wanted: Wanted) -> None:
        self.files: list[Path] = []
        self.problems: list[str] = []
        self._wanted = wanted
        self._changes: list[Step] = []
        self._film: Film | None = None
        self._recording: RerunRecording | None = None
        self._snapshots: Snapshots | None = None
        self._stack = ExitStack()
        self._folder: Path | None = None
        if wanted.strip is not None:
            from mapmeld.report import check_picture_path

            check_picture_path(wanted.strip, force=wanted.force)
        if wanted.gif is not None:
            from mapmeld.report.film import check_gif_path

            check_gif_path(wanted.gif, force=wanted.force)
        if wanted.strip is not None or wanted.gif is not None:
            from mapmeld.report.film import Film

            self._film = Film()
        if wanted.rerun is not None:
            from mapmeld.report.rerun_recording import RerunRecording, check_recording_path

            check_recording_path(wanted.rerun, force=wanted.force)
            self._recording = RerunRecording()

    def __enter__(self) -> Outputs:
        wanted = self._wanted
        if wanted.folder is not None:
            ours = _left_by_earlier_runs(wanted.folder)
            self._folder = self._stack.enter_context(
                whole_folder(wanted.folder, force=wanted.force, ours=ours)
            )
            if wanted.every is not None:
                self._snapshots = Snapshots(self._folder / SNAPSHOTS, wanted.every)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool | None:
        if self._recording is not None:
            self._recording.close()
        return self._stack.__exit__(kind, error, trace)

    def take(self, step: Step) -> None:
        """Take the next step."""
        if step.change not in (Change.NONE, Change.CONFIRMED):
            self._changes.append(step)
        if self._film is not None:
            self._film.take(step)
        if self._recording is not None:
            self._recording.take(step)
        if self._snapshots is not None:
            self._snapshots.take(step)

    def finish(
        self,
        last: Step | None,
        names: Sequence[str],
        method: str,
        parameters: Any,
        strategy: str,
        seconds: float,
    ) -> Fields:
        """Write everything; return the outcome as JSON fields.

        What cannot be drawn takes nothing else with it: `-o` holds what hours of mapping came to.
        """
        wanted = self._wanted
        pictures = self._pictures(last is not None and None not in last.maps)
        try:
            write_files(pictures, force=wanted.force)
            self.files += [path for path, _ in pictures]
        except MapmeldError as error:
            self.problems.append(str(error))
        written: list[Path] = []
        if self._folder is not None:
            merged = None if last is None else last.merged()
            if merged is not None:
                written += save(merged, self._folder / MERGED)
            if self._snapshots is not None:
                written += self._snapshots.finish()
            written.append(self._folder / TRANSFORM)
            assert wanted.folder is not None
            self.files += [wanted.folder / path.relative_to(self._folder) for path in written]
        outcome = follow_fields(last, self._changes, names, method, parameters, strategy, self.files, seconds)
        if self._folder is not None:
            write_files([(self._folder / TRANSFORM, [(as_json(outcome) + "\n").encode()])])
        return outcome

    def _pictures(self, drawable: bool) -> list[tuple[Path, list[bytes]]]:
        """Return strip, animation and recording as files to write."""
        found: list[tuple[Path, list[bytes]]] = []
        wanted = self._wanted
        draw: list[tuple[Path | None, Callable[[Film], bytes]]] = [(wanted.strip, _strip), (wanted.gif, _gif)]
        for path, drawn in draw:
            if path is not None and self._film is not None and drawable:
                try:
                    found.append((path, [drawn(self._film)]))
                except MapmeldError as error:
                    self.problems.append(f"{path}: {error}")
        if wanted.rerun is not None and self._recording is not None:
            found.append((wanted.rerun, [self._recording.close()]))
            self._recording = None
        return found


def _strip(film: Film) -> bytes:
    from mapmeld.report.film import strip
    from mapmeld.report.png import png_bytes

    return png_bytes(strip(film))


def _gif(film: Film) -> bytes:
    from mapmeld.report.film import frames, gif_bytes

    return gif_bytes(frames(film))


class Snapshots:
    """The merged map from time to time, as a history folder of its own."""

    def __init__(self, folder: Path, every: Interval) -> None:
        self._folder = folder
        self._every = every
        self._times: list[str] = []
        self._next: float | None = None

    def take(self, step: Step) -> None:
        """Write the merged map if it is time to; there is none while no match is accepted."""
        if not self._due(step):
            return
        merged = step.merged()
        if merged is None:
            return
        self._folder.mkdir(exist_ok=True)
        name = state_name(step.number)
        save(merged, self._folder / name)
        self._times.append(f"{name} {step.number if step.stamp is None else step.stamp!r}")

    def _due(self, step: Step) -> bool:
        if self._every.states is not None:
            return step.number % self._every.states == 0
        assert self._every.seconds is not None
        if step.stamp is None:
            return False
        if self._next is None:
            self._next = step.stamp + self._every.seconds
        if step.stamp < self._next:
            return False
        missed = int((step.stamp - self._next) / self._every.seconds)
        self._next += (missed + 1) * self._every.seconds
        return True

    def finish(self) -> list[Path]:
        """Write the times; return the folder, if there is one."""
        if not self._times:
            return []
        lines = ["# map  stamp [s]", *self._times, ""]
        write_files([(self._folder / TIMES, ["\n".join(lines).encode()])])
        return [self._folder]


def _left_by_earlier_runs(folder: Path) -> list[str]:
    ours = [TRANSFORM, MERGED, str(Path(MERGED).with_suffix(".pgm"))]
    earlier = (path.relative_to(folder).as_posix() for path in folder.glob(f"{SNAPSHOTS}/*"))
    return [*ours, *(name for name in earlier if _OURS.fullmatch(name))]
