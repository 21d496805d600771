"""``graphml``: the search tree of a run as a graph that other programs read."""

from pathlib import Path
from typing import Final

import networkx as nx

from feasibility.constants import MJD2000_MJD
from feasibility.errors import InputError
from feasibility.orbits import Catalogue
from feasibility.runtime.atomic import atomic_path
from seqsearch.core.tree import SearchTree
from seqsearch.problems.problem_file import build_problem, read_config, with_catalogue
from seqsearch.runs.checkpoint import FOLDER, Checkpoints, catalogue_digest
from seqsearch.runs.run_folder import CONFIG
from seqsearch.tours.dates import date_of

GRAPHML: Final = "graphml"
"""What the command line calls the format."""


def write_graphml(run: Path, path: Path, catalogue: str | None = None) -> int:
    """Write the search tree of a run as GraphML and return the number of nodes.

    A node is a body, an epoch and a mass: ``body_id``, ``name`` and ``row`` of the asteroid
    table, ``epoch_mjd`` and ``date`` of the arrival (of a start, its epoch), ``mass_kg``,
    ``rank``, and ``best``, 1 on the way to the best node. An edge is a flown hop: ``legs``,
    ``departure_mjd``, ``tof_days``, ``m0_kg``, ``m_final_kg`` and the least ``margin``.

    Parameters
    ----------
    run : Path
        A run folder with checkpoints.
    path : Path
        The file.
    catalogue : str, optional
        Where the asteroid table is now.

    Raises
    ------
    InputError
        No checkpoints, the asteroid table is not where the run says or not the same, or the
        file cannot be written.
    """
    if not (run / FOLDER).is_dir():
        raise InputError(f"{run}: has no {FOLDER}, and {GRAPHML} writes the search tree in them")
    checkpoints, state = Checkpoints.load(run)
    config = read_config(str(run / CONFIG))
    if catalogue is not None:
        config = with_catalogue(config, catalogue)
    table = build_problem(config).catalogue
    if catalogue_digest(table) != checkpoints.origin.catalogue_sha256:
        raise InputError(f"{table.source}: not the asteroid table that {run} was begun with")
    graph = _plain_graph(state.tree, table, state.best_node)
    with atomic_path(path) as temporary:
        nx.write_graphml(graph, temporary, encoding="utf-8")
    return int(graph.number_of_nodes())


def _plain_graph(tree: SearchTree, table: Catalogue, best_node: int) -> "nx.DiGraph[int]":
    graph: nx.DiGraph[int] = nx.DiGraph()
    on_the_way = _ancestors(tree, best_node)
    for node, at in tree.graph.nodes(data=True):
        graph.add_node(
            node,
            body_id=int(table.ids[at["row"]]),
            name=_xml_text(table.names[at["row"]]),
            row=int(at["row"]),
            rank=int(at["rank"]),
            epoch_mjd=float(at["t_mjd2000"]) + MJD2000_MJD,
            date=date_of(float(at["t_mjd2000"])),
            mass_kg=float(at["mass"]),
            best=int(node in on_the_way),
        )
    for parent, node, legs in tree.graph.edges(data="legs"):
        graph.add_edge(
            parent,
            node,
            legs=len(legs),
            departure_mjd=legs[0].t_dep_mjd2000 + MJD2000_MJD,
            tof_days=legs[-1].t_arr_mjd2000 - legs[0].t_dep_mjd2000,
            m0_kg=float(legs[0].m0),
            m_final_kg=float(legs[-1].m_final),
            margin=float(min(leg.m_star / leg.m0 for leg in legs)),
        )
    return graph


def _ancestors(tree: SearchTree, node: int) -> set[int]:
    """Return a node and those that lead to it; none for -1."""
    found: set[int] = set()
    while node >= 0:
        found.add(node)
        node = next(iter(tree.graph.predecessors(node)), -1)
    return found


def _xml_text(text: str) -> str:
    """Return a text without the characters that XML forbids."""
    return "".join(c for c in text if c.isprintable())
