"""JSON files from others: one object, its numbers finite, whatever goes wrong in one line."""

from __future__ import annotations

import json
import math
from typing import Any, NoReturn

from mapmeld.io import AnyPath, MapFileError
from mapmeld.io.images import open_regular
from mapmeld.io.plain_yaml import short

MAX_JSON_BYTES = 1 << 28
"""Largest file that is read."""


def read_object(path: AnyPath) -> dict[str, Any]:
    """Read the object that a JSON file holds.

    Raises
    ------
    MapFileError
        It cannot be read, is too large, not JSON, nested too deep, or no object.
    """
    with open_regular(path) as (file, size):
        if size > MAX_JSON_BYTES:
            raise MapFileError.of(path, f"is too large ({size:,} bytes, {MAX_JSON_BYTES:,} at most)")
        data = file.read(MAX_JSON_BYTES)
    try:
        content = json.loads(data, parse_constant=_no_constant, parse_float=_finite)
    except UnicodeDecodeError:
        raise MapFileError.of(path, "is not JSON (it is not Unicode text)") from None
    except json.JSONDecodeError as error:
        raise MapFileError.of(path, f"is not JSON, in line {error.lineno}: {error.msg}") from None
    except ValueError as error:
        raise MapFileError.of(path, f"is not JSON: {str(error)[:150]}") from None
    except RecursionError:
        raise MapFileError.of(path, "nests its values too deep") from None
    if not isinstance(content, dict):
        raise MapFileError.of(path, "is JSON, but no object, which is what is needed")
    return content


def _no_constant(word: str) -> NoReturn:
    raise ValueError(f"{word} is no number that JSON has")


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{short(text)} is too large a number")
    return number
