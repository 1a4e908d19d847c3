"""An index of many maps: which of them may show the same place as a map, without matching it with all."""

from mapmeld.index.building import Built, build_index, map_files
from mapmeld.index.entries import IndexedMap, MapIndex, MapIndexError
from mapmeld.index.finding import Candidate, candidates_for, find
from mapmeld.index.index_file import is_index, read_index, write_index
from mapmeld.index.ranking import Ranking, likely_pairs
from mapmeld.index.signature import Signature, signature_of

__all__ = [
    "Built",
    "Candidate",
    "IndexedMap",
    "MapIndex",
    "MapIndexError",
    "Ranking",
    "Signature",
    "build_index",
    "candidates_for",
    "find",
    "is_index",
    "likely_pairs",
    "map_files",
    "read_index",
    "signature_of",
    "write_index",
]
