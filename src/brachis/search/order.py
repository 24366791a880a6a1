"""The best orders in which to visit groups of nodes, exactly, by dynamic programming over subsets.

M. Held and R. M. Karp, A dynamic programming approach to sequencing problems, Journal of the Society for Industrial and
Applied Mathematics 10(1), 1962. Of each group one node is visited: a seam has several joint paths.
"""

from __future__ import annotations

import numpy as np


def find_orders(
    prices: np.ndarray,
    first: np.ndarray,
    last: np.ndarray,
    groups: np.ndarray,
    count: int,
) -> list[tuple[float, list[int]]]:
    """Find the cheapest ways through one node of every group.

    Parameters
    ----------
    prices : (N, N) ndarray
        Price of going from one node to another.
    first, last : (N,) ndarray
        Prices of beginning with a node and of ending with it.
    groups : (N,) int ndarray
        Group of every node, from 0 on.
    count : int
        Maximum number of ways. They end with different nodes.

    Returns
    -------
    list of (float, list of int)
        Price and nodes of each way, the cheapest first.
    """
    total = int(groups.max()) + 1
    members = [np.flatnonzero(groups == group) for group in range(total)]
    everything = (1 << total) - 1
    costs = np.full((everything + 1, len(groups)), np.inf)
    before = np.full(costs.shape, -1)
    for group, nodes in enumerate(members):
        costs[1 << group, nodes] = first[nodes]
    for visited in range(1, everything):
        reached = np.flatnonzero(np.isfinite(costs[visited]))
        for group, nodes in enumerate(members):
            if visited >> group & 1 or not len(reached):
                continue
            ways = costs[visited, reached, None] + prices[np.ix_(reached, nodes)]
            best = ways.argmin(axis=0)
            more = visited | 1 << group
            costs[more, nodes] = ways[best, np.arange(len(nodes))]
            before[more, nodes] = reached[best]
    whole = costs[everything] + last
    found = []
    for end in np.argsort(whole, kind="stable")[:count]:
        if not np.isfinite(whole[end]):
            break
        way = [int(end)]
        visited = everything
        while before[visited, way[-1]] >= 0:
            previous = int(before[visited, way[-1]])
            visited &= ~(1 << int(groups[way[-1]]))
            way.append(previous)
        found.append((float(whole[end]), way[::-1]))
    return found
