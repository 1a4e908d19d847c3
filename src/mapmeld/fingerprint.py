"""What an answer depends on, as short texts: the maps, the settings, the code."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, is_dataclass
from functools import cache
from importlib import import_module
from pathlib import Path

from mapmeld.grid import OccupancyGrid


def grid_digest(grid: OccupancyGrid) -> bytes:
    """Return 16 bytes that differ as soon as cells, resolution or origin of a map do."""
    digest = hashlib.blake2b(repr((grid.shape, grid.resolution, grid.origin)).encode(), digest_size=16)
    digest.update(grid.cells.tobytes())
    return digest.digest()


def parameters_json(settings: object) -> str:
    """Return settings of a method as JSON with sorted keys."""
    plain = asdict(settings) if is_dataclass(settings) and not isinstance(settings, type) else repr(settings)
    return json.dumps(plain, sort_keys=True, default=str)


@cache
def code_version(*rooms: str) -> str:
    """Return mapmeld's version with a fingerprint of all that a matcher's answer depends on.

    In a version that is being worked on, answers of yesterday's code must not pass for today's.

    Parameters
    ----------
    rooms
        Further files and folders of the package that the answer depends on.
    """
    home = Path(__file__).parent
    files = [home / "grid.py", home / "se2.py"]
    for room in ("matching", *rooms):
        files += [home / room] if (home / room).is_file() else list((home / room).rglob("*"))
    digest = hashlib.blake2b(digest_size=5)
    for file in sorted(f for f in files if f.is_file() and f.suffix in (".py", ".json")):
        digest.update(file.relative_to(home).as_posix().encode() + b"\0" + file.read_bytes() + b"\0")
    # Not imported above: the package itself names what lies over this module.
    return f"{import_module('mapmeld').__version__}+{digest.hexdigest()}"
