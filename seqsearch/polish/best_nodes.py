"""The best nodes of a search tree that lead to different sets of bodies."""

from seqsearch.core.problem import TourProblem
from seqsearch.core.tree import SearchTree


def best_nodes(tree: SearchTree, problem: TourProblem, count: int) -> list[int]:
    """Return at most `count` nodes, no two of which visited the same bodies, best first.

    A node is better with more visits, and among those with equally many with a
    smaller sum of the shares of time and propellant that are used up.

    Parameters
    ----------
    tree : SearchTree
        All nodes.
    problem : TourProblem
        How much time and propellant there is.
    count : int
        How many nodes are wanted.
    """
    by_rank: dict[int, list[int]] = {}
    for node, rank in tree.graph.nodes(data="rank"):
        by_rank.setdefault(rank, []).append(node)
    propellant = problem.m0 - problem.spacecraft.m_dry
    chosen: list[int] = []
    for rank in sorted(by_rank, reverse=True):
        ranked = []
        for node in by_rank[rank]:
            legs = tree.legs_to(node)
            end = tree.node(node)
            start_days = legs[0].t_dep_mjd2000 if legs else end["t_mjd2000"]
            used = (end["t_mjd2000"] - start_days) / problem.max_duration_days
            used += (problem.m0 - end["mass"]) / propellant
            bodies = frozenset([leg.dep_row for leg in legs] + [end["row"]])
            ranked.append((used, node, bodies))
        seen = set()
        for _, node, bodies in sorted(ranked, key=lambda entry: entry[:2]):
            if bodies in seen:
                continue
            seen.add(bodies)
            chosen.append(node)
            if len(chosen) == count:
                return chosen
    return chosen
