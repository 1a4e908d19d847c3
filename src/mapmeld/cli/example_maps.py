"""Where the example maps are: inside an installed package, or in the checkout it is imported from."""

from __future__ import annotations

from pathlib import Path

import mapmeld
from mapmeld.errors import MapmeldError


class ExamplesError(MapmeldError):
    """The example maps did not come with this installation."""


def example_map(name: str) -> Path:
    """Return the path of an example file such as ``robot_1.yaml``.

    Raises
    ------
    ExamplesError
        It is nowhere to be found.
    """
    package = Path(mapmeld.__file__).resolve().parent
    for folder in (package / "examples", package.parents[1] / "examples" / "maps"):
        if (folder / name).is_file():
            return folder / name
    raise ExamplesError(f"the example map {name} is not part of this installation; reinstall mapmeld")
