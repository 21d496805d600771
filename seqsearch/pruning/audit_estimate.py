"""What the audit's samples say about the whole search: rates with confidence intervals.

Every stratum holds N candidates of which n, drawn at random, were solved. A
flyable candidate is thus seen with probability n/N, and each that was seen
stands for the weight w = N/n. With y_i flyable ones seen in stratum i, the
unbiased (Horvitz-Thompson) estimate of the flyable candidates is the sum of
w_i y_i.

The numbers seen are sums of rare, negatively correlated draws and scatter no
more than Poisson variables, so intervals for weighted Poisson sums hold. The
interval used matches a gamma distribution to the sum and its variance, the
upper limit after adding one more of the heaviest weight (Fay and Feuer 1997,
Statistics in Medicine 16:791). The ratio of the pruned to all flyable candidates follows
by melding the confidence distributions of both sums (Fay, Proschan and
Brittain 2015, Biometrics 71:146), here in closed form as the ratio of gamma
variables is a beta variable. With one weight throughout the result is the
Clopper-Pearson interval.

A far stratum, of candidates that are hopeless unless the predictor is wrong by
more than a tenth, holds so many that its weight alone would set the upper limit,
whatever is found near the boundary. It is a tripwire: sampled as the others,
and as soon as one flyable candidate is found there, it counts in full. Until then it is left out
of `interval`, which thus trusts the predictor that far; `interval_unconditional` never
leaves it out.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, Self, final

import numpy as np
from scipy.stats import beta

CONFIDENCE: Final = 0.95
"""Confidence of all intervals."""


@final
@dataclass(frozen=True, kw_only=True)
class Stratum:
    """Candidates of one rank that are alike, and what a random sample of them showed.

    Attributes
    ----------
    label : str
        Predicted margins of the candidates, such as ``"0.9 to 1"``.
    candidates : float
        How many there are; estimated where only a part of the rank was looked at.
    solved : int
        How many were optimised.
    flyable : int
        How many of those can be flown.
    contenders : int
        How many of the flyable ones would have gone on in the beam.
    far : bool
        The predictor thinks these far from flyable.
    """

    label: str
    candidates: float
    solved: int
    flyable: int
    contenders: int = 0
    far: bool = False

    @property
    def weight(self) -> float:
        """Candidates for which each solved one stands."""
        return self.candidates / self.solved


@final
@dataclass(frozen=True, kw_only=True)
class AuditedHop:
    """One candidate that was optimised for the audit.

    Attributes
    ----------
    kept : bool
        It was not pruned.
    tof_days : float
        Flight time of all its legs.
    margin : float or None
        Predicted m*/m0 of its most difficult leg; None where nothing is known.
    flyable : bool
        It can be flown.
    """

    kept: bool
    tof_days: float
    margin: float | None
    flyable: bool


@final
@dataclass(frozen=True, kw_only=True)
class RankAudit:
    """The audit of one rank: strata of the pruned and of the kept candidates, and what was solved.

    Checkpoints of before there were `hops` are read with none.
    """

    pruned: tuple[Stratum, ...]
    kept: tuple[Stratum, ...]
    hops: tuple[AuditedHop, ...] = ()

    @property
    def solved(self) -> int:
        """Candidates optimised for the audit."""
        return sum(stratum.solved for stratum in (*self.pruned, *self.kept))


@final
@dataclass(frozen=True, kw_only=True)
class AuditEstimate:
    """What the audits of many ranks say together.

    Attributes
    ----------
    solved_pruned, solved_kept : int
        Candidates optimised for the audit.
    found : int
        Pruned candidates among them that can be flown.
    flyable_pruned, flyable_kept : float
        Estimates for all candidates.
    false_prune_rate : float
        Share of the flyable candidates that were pruned; NaN where no flyable
        candidate was seen.
    interval : tuple of float
        Its confidence interval, if nothing is flyable in far strata where nothing
        was found.
    interval_unconditional : tuple of float
        Its confidence interval without that condition.
    far_solved, far_found : int
        Candidates of far strata that were optimised, and flyable ones among them.
    contenders : float
        Estimate of the falsely pruned candidates that would have gone on in the beam.
    contenders_found : int
        How many of those were seen.
    """

    solved_pruned: int
    solved_kept: int
    found: int
    flyable_pruned: float
    flyable_kept: float
    false_prune_rate: float
    interval: tuple[float, float]
    interval_unconditional: tuple[float, float]
    far_solved: int
    far_found: int
    contenders: float
    contenders_found: int

    @classmethod
    def of(cls, audits: Iterable[RankAudit]) -> Self:
        """Combine the audits of many ranks."""
        audits = list(audits)
        pruned = [stratum for audit in audits for stratum in audit.pruned]
        kept = [stratum for audit in audits for stratum in audit.kept]
        far = [stratum for stratum in pruned if stratum.far]
        far_found = sum(stratum.flyable for stratum in far)
        flyable_pruned = _WeightedSum.of(pruned).sum
        flyable_kept = _WeightedSum.of(kept).sum
        total = flyable_pruned + flyable_kept
        return cls(
            solved_pruned=sum(stratum.solved for stratum in pruned),
            solved_kept=sum(stratum.solved for stratum in kept),
            found=sum(stratum.flyable for stratum in pruned),
            flyable_pruned=flyable_pruned,
            flyable_kept=flyable_kept,
            false_prune_rate=flyable_pruned / total if total else float("nan"),
            interval=share_interval([s for s in pruned if not s.far or far_found], kept),
            interval_unconditional=share_interval(pruned, kept),
            far_solved=sum(stratum.solved for stratum in far),
            far_found=far_found,
            contenders=sum(stratum.weight * stratum.contenders for stratum in pruned),
            contenders_found=sum(stratum.contenders for stratum in pruned),
        )

    def one_line(self) -> str:
        """Return the estimate as a sentence."""
        if not self.solved_pruned:
            return "audit: nothing was pruned"
        if not self.found and not self.flyable_kept:
            return f"audit: none of {self.solved_pruned} pruned legs tried can be flown"
        low, high = (100 * limit for limit in self.interval)
        near = self.solved_pruned - self.far_solved
        far = f", {self.far_found} of {self.far_solved} far from it" if self.far_solved else ""
        return (
            f"audit: {100 * self.false_prune_rate:.2f} % of the flyable legs were pruned "
            f"({100 * CONFIDENCE:g} % interval {low:.2f} to {high:.2f} %), about "
            f"{self.contenders:.0f} of them fit for the beam; of pruned legs tried, "
            f"{self.found - self.far_found} of {near} near the boundary can be flown{far}"
        )


def share_interval(
    part: Iterable[Stratum], rest: Iterable[Stratum], confidence: float = CONFIDENCE
) -> tuple[float, float]:
    """Return the confidence interval of flyable in `part` / flyable in `part` and `rest`.

    Parameters
    ----------
    part, rest : iterable of Stratum
        Strata with at least one solved candidate each.
    confidence : float
        Such as 0.95.

    Returns
    -------
    low, high : float
        Between 0 and 1; 0 and 1 where no flyable candidate was seen.
    """
    part_sum, rest_sum = _WeightedSum.of(part), _WeightedSum.of(rest)
    tail = (1.0 - confidence) / 2.0
    low = _ratio_quantile(part_sum.lower(), rest_sum.upper(), tail)
    high = _ratio_quantile(part_sum.upper(), rest_sum.lower(), 1.0 - tail)
    return low, high


@final
@dataclass(frozen=True)
class _Gamma:
    shape: float
    scale: float


@final
@dataclass(frozen=True)
class _WeightedSum:
    """A weighted sum of Poisson counts with its variance and heaviest weight."""

    sum: float
    variance: float
    heaviest: float

    @classmethod
    def of(cls, strata: Iterable[Stratum]) -> Self:
        strata = list(strata)
        weight = np.array([stratum.weight for stratum in strata])
        seen = np.array([stratum.flyable for stratum in strata], dtype=np.float64)
        heaviest = float(weight.max(initial=0.0))
        return cls(float(weight @ seen), float(weight**2 @ seen), heaviest)

    def lower(self) -> _Gamma | None:
        """Return the lower confidence distribution; None is zero for certain."""
        return _matched(self.sum, self.variance)

    def upper(self) -> _Gamma | None:
        return _matched(self.sum + self.heaviest, self.variance + self.heaviest**2)


def _matched(mean: float, variance: float) -> _Gamma | None:
    return None if mean == 0 else _Gamma(mean**2 / variance, variance / mean)


def _ratio_quantile(part: _Gamma | None, rest: _Gamma | None, level: float) -> float:
    """Return the quantile of part / (part + rest) for independent gamma variables."""
    if part is None:
        # Of nothing at all, even its smallness is unknown.
        return 0.0 if rest is not None or level < 0.5 else 1.0
    if rest is None:
        return 1.0
    share = float(beta.ppf(level, part.shape, rest.shape))
    return share * part.scale / (share * part.scale + (1.0 - share) * rest.scale)
