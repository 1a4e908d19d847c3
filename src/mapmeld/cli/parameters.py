"""Settings of a method from a YAML file and from ``--set key=value``, checked against its class."""

from __future__ import annotations

import difflib
import re
import types
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from mapmeld.errors import MapmeldError
from mapmeld.io import MapFileError
from mapmeld.io.plain_yaml import Scalar, read_fields, short


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
    owner = f"method {method}"
    given = {} if file is None else _checked(_read(file), chosen.parameters, owner, f"{file}: ")
    given |= changed_settings(settings, chosen.parameters, owner)
    try:
        return chosen.parameters(**given)
    except (ValueError, OverflowError) as error:  # the latter for whole numbers beyond any float
        # Known only once all are together, so it could have come from either.
        problem = str(error)
        problem = problem if len(problem) <= 200 else problem[:197] + "..."  # it may quote the value
        raise ParametersError(f"settings of method {method}: {problem}") from error


def changed_settings(settings: Sequence[str] | None, kind: type[Any], owner: str) -> dict[str, object]:
    """Return what ``key=value`` texts change of a dataclass of settings.

    Parameters
    ----------
    settings
        The texts.
    kind, owner
        The dataclass, and whose settings these are, for messages.

    Raises
    ------
    ParametersError
        A text is not of this form, a key is unknown, or a value of the wrong kind.
    """
    return _checked(_split(settings or (), kind, owner), kind, owner, "--set: ")


def parameters_as_yaml(method: str, parameters: Any, version: str) -> str:
    """Return a file for ``--params`` that sets every setting."""
    import yaml

    settings = yaml.safe_dump(asdict(parameters), sort_keys=False, allow_unicode=True)
    return f"# Settings of method {method}, mapmeld {version}; read by --params\n{settings}"


def _split(settings: Sequence[str], kind: type[Any], owner: str) -> dict[str, str]:
    given: dict[str, str] = {}
    for setting in settings:
        key, equals, value = setting.partition("=")
        if not (key.strip() and equals):
            defaults = ", ".join(f"{key}={value}" for key, value in asdict(kind()).items())
            raise ParametersError(
                f"--set needs KEY=VALUE, not {short(setting)}; {owner} has, by default, {defaults}"
            )
        given[key.strip()] = value.strip()
    return given


def _read(file: Path) -> dict[str, str]:
    """Return the settings in a file as texts, which is how --set gives them."""
    try:
        found = read_fields(file, "a file of settings", depth=1, may_be_empty=True)
    except MapFileError as error:
        raise ParametersError(str(error)) from error
    return {key: value.value for key, value in found.items() if isinstance(value, Scalar)}


def _checked(given: Mapping[str, str], kind: type[Any], owner: str, source: str) -> dict[str, object]:
    known = get_type_hints(kind)
    names = [field.name for field in fields(kind)]
    values: dict[str, object] = {}
    for key, value in given.items():
        if key not in names:
            near = difflib.get_close_matches(key[:100], names, n=3, cutoff=0.5)
            hint = f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(names)}"
            raise ParametersError(f"{source}{owner} has no setting {short(key)}; {hint}")
        try:
            values[key] = _converted(value, known[key])
        except ValueError as error:
            raise ParametersError(f"{source}{key} must be {error}, not {short(value)}") from None
    return values


_FLAGS = {"true": True, "yes": True, "on": True, "false": False, "no": False, "off": False}


def _converted(text: str, kind: Any) -> object:
    """Return what a text says as `kind`.

    Raises
    ------
    ValueError
        With the name of the kind that is needed, as in "a whole number".
    """
    origin = get_origin(kind)
    if origin in (Union, types.UnionType):
        return _first_that_fits(text, get_args(kind))
    if origin is Literal:
        for choice in get_args(kind):
            if text == str(choice):
                return choice
        raise ValueError("one of " + ", ".join(map(str, get_args(kind))))
    word = text.strip().lower()
    if kind is type(None):
        if word in ("none", "null", "~", ""):
            return None
        raise ValueError("none")
    if kind is bool:
        if word in _FLAGS:
            return _FLAGS[word]
        raise ValueError("true or false")
    if kind is str:
        return text
    if kind in (int, float):
        try:
            # YAML writes .inf and .nan.
            return kind(re.sub(r"^([-+]?)\.(?=inf$|nan$)", r"\1", word))
        except (ValueError, OverflowError):
            raise ValueError("a whole number" if kind is int else "a number") from None
    raise ValueError("set from Python")


def _first_that_fits(text: str, kinds: Sequence[Any]) -> object:
    problems = []
    # None first: an empty text is no number, but may be none.
    for kind in sorted(kinds, key=lambda k: k is not type(None)):
        try:
            return _converted(text, kind)
        except ValueError as error:
            problems.append(str(error))
    raise ValueError(" or ".join(problems))
