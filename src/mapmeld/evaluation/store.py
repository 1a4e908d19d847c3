"""Where a running benchmark keeps its rows (`mapmeld.parquet_rows`)."""

from __future__ import annotations

from mapmeld.evaluation.rows import TrialRow
from mapmeld.parquet_rows import RowStore, StoreError

__all__ = ["StoreError", "add_rows", "clear_rows", "gather_rows", "read_rows"]

_STORE = RowStore(TrialRow, "benchmark")
read_rows = _STORE.read
add_rows = _STORE.add
gather_rows = _STORE.gather
clear_rows = _STORE.clear
