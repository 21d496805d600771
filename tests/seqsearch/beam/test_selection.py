"""Beam selection: the caps hold, and nothing better was left out."""

from collections import Counter
from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from seqsearch.beam.frontiers.selection import select
from seqsearch.core.nodes import Nodes
from seqsearch.settings import FrontierSettings


def _nodes(rows: list[int], epochs: list[float], middles: list[int], parents: list[int]) -> Nodes:
    n = len(rows)
    row = np.asarray(rows, dtype=np.intp)
    epoch = np.asarray(epochs)
    visited = np.column_stack([np.full(n, 1000), np.asarray(middles, dtype=np.intp), row])
    return Nodes(
        row=row,
        depth=np.full(n, 2),
        t_ready_mjd2000=epoch,
        t_arr_mjd2000=epoch,
        t_first_mjd2000=np.zeros(n),
        mass=np.ones(n),
        visited=visited.astype(np.intp),
        tree_id=np.arange(n),
        parent_id=np.asarray(parents, dtype=np.int64),
    )


_rank = st.integers(1, 60).flatmap(
    lambda n: st.tuples(
        st.lists(st.integers(0, 4), min_size=n, max_size=n),
        st.lists(st.floats(0, 100), min_size=n, max_size=n),
        st.lists(st.integers(10, 14), min_size=n, max_size=n),
        st.lists(st.integers(0, 3), min_size=n, max_size=n),
        st.lists(st.floats(0, 1), min_size=n, max_size=n),
    )
)


@given(_rank, st.integers(1, 10), st.integers(1, 4), st.integers(1, 4))
def test_selection_keeps_every_cap_and_leaves_out_nothing_better(
    rank, beam_width, per_parent, per_cell
):
    rows, epochs, middles, parents, scores = rank
    nodes = _nodes(rows, epochs, middles, parents)
    score = np.asarray(scores)
    settings = FrontierSettings(max_per_parent=per_parent, max_per_cell=per_cell, cell_days=20.0)
    chosen = select(score, nodes, settings, beam_width)

    def keys(i):
        cell = (rows[i], int(epochs[i] // 20.0))
        return ("p", parents[i]), ("c", *cell), ("s", *cell, frozenset((rows[i], middles[i])))

    limits = {"p": per_parent, "c": per_cell, "s": 1}
    counts = Counter(key for i in chosen for key in keys(i))
    assert len(set(chosen)) == len(chosen) <= beam_width
    assert all(count <= limits[key[0]] for key, count in counts.items())
    assert np.all(np.diff(score[chosen]) >= 0)
    for i in set(range(len(rows))) - set(chosen.tolist()):
        better = [j for j in chosen if (score[j], j) < (score[i], i)]
        before = Counter(key for j in better for key in keys(j))
        full = len(better) == beam_width
        assert full or any(before[key] >= limits[key[0]] for key in keys(i))


def test_no_start_body_takes_more_than_its_share():
    rng = np.random.default_rng(5)
    n = 400
    nodes = _nodes(
        rng.integers(0, 60, n).tolist(),
        rng.uniform(0, 1000, n).tolist(),
        rng.integers(100, 200, n).tolist(),
        list(range(n)),
    )
    start = rng.choice([1000, 1001, 1002, 1003, 1004], n, p=[0.8, 0.05, 0.05, 0.05, 0.05])
    visited = nodes.visited.copy()
    visited[:, 0] = start
    nodes = replace(nodes, visited=visited)
    score = np.where(start == 1000, 0.0, 1.0) + rng.random(n)
    wide = FrontierSettings(max_start_share=1.0)
    assert np.all(start[select(score, nodes, wide, 40)] == 1000)
    fair = FrontierSettings(max_start_share=0.25)
    counts = Counter(start[select(score, nodes, fair, 40)].tolist())
    assert counts[1000] == 10
    assert sum(counts.values()) == 40
    tight = FrontierSettings(max_start_share=0.01)
    assert set(Counter(start[select(score, nodes, tight, 40)].tolist()).values()) == {8}


def test_an_empty_rank_gives_an_empty_beam():
    assert len(select(np.zeros(0), _nodes([], [], [], []), FrontierSettings(), 200)) == 0
