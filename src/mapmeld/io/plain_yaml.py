"""YAML files from others that need hold no more than ``key: value`` lines, taken from the parser's events.

Nothing in such a file is ever built into an object and no alias expanded, so that a small file can
neither run anything nor grow without end; what is too large or too deep stops the reading at once.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn, TypeVar

from mapmeld.io import AnyPath, MapFileError
from mapmeld.io.images import open_regular

if TYPE_CHECKING:
    import yaml

Built = TypeVar("Built")

MAX_YAML_BYTES = 1 << 16
"""Largest YAML file that is read; map_server writes about 150 bytes."""

MAX_YAML_DEPTH = 20
"""Deepest nesting that is read; the parser's time grows with the square of it."""


@dataclass(frozen=True, slots=True)
class Scalar:
    """A single value as it is written in the file, and whether in quotes (or as a block of text)."""

    value: str
    quoted: bool


class Nested:
    """Stands for a value that no field has."""


@dataclass(frozen=True, slots=True)
class Fields(Nested):
    """A mapping as a value: its keys, each once, and what they stand for."""

    of: dict[str, Scalar | Nested]


Value = Scalar | list["Scalar | Nested"] | Nested

Tree = Scalar | list["Tree"] | dict[str, "Tree"]
"""A value with all that is nested in it."""


def short(text: str) -> str:
    """Return a text in quotes, cut to what fits into a message."""
    return repr(text if len(text) <= 40 else text[:37] + "...")


def read_fields(
    path: AnyPath, what: str, *, depth: int = MAX_YAML_DEPTH, may_be_empty: bool = False
) -> dict[str, Value]:
    """Read the mapping that a YAML file holds; a second document after it is not looked at.

    Parameters
    ----------
    path
        The file.
    what
        What it is, for messages: "the YAML file of a map".
    depth
        Deepest nesting that is read; 1 is a mapping of single values.
    may_be_empty
        Give an empty mapping for a file without any value, instead of refusing it.

    Raises
    ------
    MapFileError
        The file cannot be read, is over `MAX_YAML_BYTES`, is not YAML, not a mapping with
        plain words as keys (each once), has anchors, aliases or tags, or is nested too deep.
    """
    return _Reader(path, what, depth, MAX_YAML_BYTES).fields(may_be_empty)


def read_tree(path: AnyPath, what: str, *, depth: int, max_bytes: int) -> dict[str, Tree]:
    """Read the mapping that a YAML file holds with all that is nested in it.

    Parameters
    ----------
    path, what, depth
        As for `read_fields`.
    max_bytes
        Largest file that is read.

    Raises
    ------
    MapFileError
        As `read_fields`; every mapping must have plain words as keys, each once, and there must be no
        second document.
    """
    return _Reader(path, what, depth, max_bytes).tree()


@dataclass(frozen=True, slots=True)
class _Reader:
    path: AnyPath
    what: str
    depth: int
    max_bytes: int

    def fail(self, problem: str) -> NoReturn:
        raise MapFileError.of(self.path, problem)

    def fields(self, may_be_empty: bool) -> dict[str, Value]:
        return self._built(self._mapping, may_be_empty)

    def tree(self) -> dict[str, Tree]:
        return self._built(self._whole_mapping, False)

    def _built(
        self, build: Callable[[Iterator[yaml.Event]], dict[str, Built] | None], may_be_empty: bool
    ) -> dict[str, Built]:
        import yaml

        with open_regular(self.path, may_be_empty=may_be_empty) as (file, size):
            if size > self.max_bytes:
                self.fail(f"is too large for {self.what} ({size:,} bytes, {self.max_bytes:,} at most)")
            data = file.read(self.max_bytes)
        try:
            text = data.decode("utf-8")
        except UnicodeDecodeError:
            self.fail(f"is not {self.what} (it is not UTF-8 text)")
        try:
            found = build(self._harmless(yaml.parse(text, Loader=yaml.SafeLoader)))
        except yaml.MarkedYAMLError as error:
            where = f" in line {error.problem_mark.line + 1}" if error.problem_mark else ""
            problem = str(error.problem or error.context)
            hint = " (YAML takes spaces, not tabs)" if "\\t" in problem else ""
            self.fail(f"is not valid YAML{where}: {problem[:150]}{hint}")
        # Characters and versions with numbers out of range get past the parser's own errors.
        except (yaml.YAMLError, ValueError, OverflowError) as error:
            self.fail(f"is not valid YAML: {' '.join(str(error).split())[:150]}")
        if found is None and not may_be_empty:
            self.fail(f"is not {self.what} (it has no 'key: value' lines)")
        return found or {}

    def _begun(self, events: Iterator[yaml.Event]) -> bool:
        """Read up to the first field; return whether there is any value at all."""
        import yaml

        first = next((event for event in events if isinstance(event, yaml.NodeEvent)), None)
        if first is None or (isinstance(first, yaml.ScalarEvent) and not first.value and not first.style):
            return False
        if not isinstance(first, yaml.MappingStartEvent):
            self.fail(f"is not {self.what} (it has no 'key: value' lines)")
        return True

    def _whole_mapping(self, events: Iterator[yaml.Event]) -> dict[str, Tree] | None:
        import yaml

        if not self._begun(events):
            return None
        values = self._rest_of_mapping(events)
        for event in events:
            if isinstance(event, yaml.NodeEvent):
                self.fail(f"holds a second document, from line {_line(event)} on; put all into one")
        return values

    def _rest_of_mapping(self, events: Iterator[yaml.Event]) -> dict[str, Tree]:
        import yaml

        values: dict[str, Tree] = {}
        while not isinstance(event := next(events), yaml.MappingEndEvent):
            key = self._key(event, values)
            values[key] = self._tree_of(next(events), events)
        return values

    def _tree_of(self, event: yaml.Event, events: Iterator[yaml.Event]) -> Tree:
        import yaml

        if isinstance(event, yaml.ScalarEvent):
            return Scalar(event.value, quoted=event.style is not None)
        if isinstance(event, yaml.MappingStartEvent):
            return self._rest_of_mapping(events)
        items: list[Tree] = []
        while not isinstance(event := next(events), yaml.SequenceEndEvent):
            items.append(self._tree_of(event, events))
        return items

    def _key(self, event: yaml.Event, values: Collection[str]) -> str:
        import yaml

        if not isinstance(event, yaml.ScalarEvent):
            self.fail(f"has a key that is no plain word, in line {_line(event)}")
        if event.value in values:
            self.fail(f"gives {short(event.value)} twice, in line {_line(event)} again")
        return str(event.value)

    def _mapping(self, events: Iterator[yaml.Event]) -> dict[str, Value] | None:
        """Return the fields; None if the file holds no value at all."""
        import yaml

        if not self._begun(events):
            return None
        values: dict[str, Value] = {}
        for event in events:
            if isinstance(event, yaml.MappingEndEvent):
                break  # what follows, such as a second document, is not read, as in nav2
            key = self._key(event, values)
            values[key] = self._value(events)
        return values

    def _value(self, events: Iterator[yaml.Event]) -> Value:
        import yaml

        event = next(events)
        if isinstance(event, yaml.ScalarEvent):
            return Scalar(event.value, quoted=event.style is not None)
        items: list[Scalar | Nested] = []
        is_list = isinstance(event, yaml.SequenceStartEvent)
        depth = 1
        while depth:
            event = next(events)
            if isinstance(event, yaml.CollectionStartEvent):
                depth += 1
                items.append(Nested())
            elif isinstance(event, yaml.CollectionEndEvent):
                depth -= 1
            elif depth == 1 and isinstance(event, yaml.ScalarEvent):
                items.append(Scalar(event.value, quoted=event.style is not None))
        return items if is_list else self._fields(items, event)

    def _fields(self, items: list[Scalar | Nested], event: yaml.Event) -> Nested:
        values: dict[str, Scalar | Nested] = {}
        for key, value in zip(items[::2], items[1::2], strict=True):
            if not isinstance(key, Scalar):
                return Nested()
            if key.value in values:
                self.fail(f"gives {short(key.value)} twice before line {_line(event)}")
            values[key.value] = value
        return Fields(values)

    def _harmless(self, events: Iterator[yaml.Event]) -> Iterator[yaml.Event]:
        """Refuse what could multiply (aliases), make objects (tags) or keep the parser busy (depth)."""
        import yaml

        depth = 0
        for event in events:
            if isinstance(event, yaml.NodeEvent) and event.anchor is not None:
                self.fail(
                    f"uses a YAML anchor or alias in line {_line(event)}, which {self.what} has no need of"
                )
            tag = getattr(event, "tag", None) if isinstance(event, yaml.NodeEvent) else None
            if tag is not None:
                self.fail(
                    f"uses the YAML tag {short(tag)} in line {_line(event)}, which {self.what} has no need of"
                )
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if depth > self.depth:
                self.fail(f"nests {_levels(self.depth)} in line {_line(event)}, which {self.what} never does")
            yield event


def _levels(depth: int) -> str:
    return "values in one another" if depth == 1 else f"more than {depth} levels deep"


def _line(event: yaml.Event) -> int:
    return event.start_mark.line + 1 if event.start_mark else 1
