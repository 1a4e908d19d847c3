"""docs/json.md lists exactly the fields that are printed."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from running import run, write_maps

DOCUMENT = Path(__file__).parents[2] / "docs" / "json.md"


def documented(schema: str) -> set[str]:
    section = re.search(rf"^## {schema}$(.*?)(?=^## |\Z)", DOCUMENT.read_text(encoding="utf-8"), re.M | re.S)
    assert section is not None
    return set(re.findall(r"^\| `(.+?)` \|", section[1], re.M))


def paths(value: Any, prefix: str = "") -> set[str]:
    """Names as in the document; the settings of a method are the method's own business."""
    if prefix == "parameters":
        return {prefix}
    found = {prefix} if prefix else set()
    if isinstance(value, dict):
        for key, inner in value.items():
            found |= paths(inner, f"{prefix}.{key}" if prefix else key)
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for inner in value:
            found |= paths(inner, f"{prefix}[]")
    return found


def in_short(names: set[str]) -> set[str]:
    """Without the names of mere containers, which the document may list or leave out."""
    return {name for name in names if not any(n.startswith((f"{name}.", f"{name}[]")) for n in names)}


@pytest.mark.parametrize("schema", ["mapmeld.match/1", "mapmeld.merge/1"])
def test_the_document_lists_what_is_printed(tmp_path: Path, schema: str) -> None:
    if schema == "mapmeld.match/1":
        outcome = run("match", *write_maps(tmp_path, "a", "b"), "--json")
    else:
        # One map joins, one is refused with a transform.
        maps = write_maps(tmp_path, "a", "b", "mirrored")
        outcome = run("merge", *maps, "-o", tmp_path / "m.yaml", "--json", "--set", "accept_similarity=0.6")
    printed = json.loads(outcome.out)
    assert printed["schema"] == schema
    assert in_short(paths(printed)) == in_short(documented(schema))
