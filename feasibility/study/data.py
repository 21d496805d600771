"""`StudyData`: features, labels and the one split that every experiment shares."""

import hashlib
from dataclasses import dataclass
from typing import Final, Self, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.paper.features import FEATURE_SET, FEATURES, paper_features
from feasibility.dataset import Dataset
from feasibility.dataset.splits import pair_ids, split_pairs
from feasibility.errors import InputError
from feasibility.learning.paper.balance import balanced_rows
from feasibility.legs import Legs
from feasibility.study.presets import Preset

N_FOLDS: Final = 5
"""Folds of the training pool; a pair of bodies is in one fold."""

_SPLIT, _BALANCE, _FOLDS, _DRAW = range(4)
"""Streams of random numbers, so that no draw depends on another."""


@final
@dataclass(frozen=True, eq=False)
class StudyData:
    """The legs of a study; n of them, k = 103 features.

    Attributes
    ----------
    dataset : Dataset
        The labelled rows.
    legs : Legs
        n legs.
    X : (n, k) float64
        `paper_features`, not standardised.
    y : (n,) bool
        Whether the leg is flyable: m0 <= m*.
    log_margin : (n,) float64
        log(m* / m0).
    pool : (a,) int64
        Rows that may be learned from.
    folds : (a,) int64
        Fold of each row of the pool, 0 to `N_FOLDS` - 1.
    test : (b,) int64
        Test rows, as many feasible as infeasible ones; no pair of bodies is in both.
    most_judged : int
        Rows that a model is judged by at most, in the test set or in a fold.
    fingerprint : str
        Digest of all the above: cells of other data are never mistaken for these.
    source : str
        Where the legs came from, for the report.
    """

    dataset: Dataset
    legs: Legs
    X: NDArray[np.float64]
    y: NDArray[np.bool_]
    log_margin: NDArray[np.float64]
    pool: NDArray[np.int64]
    folds: NDArray[np.int64]
    test: NDArray[np.int64]
    most_judged: int
    fingerprint: str
    source: str

    @classmethod
    def build(cls, dataset: Dataset, preset: Preset, seed: int) -> Self:
        """Compute features and split.

        Parameters
        ----------
        dataset : Dataset
            Legs labelled by their margin; rows without a label are left out.
        preset : Preset
            Share and size of the test set.
        seed : int
            Seed of the split.

        Raises
        ------
        InputError
            The dataset has the wrong label, or too few legs of a class.
        """
        protocol = dataset.metadata["protocol"]
        if protocol["label"] != "margin":
            raise InputError(
                f"dataset of protocol {protocol['name']}: its label is {protocol['label']!r}, "
                "expected 'margin'; the study computes the paper's own label itself"
            )
        dataset.check_rendezvous("study")
        rows = dataset.take(np.flatnonzero(dataset.labelled))
        X = paper_features(
            rows.legs,
            dt_imp_days=rows.columns["dt_imp_days"],
            lambert_dv=rows.columns["lambert_dv_m_s"],
        )
        log_margin = np.asarray(rows.columns["log_margin"], dtype=np.float64)
        y = log_margin >= 0.0
        pairs = pair_ids(rows.columns["dep_id"], rows.columns["arr_id"])
        shares = [1.0 - preset.test_share, preset.test_share]
        part = split_pairs(pairs, shares, np.random.default_rng([seed, _SPLIT]))
        pool = np.flatnonzero(part == 0)
        held_out = np.flatnonzero(part == 1)
        rng = np.random.default_rng([seed, _BALANCE])
        test = held_out[balanced_rows(y[held_out], rng, most=preset.test_rows)]
        if len(test) < 2 or y[pool].all() or not y[pool].any():
            raise InputError(
                f"dataset of {len(y)} legs, {int(y.sum())} of them flyable: too few of a class "
                "for training and test; expected some tens of either"
            )
        rng = np.random.default_rng([seed, _FOLDS])
        folds = split_pairs(pairs[pool], [1.0 / N_FOLDS] * N_FOLDS, rng)
        catalogue = dataset.metadata["catalogue"]
        return cls(
            dataset=rows,
            legs=rows.legs,
            X=X,
            y=y,
            log_margin=log_margin,
            pool=pool,
            folds=folds,
            test=test,
            most_judged=preset.test_rows,
            fingerprint=_digest(X, y, pool, folds, test),
            source=(
                f"{len(dataset)} legs of protocol {protocol['name']} (seed "
                f"{dataset.metadata['seed']}), {catalogue['bodies']} bodies of "
                f"{catalogue['source'].rpartition('/')[2]}"
            ),
        )

    def draw(
        self, feasible: int, infeasible: int, seed: int, *, without_fold: int | None = None
    ) -> NDArray[np.int64]:
        """Draw training rows from the pool.

        With the same seed, a larger draw contains the smaller one. Where a class has too
        few rows, all of them are taken.

        Parameters
        ----------
        feasible, infeasible : int
            Rows of either class.
        seed : int
            Seed of the draw.
        without_fold : int, optional
            Leave the rows of this fold out.
        """
        pool = self.pool if without_fold is None else self.pool[self.folds != without_fold]
        rng = np.random.default_rng([seed, _DRAW])
        y = self.y[pool]
        parts = (rng.permutation(pool[y])[:feasible], rng.permutation(pool[~y])[:infeasible])
        return np.concatenate(parts)

    def fold_rows(self, fold: int, seed: int) -> NDArray[np.int64]:
        """Return rows of one fold, balanced, at most as many as the test set may have."""
        rows = self.pool[self.folds == fold]
        rng = np.random.default_rng([seed, _BALANCE, fold])
        balanced: NDArray[np.int64] = rows[balanced_rows(self.y[rows], rng, most=self.most_judged)]
        return balanced

    @property
    def smaller_class(self) -> int:
        """Rows of the smaller class in the pool: half of the largest balanced training set."""
        feasible = int(self.y[self.pool].sum())
        return min(feasible, len(self.pool) - feasible)


def _digest(*arrays: NDArray[np.generic]) -> str:
    digest = hashlib.sha256(f"{FEATURE_SET} {len(FEATURES)}".encode())
    for array in arrays:
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()[:16]
