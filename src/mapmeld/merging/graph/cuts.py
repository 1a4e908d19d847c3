"""How firmly nodes hang together: minimum cuts of a weighted graph."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from mapmeld.merging.graph.edges import Doubles, Flags, Index

_UNITS = 1000  # flows are counted in whole units of a thousandth
_MOST = 1e4  # stands for infinite: more than a thousand edges together count for less
_TIED = 1_000_000_000  # of what ties several nodes into one, in units


def min_cut(
    count: int, i: Index, j: Index, weight: Doubles, sources: Index, sinks: Index
) -> tuple[float, Flags]:
    """Return the least total weight of edges that part the sources from the sinks, and the sources' side.

    By the maximum flow between the two (Ford and Fulkerson 1956).

    Parameters
    ----------
    count
        Number of nodes.
    i, j, weight
        (m,) edges and their weights, above 0.
    sources, sinks
        Nodes; no node may be both.
    """
    units = np.rint(np.minimum(weight, _MOST) * _UNITS).astype(np.int64)
    s, t = count, count + 1
    tied = np.full(len(sources) + len(sinks), _TIED)
    rows = np.concatenate([i, j, np.full(len(sources), s), sinks])
    cols = np.concatenate([j, i, sources, np.full(len(sinks), t)])
    shape = count + 2, count + 2
    capacity = sparse.csr_array((np.concatenate([units, units, tied]), (rows, cols)), shape)
    capacity.data = np.minimum(capacity.data, _TIED).astype(np.int32)
    found = maximum_flow(capacity, s, t)
    left = (capacity - found.flow).tocsr()
    left.data[left.data < 0] = 0
    left.eliminate_zeros()
    side = np.zeros(count + 2, np.bool_)
    side[breadth_first_order(left, s, return_predecessors=False)] = True
    return found.flow_value / _UNITS, side[:count]


def weakest_cuts(count: int, i: Index, j: Index, weight: Doubles) -> Iterator[tuple[float, Flags]]:
    """Yield, for every connected part of k nodes, k - 1 cuts among which is a least one for any two nodes.

    Each with its weight and one of its sides. Source: Gusfield, "Very simple methods for all pairs
    network flow analysis" (1990).
    """
    labels = sparse.csgraph.connected_components(
        sparse.coo_array((np.ones(len(i)), (i, j)), (count, count)), directed=False
    )[1]
    towards = np.unique(labels, return_index=True)[1][labels]
    for node in range(count):
        if towards[node] == node:
            continue
        value, side = min_cut(count, i, j, weight, np.array([node]), towards[[node]])
        later = np.arange(count) > node
        towards[side & later & (towards == towards[node])] = node
        yield value, side
