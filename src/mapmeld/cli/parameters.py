"""Settings of a method from a YAML file and from ``--set key=value``, checked against its class."""

from __future__ import annotations

import difflib
import types
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Union, get_args, get_origin, get_type_hints

from mapmeld.errors import MapmeldError

if TYPE_CHECKING:
    from mapmeld.matching import Method


class ParametersError(MapmeldError):
    """A setting that does not exist or cannot have that value."""


def effective_parameters(method: str, file: Path | None, settings: Sequence[str] | None) -> Any:
    """Return the settings of a method: its defaults, changed by the file, changed by ``key=value`` texts.

    Raises
    ------
    ParametersError
        The file cannot be read, a key is unknown (the message names the nearest ones), a value is of
        the wrong kind or out of range.
    UnknownMethodError
        There is no such method.
    """
    from mapmeld.matching.match import method_named

    chosen = method_named(method)
    given = {} if file is None else _checked(_read(file), chosen, method, f"{file}: ")
    given |= _checked(_split(settings or ()), chosen, method, "--set: ")
    try:
        return chosen.parameters(**given)
    except ValueError as error:
        # Known only once all are together, so it could have come from either.
        raise ParametersError(f"settings of method {method}: {error}") from error


def parameters_as_yaml(method: str, parameters: Any, version: str) -> str:
    """Return a file for ``--params`` that sets every setting."""
    import yaml

    settings = yaml.safe_dump(asdict(parameters), sort_keys=False, allow_unicode=True)
    return f"# Settings of method {method}, mapmeld {version}; read by --params\n{settings}"


def _split(settings: Sequence[str]) -> dict[str, object]:
    given: dict[str, object] = {}
    for setting in settings:
        key, equals, value = setting.partition("=")
        if not (key.strip() and equals):
            raise ParametersError(f"--set needs KEY=VALUE, not {setting!r}")
        given[key.strip()] = value.strip()
    return given


def _read(file: Path) -> Mapping[object, object]:
    import yaml

    try:
        content = yaml.safe_load(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise ParametersError(f"{file}: cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise ParametersError(f"{file}: is not a text file in UTF-8") from error
    except (yaml.YAMLError, ValueError) as error:  # ValueError: a date that does not exist
        mark = getattr(error, "problem_mark", None)
        where = f" (line {mark.line + 1})" if mark else ""
        raise ParametersError(
            f"{file}: is not valid YAML{where}: {getattr(error, 'problem', None) or error}"
        ) from error
    if content is None:
        return {}
    if not isinstance(content, dict):
        raise ParametersError(f"{file}: must hold lines of 'setting: value'")
    return content


def _checked(given: Mapping[Any, object], chosen: Method, method: str, source: str) -> dict[str, object]:
    known = get_type_hints(chosen.parameters)
    names = [field.name for field in fields(chosen.parameters)]
    values: dict[str, object] = {}
    for key, value in given.items():
        if key not in names:
            near = difflib.get_close_matches(str(key), names, n=3, cutoff=0.5)
            hint = f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(names)}"
            raise ParametersError(f"{source}method {method} has no setting {str(key)!r}; {hint}")
        try:
            values[key] = _converted(value, known[key])
        except ValueError as error:
            raise ParametersError(f"{source}{key} must be {error}, not {value!r}") from None
    return values


def _converted(value: object, kind: Any) -> object:
    """Return the value as `kind`; a text is read as one.

    Raises
    ------
    ValueError
        With the name of the kind that is needed, as in "a whole number".
    """
    origin = get_origin(kind)
    if origin in (Union, types.UnionType):
        return _first_that_fits(value, get_args(kind))
    if origin is Literal:
        if value in get_args(kind):
            return value
        raise ValueError("one of " + ", ".join(map(str, get_args(kind))))
    text = value.strip().lower() if isinstance(value, str) else None
    if kind is type(None):
        if value is None or text in ("none", "null", ""):
            return None
        raise ValueError("none")
    if kind is bool:
        if isinstance(value, bool):
            return value
        if text in ("true", "false", "yes", "no"):
            return text in ("true", "yes")
        raise ValueError("true or false")
    if kind is str:
        if isinstance(value, str):
            return value
        raise ValueError("a text")
    if kind in (int, float):
        return _number(value, kind)
    raise ValueError("set from Python")


def _number(value: object, kind: type[int] | type[float]) -> int | float:
    name = "a whole number" if kind is int else "a number"
    fits = (int, str) if kind is int else (int, float, str)
    if isinstance(value, bool) or not isinstance(value, fits):
        raise ValueError(name)
    try:
        return kind(value)
    except (ValueError, OverflowError):
        raise ValueError(name) from None


def _first_that_fits(value: object, kinds: Sequence[Any]) -> object:
    problems = []
    # None first: an empty text is no number, but may be none.
    for kind in sorted(kinds, key=lambda k: k is not type(None)):
        try:
            return _converted(value, kind)
        except ValueError as error:
            problems.append(str(error))
    raise ValueError(" or ".join(problems))
