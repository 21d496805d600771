"""Which tours of a search are worth polishing: the best, and not all the same."""

import numpy as np

from seqsearch.core.problem import Problem
from seqsearch.core.recording import record_tour
from seqsearch.core.tree import SearchTree
from seqsearch.tours.tour import Tour

_LARGEST_SHARE_ALIKE = 0.7
"""Of two tours with more than this share of bodies in common, one is enough."""


def distinct_tours(problem: Problem, tree: SearchTree, count: int) -> list[Tour]:
    """Return the best tours of a search tree that differ in a good part of their bodies.

    Parameters
    ----------
    problem : Problem
        The problem that was searched.
    tree : SearchTree
        Its tree.
    count : int
        Tours wanted; there may be fewer.

    Returns
    -------
    list of Tour
        Most bodies first, then least duration; all of them within one body of the best.
    """
    graph = tree.graph
    depth = max((tree.rank(node) for node in graph), default=0)
    ends = [node for node in graph if depth > 0 and tree.rank(node) >= max(depth - 1, 1)]
    durations = {}
    for node in ends:
        legs = tree.legs_to(node)
        durations[node] = legs[-1].t_arr_mjd2000 - legs[0].t_dep_mjd2000
    chosen: list[Tour] = []
    bodies: list[set[int]] = []
    for node in sorted(ends, key=lambda node: (-tree.rank(node), durations[node], node)):
        rows = {leg.dep_row for leg in tree.legs_to(node)} | {int(tree.node(node)["row"])}
        alike = [len(rows & other) / len(rows) for other in bodies]
        if np.max(alike, initial=0.0) > _LARGEST_SHARE_ALIKE:
            continue
        chosen.append(record_tour(problem, tree, node))
        bodies.append(rows)
        if len(chosen) == count:
            break
    return chosen
