"""An earlier map and a later one, of the same floor in another frame with other furniture, as files."""

from functools import cache
from pathlib import Path

from drawing import office, seen_from
from running import T_B_A

from mapmeld.grid import OCCUPIED, OccupancyGrid
from mapmeld.io import save

# x0, y0, x1, y1 [m] in the earlier map's frame.
CAME, WENT = (1.0, 9.0, 2.2, 9.6), (6.0, 4.0, 6.4, 5.0)


@cache
def _grids() -> tuple[OccupancyGrid, OccupancyGrid]:
    grids = []
    for x0, y0, x1, y1 in (WENT, CAME):
        cells = office().cells.copy()
        cells[round(y0 / 0.05) : round(y1 / 0.05), round(x0 / 0.05) : round(x1 / 0.05)] = OCCUPIED
        grids.append(OccupancyGrid(cells, 0.05))
    return grids[0], seen_from(grids[1], T_B_A, 0.04)


def write_old_and_new(folder: Path) -> tuple[Path, Path]:
    for name, grid in zip(("old", "new"), _grids(), strict=True):
        save(grid, folder / f"{name}.yaml")
    return folder / "old.yaml", folder / "new.yaml"
