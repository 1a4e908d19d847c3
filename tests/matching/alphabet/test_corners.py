import cv2
import numpy as np
import pytest
from drawing import office

from mapmeld.matching.alphabet import AlphabetParameters, extract_corners, preprocess

BLOCK = np.full((60, 80), 255, np.uint8)
BLOCK[20:40, 10:50] = 0


def test_the_corners_of_a_block_are_found_at_their_lattice_positions() -> None:
    corners = extract_corners(BLOCK, AlphabetParameters())
    assert len(corners) == 4
    for corner in [(10, 20), (50, 20), (10, 40), (50, 40)]:
        assert np.hypot(*(corners - corner).T).min() <= 1.0


def test_mirroring_the_image_mirrors_the_corners() -> None:
    # Fails if the half pixel between pixel centres and lattice positions is forgotten.
    corners = extract_corners(BLOCK, AlphabetParameters())
    mirrored = extract_corners(np.ascontiguousarray(BLOCK[:, ::-1]), AlphabetParameters())
    mirrored[:, 0] = BLOCK.shape[1] - mirrored[:, 0]
    assert sorted(map(tuple, corners)) == sorted(map(tuple, mirrored))


def test_number_and_spacing_are_kept() -> None:
    image = preprocess(office())
    few = extract_corners(image, AlphabetParameters(corners=7))
    assert len(few) == 7
    apart = extract_corners(image, AlphabetParameters(corner_spacing_px=40.0))
    distance = np.hypot(*(apart[:, None] - apart[None]).transpose(2, 0, 1))
    assert distance[~np.eye(len(apart), dtype=bool)].min() >= 40.0


def test_only_strong_corners_are_taken() -> None:
    image = preprocess(office())
    all_corners = extract_corners(image, AlphabetParameters(corners=1000, corner_quality=0.01))
    strong = extract_corners(image, AlphabetParameters(corners=1000, corner_quality=0.9))
    assert 0 < len(strong) < len(all_corners)


def test_a_blank_map_has_no_corners() -> None:
    assert extract_corners(np.full((9, 9), 255, np.uint8), AlphabetParameters()).shape == (0, 2)
    assert extract_corners(np.zeros((0, 0), np.uint8), AlphabetParameters()).shape == (0, 2)


@pytest.mark.parametrize("rows", [7, 128])
def test_they_are_opencvs_good_features_to_track(rows: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mapmeld.matching.alphabet.corners._STRIP_ROWS", rows)
    rng = np.random.default_rng(5)
    noise = rng.integers(0, 255, (150, 200), np.uint8)
    image = cv2.GaussianBlur(noise, (0, 0), 2).astype(np.uint8)  # no two corners equally strong
    ours = extract_corners(image, AlphabetParameters(corners=50, corner_spacing_px=8.0))
    theirs = cv2.goodFeaturesToTrack(image, 50, 0.2, 8.0).reshape(-1, 2) + 0.5
    np.testing.assert_array_equal(ours, theirs)
