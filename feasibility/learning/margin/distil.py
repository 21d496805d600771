"""`distil`: the opinion of an ensemble of large nets, taught to a net that is as fast as before.

Where labels are few, nets of one shape err differently, and their mean errs less than any of them.
It cannot be shipped, as it takes as many times as long; but it can be asked about legs that nobody
has solved, which cost a thousandth of a label (Hinton et al. 2015, "Distilling the knowledge in a
neural network"; Bucila et al. 2006, "Model compression").
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.artefact import Artefact
from feasibility.classifier.margin.network import MarginNet
from feasibility.classifier.margin.views import LegView
from feasibility.learning.margin.examples import FAR_WEIGHT, MarginExamples
from feasibility.learning.margin.fit import MarginRecipe
from feasibility.learning.margin.fit_view import Parts, calibration_of
from feasibility.learning.margin.stack import Lessons, StackRecipe, fit_stack, mean_opinion

_Array = NDArray[np.float64]


@final
@dataclass(frozen=True, eq=False)
class UnsolvedLegs:
    """Legs whose m* nobody knows; n of them.

    Attributes
    ----------
    X : (n, k) float32
        Features.
    hint, least, most : (n,) float64
        Their hints, and between which logarithms of accelerations m* matters.
    """

    X: NDArray[np.float32]
    hint: _Array
    least: _Array
    most: _Array


@final
@dataclass(frozen=True)
class Distillation:
    """How it is done.

    Attributes
    ----------
    teachers, student : StackRecipe
        The ensemble, and the one net. Both begin with random weights: the model's own may have
        learned legs that are left out here.
    seed : int
        Which legs are left out, as `MarginRecipe` has it.
    """

    teachers: StackRecipe
    student: StackRecipe
    seed: int = 1


@final
@dataclass(frozen=True, eq=False)
class Distilled:
    """What comes of it.

    Attributes
    ----------
    model : Artefact
        The model with the new net and its calibration; all else as before.
    held_out : (m,) intp
        The examples that neither the teachers nor the student learned from.
    errors : mapping of str to array
        Errors of log m* on these (m,): of the model before, which may know some of them, the
        teachers' mean, the student.
    """

    model: Artefact
    held_out: NDArray[np.intp]
    errors: Mapping[str, _Array]


def distil(
    examples: MarginExamples,
    unsolved: UnsolvedLegs,
    view: LegView,
    start: Artefact,
    how: Distillation,
    *,
    on_epoch: Callable[[str, int, float], None] = lambda *_: None,
) -> Distilled:
    """Train teachers on solved legs, and a student on these and on unsolved ones.

    Parameters
    ----------
    examples : MarginExamples
        Solved legs; a part is left out, for validation and calibration.
    unsolved : UnsolvedLegs
        Legs about which the teachers are asked.
    view : LegView
        Which nets.
    start : Artefact
        The model whose large net for such legs is replaced.
    how : Distillation
        How it is done.
    on_epoch : callable
        Called with "teachers" or "student", the number of an epoch and its loss.

    Raises
    ------
    InputError
        Too few legs.
    MissingDependencyError
        The extra ``train`` is not installed.
    """
    parts = Parts.of(examples, MarginRecipe(seed=how.seed, batch=how.teachers.batch))
    rows = parts.learned
    known, weight = examples.error[rows], examples.weight[rows]
    teachers = fit_stack(
        Lessons(examples.X[rows], known, weight, known),
        how.teachers,
        on_epoch=lambda epoch, loss: on_epoch("teachers", epoch, loss),
    )

    def ask(X: NDArray[Any]) -> _Array:
        return mean_opinion(teachers, X, device=how.teachers.device)

    opinion = ask(unsolved.X)
    estimate = unsolved.hint + opinion
    matters = (estimate > unsolved.least) & (estimate < unsolved.most)
    lessons = Lessons(
        X=np.concatenate([examples.X[rows].astype(np.float32), unsolved.X]),
        # Half of what the teachers learned by heart, half of what they think themselves.
        target=np.concatenate([0.5 * (known + ask(examples.X[rows])), opinion]),
        weight=np.concatenate([weight, np.where(matters, 1.0, FAR_WEIGHT)]),
        truth=np.concatenate([known, np.full(len(opinion), np.nan)]),
    )
    (net,) = fit_stack(
        lessons,
        replace(how.student, count=1),
        on_epoch=lambda epoch, loss: on_epoch("student", epoch, loss),
    )
    held = np.concatenate([parts.validation, parts.calibration])
    before = MarginNet(start.section(view.section("model")))
    errors = {
        "before": before(examples.X[held])[0] - examples.error[held],
        "teachers": ask(examples.X[held]) - examples.error[held],
        "student": MarginNet(net)(examples.X[held])[0] - examples.error[held],
    }
    return Distilled(_with_net(start, view, net, examples, parts, how.seed), held, errors)


def _with_net(
    start: Artefact,
    view: LegView,
    net: Mapping[str, _Array],
    examples: MarginExamples,
    parts: Parts,
    seed: int,
) -> Artefact:
    rows = parts.calibration
    correction, expected = MarginNet(net)(examples.X[rows])
    calibration = calibration_of(
        examples.kinds[rows], view, correction - examples.error[rows], expected, seed
    )
    arrays = dict(start.arrays)
    for section, found in (("model", net), ("calibration", calibration)):
        prefix = f"{view.section(section)}/"
        arrays = {name: array for name, array in arrays.items() if not name.startswith(prefix)}
        arrays |= {f"{prefix}{name}": array for name, array in found.items()}
    return replace(start, arrays=arrays)
