"""`Context`: what every experiment gets."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility.learning.paper.feature_ranking import rank_features
from feasibility.study.cells import Cells, Key
from feasibility.study.data import StudyData
from feasibility.study.presets import Preset


@final
@dataclass(frozen=True, eq=False)
class Context:
    """A study: its sizes, data, cells and folder.

    Attributes
    ----------
    preset : Preset
        Sizes, seeds and trials.
    data : StudyData
        Features, labels, split.
    cells : Cells
        What was computed before.
    out : Path
        Folder of the study.
    workers : int
        Processes of what runs in parallel.
    threads : int
        Threads of a network's training.
    device : str
        Where networks are trained: "cpu", "cuda" or "auto".
    precision : str
        In what they are trained: "float32", "bfloat16" or "auto".
    say : callable
        Told what is going on, a line at a time.
    """

    preset: Preset
    data: StudyData
    cells: Cells
    out: Path
    workers: int
    threads: int
    device: str
    precision: str
    say: Callable[[str], None]

    def cell_key(self, **settings: object) -> Key:
        """Return the key of a cell: the settings and the data."""
        return {"data": self.data.fingerprint, **settings}

    @functools.cached_property
    def importances(self) -> NDArray[np.float64]:
        """(s, 103) importance of each feature (equation 6) in each of s ranking forests."""
        return np.array([self._importance(seed) for seed in range(self.preset.ranking_seeds)])

    @functools.cached_property
    def ranking(self) -> NDArray[np.int64]:
        """(103,) columns by falling mean importance."""
        return np.argsort(-self.importances.mean(axis=0), kind="stable").astype(np.int64)

    def columns(self, n_features: int) -> NDArray[np.int64]:
        """Return the columns of the first `n_features` of the ranking."""
        return self.ranking[:n_features]

    def _importance(self, seed: int) -> list[float]:
        data = self.data

        def compute() -> list[float]:
            rng = np.random.default_rng([seed])
            _, importance = rank_features(data.X[data.pool], data.y[data.pool], rng)
            return [float(value) for value in importance]

        key = self.cell_key(kind="importance", seed=seed)
        values: list[float] = self.cells.get(f"importance-seed{seed}", key, compute)
        return values
