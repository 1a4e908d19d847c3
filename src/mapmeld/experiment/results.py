"""All rows of an experiment, read back."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from mapmeld.experiment.folder import (
    ELSEWHERE,
    ENVIRONMENTS,
    JOINS,
    MAPPINGS,
    MATCHINGS,
    NAVIGABILITY,
    SETTINGS,
    read_row,
    stage_times,
)
from mapmeld.experiment.rows import (
    ElsewhereRow,
    EnvironmentRow,
    JoinRow,
    MappingRow,
    MatchingRow,
    NavigabilityRow,
)
from mapmeld.io.plain_json import read_object

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    Row = TypeVar("Row", bound=DataclassInstance)


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """What an experiment came to, in the order of environments and mappings.

    Attributes
    ----------
    settings
        As they are kept: with the version of the code.
    methods
        Their names, in the order in which they were asked for.
    wall_seconds
        By stage, over all runs.
    """

    settings: dict[str, Any]
    methods: tuple[str, ...]
    environments: tuple[EnvironmentRow, ...]
    mappings: tuple[MappingRow, ...]
    matchings: tuple[MatchingRow, ...]
    joins: tuple[JoinRow, ...]
    elsewhere: tuple[ElsewhereRow, ...]
    ways: tuple[NavigabilityRow, ...]
    wall_seconds: dict[str, float]

    def matchings_of(self, method: str) -> list[MatchingRow]:
        """Return a method's matchings."""
        return [row for row in self.matchings if row.method == method]

    def mapping(self, environment: int, mapping: int) -> MappingRow:
        """Return the row of a mapping."""
        return next(r for r in self.mappings if (r.environment, r.mapping) == (environment, mapping))


def read_results(root: Path) -> Results:
    """Read what is done of an experiment.

    Raises
    ------
    MapFileError, ExperimentError
        A file cannot be read, or is damaged.
    """
    settings = read_object(root / SETTINGS)
    return Results(
        settings=settings,
        methods=tuple(settings["methods"]),
        environments=_rows(root / ENVIRONMENTS, "*/environment.json", EnvironmentRow),
        mappings=_rows(root / MAPPINGS, "*/mapping.json", MappingRow),
        matchings=_rows(root / MATCHINGS, "*/*.json", MatchingRow),
        joins=_rows(root / JOINS, "*/*.json", JoinRow),
        elsewhere=_rows(root / ELSEWHERE, "*/*.json", ElsewhereRow),
        ways=_rows(root / NAVIGABILITY, "*/*.json", NavigabilityRow),
        wall_seconds=stage_times(root),
    )


def _rows(folder: Path, pattern: str, kind: type[Row]) -> tuple[Row, ...]:
    return tuple(read_row(path, kind) for path in sorted(folder.glob(pattern)))
