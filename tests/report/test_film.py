import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
from drawing import cut, office, seen_from

from mapmeld.errors import MapmeldError
from mapmeld.grid import OccupancyGrid
from mapmeld.history import Change, Step, Work, follow
from mapmeld.report import PictureError
from mapmeld.report import film as film_module
from mapmeld.report.canvas import Picture
from mapmeld.report.film import FRAMES, STRIP_FRAMES, TURNS, Film, check_gif_path, frames, strip, write_gif
from mapmeld.report.lettering import wrapped
from mapmeld.report.palette import BLUE, GREEN, RED, Colour
from mapmeld.report.sheet import Panel, compose
from mapmeld.se2 import Pose2

T_2_PLACE = Pose2(3.0, -2.0, 0.7)


@pytest.fixture(scope="module")
def steps() -> list[Step]:
    place = office(0.1)
    first = [replace(cut(place, 0, 0, x, 12), stamp=x) for x in (4.0, 10.0, 16.0)]
    second = [
        replace(seen_from(cut(place, x, 0, 16, y), T_2_PLACE), stamp=stamp)
        for x, y, stamp in ((13.0, 4.0, 8.0), (0.0, 12.0, 20.0))
    ]
    return list(follow(first, second))


def film_of(steps: Sequence[Step]) -> Film:
    film = Film()
    for step in steps:
        film.take(step)
    return film


def has(picture: Picture, colour: tuple[int, int, int]) -> int:
    return int(np.count_nonzero((picture == colour).all(axis=-1)))


def test_a_strip_shows_both_maps_and_from_the_match_on_their_common_walls(steps: list[Step]) -> None:
    assert steps[-1].T_1_2 is not None
    assert steps[2].T_1_2 is None
    undecided, whole = strip(film_of(steps[:3])), strip(film_of(steps))
    assert whole.shape[1] > undecided.shape[1], "more moments, a longer row"
    for picture in (undecided, whole):
        assert has(picture, RED) > 300
        assert has(picture, BLUE) > 300
    assert has(whole, GREEN) > 1000 > has(undecided, GREEN), "there the legend alone"


def test_every_frame_has_the_same_size(steps: list[Step]) -> None:
    pictures = frames(film_of(steps))
    assert len(pictures) == len([step for step in steps if None not in step.maps])
    assert len({picture.shape for picture in pictures}) == 1


def test_of_many_steps_some_are_kept_and_always_the_last(steps: list[Step]) -> None:
    calm = replace(steps[-1], change=Change.CONFIRMED, work=Work.CHECK)
    film = film_of([replace(calm, number=number) for number in range(1, 1002)])
    kept = [step.number for step in film.steps()]
    assert kept[-1] == 1001
    assert FRAMES // 2 <= len(kept) <= FRAMES + 1
    assert len({b - a for a, b in pairwise(kept[:-1])}) == 1, "evenly spread"
    assert STRIP_FRAMES <= FRAMES


def test_nothing_to_draw(steps: list[Step]) -> None:
    film = film_of(steps[:1])
    assert film.steps() == []
    with pytest.raises(PictureError, match="nothing to draw"):
        strip(film)
    with pytest.raises(PictureError, match="nothing to draw"):
        frames(film)


def test_maps_of_different_cells_and_turned_lattices(steps: list[Step]) -> None:
    place = office(0.1)
    turned = replace(place, origin=Pose2(5.0, 1.0, 0.3))
    stepping = list(follow([place], [OccupancyGrid(office(0.05).cells, 0.05, turned.origin)]))
    assert stepping[-1].T_1_2 is not None
    assert has(strip(film_of(stepping)), GREEN) > 1000


def test_maps_are_kept_no_finer_than_they_are_drawn(steps: list[Step]) -> None:
    cells = np.full((1000, 4000), -1, np.int8)
    cells[300:900, 100:3900] = 0
    cells[600, 100:3900] = 100  # one cell thin
    large = OccupancyGrid(cells, 0.05, Pose2(7.0, -3.0, 0.2))
    film = film_of([replace(steps[-1], maps=(large, large))])
    for kept in film.steps()[0].maps:
        assert kept is not None
        assert 700 < max(kept.shape) <= 801, "and nothing spent on the unknown border"
        assert kept.known_area == pytest.approx(large.known_area, rel=0.01)
        wall, seen = (np.asarray(mask.any(axis=0)) for mask in (kept.occupied, kept.known))
        assert (wall == seen).all(), "thin walls stay whole"
        middle = kept.centres(kept.occupied).mean(axis=0)
        assert np.hypot(*(middle - large.centres(large.occupied).mean(axis=0))) < 0.3
    same = film_of(steps).steps()[-1]
    assert same.maps == steps[-1].maps, "small maps are as they were"


def test_maps_far_apart_are_drawn_smaller_and_further_not_at_all(steps: list[Step]) -> None:
    first, second = steps[-1].maps
    assert first is not None
    away = [
        replace(steps[-1], number=9, maps=(first.moved(Pose2(metres, 0, 0)), second)) for metres in (500, 5e5)
    ]
    whole = strip(film_of([*steps, away[0]]))
    assert max(whole.shape) < 5000
    for draw in (strip, frames):
        with pytest.raises(PictureError, match="too far apart"):
            draw(film_of([*steps, away[1]]))


# ---------------------------------------------------------------------- the animation
gifs = pytest.mark.skipif(not hasattr(cv2, "imencodeanimation"), reason="this OpenCV writes no GIF")


@gifs
def test_an_animation_reads_back(steps: list[Step], tmp_path: Path) -> None:
    pictures = frames(film_of(steps))
    path = write_gif(pictures, tmp_path / "film.gif")
    done, animation = cv2.imreadanimation(str(path))
    assert done
    assert len(animation.frames) == len(pictures)
    drawn = np.asarray(animation.frames[-1])[..., :3].astype(int)
    assert np.abs(drawn - pictures[-1]).mean() < 3, "colours are not mixed"
    assert [p.name for p in tmp_path.iterdir()] == ["film.gif"]


@gifs
def test_nothing_is_replaced_unasked(steps: list[Step], tmp_path: Path) -> None:
    path = tmp_path / "film.gif"
    path.write_text("mine")
    pictures = frames(film_of(steps[-1:]))
    with pytest.raises(MapmeldError, match="exists"):
        write_gif(pictures, path)
    write_gif(pictures, path, force=True)
    assert path.read_bytes().startswith(b"GIF8")


def test_only_gif(tmp_path: Path) -> None:
    with pytest.raises(PictureError, match=re.escape(".gif")):
        check_gif_path(tmp_path / "film.png")


def test_an_opencv_that_writes_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(cv2, "imencodeanimation", raising=False)
    with pytest.raises(PictureError, match="draw a strip"):
        check_gif_path(tmp_path / "film.gif")


# ---------------------------------------------------------------------- which moments, and what is said
def test_a_strip_has_the_moments_where_something_happened(steps: list[Step]) -> None:
    turns = {40: Change.FOUND, 41: Change.WITHDRAWN, 90: Change.SWITCHED}
    calm = replace(steps[-1], change=Change.CONFIRMED, work=Work.CHECK)
    film = film_of(
        [
            replace(calm, number=n, stamp=float(n), change=turns.get(n, Change.CONFIRMED))
            for n in range(1, 201)
        ]
    )
    assert [step.number for step in film.moments()] == [film.steps()[0].number, 40, 41, 90, 144, 200]


def test_of_endless_turns_the_first_and_the_newest_are_kept(steps: list[Step]) -> None:
    film = film_of(
        [replace(steps[-1], number=n, change=Change.FOUND, work=Work.CHECK) for n in range(1, 500)]
    )
    assert len(film.steps()) <= FRAMES + 1 + TURNS
    assert [step.number for step in film.moments() if step.number not in (8, 16)][-3:] == [497, 498, 499]
    assert len(film.moments()) <= STRIP_FRAMES


def test_states_as_they_were_are_passed_over(steps: list[Step]) -> None:
    same = replace(steps[-1], number=9, work=Work.NOTHING, change=Change.NONE)
    assert [step.number for step in film_of([*steps, same]).steps()] == [2, 3, 4, 5]


def test_times_count_from_the_first_state_and_probabilities_are_those_of_the_table(
    steps: list[Step], monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []

    def noted(panels: Sequence[Panel], caption: str, legend: Sequence[tuple[Colour, str]]) -> Picture:
        said.extend(panel.name for panel in panels)
        return compose(panels, caption, legend)

    monkeypatch.setattr(film_module, "compose", noted)
    best = steps[-1].best
    assert best is not None
    last = replace(steps[-1], best=replace(best, probability=0.975))
    strip(film_of([*steps[:-1], last]))
    assert said[0].startswith("4.0 s: undecided"), "state 1, without the other map, came 4 s before"
    assert said[-1] == "16.0 s: accepted, p = 0.975"
    strip(film_of([replace(last, best=replace(best, probability=0.9999))]))
    assert said[-1].endswith("p > 0.999")


def test_captions_of_narrow_maps_break_between_words(steps: list[Step]) -> None:
    narrow = cut(office(0.1), 0, 0, 1, 12)
    walls = list(follow([narrow], [narrow]))
    lines = wrapped("123.4 s: undecided, p = 0.975", 0.8, 200, bold=True)
    assert " ".join(lines) == "123.4 s: undecided, p = 0.975", "no word is cut"
    assert strip(film_of(walls)).shape[1] >= 200
