"""The colours of the pictures, as (blue, green, red): the order in which OpenCV keeps them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Colour = tuple[int, int, int]

# The paper's grey conventions.
UNKNOWN_GREY: Colour = (205, 205, 205)
FLOOR_WHITE: Colour = (255, 255, 255)
WALL_BLACK: Colour = (0, 0, 0)

RED: Colour = (50, 45, 220)
BLUE: Colour = (215, 95, 20)
GREEN: Colour = (65, 150, 25)
ORANGE: Colour = (0, 130, 240)
PURPLE: Colour = (170, 50, 140)
TEAL: Colour = (150, 140, 0)
BROWN: Colour = (40, 75, 140)
PINK: Colour = (175, 95, 230)

FAINT: Colour = (200, 185, 170)
PAPER: Colour = (250, 250, 250)
INK: Colour = (40, 40, 40)
FRAME: Colour = (170, 170, 170)

# One per map or robot, the same in every picture: 1 red, 2 blue, as in Figure 8 (Figure 7 has them the
# other way round). Green is kept for what maps share.
MAP_COLOURS: tuple[Colour, ...] = (RED, BLUE, ORANGE, PURPLE, TEAL, BROWN, PINK)
# Told apart at a glance, for relations that belong together in two pictures.
PAIR_COLOURS: tuple[Colour, ...] = (RED, BLUE, GREEN, ORANGE, PURPLE, TEAL, BROWN, PINK)


def heat_palette() -> NDArray[np.uint8]:
    """Return 256 colours (256, 3) from white over yellow and red to near black, ever darker."""
    stops = [0, 70, 140, 200, 255]
    anchors = [(255, 255, 255), (110, 215, 255), (50, 110, 245), (60, 25, 160), (35, 5, 45)]
    channels = [np.interp(np.arange(256), stops, values) for values in zip(*anchors, strict=True)]
    return np.asarray(np.rint(np.stack(channels, axis=-1)), dtype=np.uint8)


def colour_of_map(index: int) -> Colour:
    """Return the colour of a map and its robot, counted from 0; from the eighth on colours come again."""
    return MAP_COLOURS[index % len(MAP_COLOURS)]
