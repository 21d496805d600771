"""From datasets to a margin model: one program, to be read from top to bottom."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from feasibility.classifier.artefact import Artefact
from feasibility.classifier.margin.features import FEATURE_SET, FEATURES
from feasibility.classifier.margin.views import FREE_ENDS, RENDEZVOUS
from feasibility.dataset import Dataset
from feasibility.errors import InputError
from feasibility.learning.margin.examples import MarginExamples, legs_of
from feasibility.learning.margin.fit import MarginEpoch, MarginRecipe, OnEpoch
from feasibility.learning.margin.fit_view import SHARES, fit_view
from feasibility.runtime.provenance import provenance

__all__ = [
    "SHARES",
    "MarginEpoch",
    "MarginRecipe",
    "OnEpoch",
    "train_free_ends",
    "train_margin",
    "with_free_ends_of",
]


def train_margin(
    datasets: Sequence[Dataset],
    recipe: MarginRecipe,
    *,
    start: Artefact | None = None,
    checkpoint: Path | None = None,
    on_epoch: OnEpoch | None = None,
) -> Artefact:
    """Train a margin model on the legs of one or more datasets.

    Legs with free ends get nets of their own, see `train_free_ends`, and change nothing for the
    others. A model that starts from another keeps the standardisation and the domain of that one,
    the latter widened by the new legs, and its weights where training does not improve them on the
    validation part; its nets for the final mass stay as they are, and those for free ends where no
    leg has any. Calibration is always that of the new legs.

    Parameters
    ----------
    datasets : sequence of Dataset
        Legs with m*; their catalogues and spacecraft may differ.
    recipe : MarginRecipe
        How to train.
    start : Artefact, optional
        A margin model to go on from, instead of random weights.
    checkpoint : Path, optional
        File rewritten after each epoch, from which an interrupted training goes on.
    on_epoch : callable, optional
        Called after each epoch of a large net, not of a quick one.

    Returns
    -------
    Artefact
        Its metrics are those of the calibration part.

    Raises
    ------
    InputError
        Too few legs, labels of another kind, a checkpoint of another training.
    MissingDependencyError
        The extra ``train`` is not installed.
    """
    if start is None and not recipe.epochs:
        raise InputError("margin epochs: 0, expected 1 or more without a model to start from")
    rendezvous = legs_of(datasets, RENDEZVOUS)
    if not rendezvous:
        raise InputError(
            "margin model: all legs have free ends (vinf_dep, vinf_arr); expected some from rest "
            "to rest too, or --model free-margin with a model to start from"
        )
    epochs: list[MarginEpoch] = []
    examples = MarginExamples.of(rendezvous, RENDEZVOUS)
    fitted = fit_view(examples, RENDEZVOUS, recipe, start, checkpoint, _noting(epochs, on_epoch))
    kept = {} if start is None else _others(start)
    artefact = Artefact(
        kind="margin",
        feature_set=FEATURE_SET,
        features=FEATURES,
        units=("",) * len(FEATURES),
        arrays={**fitted.arrays(RENDEZVOUS), **kept},
        config={
            "recipe": asdict(recipe),
            "legs": dict(fitted.legs),
            "epochs": [asdict(epoch) for epoch in epochs],
        },
        metrics={"calibration": dict(fitted.metrics)},
        provenance={
            **provenance(),
            "datasets": [_record(dataset) for dataset in rendezvous],
            **({} if start is None else {"start": dict(start.provenance)}),
        },
    )
    if start is not None and "free_ends" in start.config:
        artefact = _with_record(artefact, start)
    if any(dataset.legs.free_ends.any() for dataset in datasets):
        aside = None if checkpoint is None else checkpoint.with_name(f"{checkpoint.name}-free")
        artefact = train_free_ends(
            artefact, datasets, recipe, start=start, checkpoint=aside, on_epoch=on_epoch
        )
        if aside is not None:
            aside.unlink(missing_ok=True)
    return artefact


def train_free_ends(
    artefact: Artefact,
    datasets: Sequence[Dataset],
    recipe: MarginRecipe,
    *,
    start: Artefact | None = None,
    checkpoint: Path | None = None,
    on_epoch: OnEpoch | None = None,
) -> Artefact:
    """Return a margin model with nets for legs with free ends; its other nets are kept.

    Parameters
    ----------
    artefact : Artefact
        A margin model. Nets for free ends that it has are replaced; the one for their final mass
        stays only if `start` has it too.
    datasets : sequence of Dataset
        Legs with m*; those from rest to rest play no part.
    recipe, checkpoint, on_epoch
        As for `train_margin`.
    start : Artefact, optional
        A model whose nets for free ends are begun with, instead of random weights.

    Raises
    ------
    InputError
        As for `train_margin`, or no leg has free ends.
    MissingDependencyError
        The extra ``train`` is not installed.
    """
    free = legs_of(datasets, FREE_ENDS)
    if not free:
        raise InputError(
            "free ends: no leg of the datasets has any; expected vinf_dep or vinf_arr above zero"
        )
    epochs: list[MarginEpoch] = []
    examples = MarginExamples.of(free, FREE_ENDS)
    fitted = fit_view(examples, FREE_ENDS, recipe, start, checkpoint, _noting(epochs, on_epoch))
    arrays = {
        name: array
        for name, array in artefact.arrays.items()
        if not name.startswith(FREE_ENDS.prefix)
    }
    if start is not None:
        mass = FREE_ENDS.section("final_mass")
        arrays |= {f"{mass}/{name}": array for name, array in start.section(mass).items()}
    return replace(
        artefact,
        arrays={**arrays, **fitted.arrays(FREE_ENDS)},
        config={
            **artefact.config,
            "free_ends": {
                "recipe": asdict(recipe),
                "legs": dict(fitted.legs),
                "epochs": [asdict(epoch) for epoch in epochs],
            },
        },
        metrics={**artefact.metrics, "free_ends": {"calibration": dict(fitted.metrics)}},
        provenance={
            **artefact.provenance,
            "free_ends": {
                **provenance(),
                "datasets": [_record(dataset) for dataset in free],
            },
        },
    )


def with_free_ends_of(artefact: Artefact, other: Artefact) -> Artefact:
    """Return a margin model with the nets for free ends of another one.

    Raises
    ------
    InputError
        The other one has none.
    """
    taken = {
        name: array for name, array in other.arrays.items() if name.startswith(FREE_ENDS.prefix)
    }
    if artefact.kind != "margin" or not taken:
        raise InputError("free ends: expected a margin model, and another one with nets for them")
    arrays = {
        name: array
        for name, array in artefact.arrays.items()
        if not name.startswith(FREE_ENDS.prefix)
    }
    return _with_record(replace(artefact, arrays={**arrays, **taken}), other)


def _with_record(artefact: Artefact, other: Artefact) -> Artefact:
    """Return a model with the record of how the other one's nets for free ends were trained."""

    def joined(own: Mapping[str, Any], record: Mapping[str, Any]) -> dict[str, Any]:
        return {**own, **({"free_ends": record["free_ends"]} if "free_ends" in record else {})}

    def taught(model: Artefact) -> dict[str, Any]:
        return dict(model.provenance.get("distilled", {}))

    # Students of an ensemble have a record of their own for each sort of legs.
    free = taught(other).get("free-ends")
    distilled = {name: one for name, one in taught(artefact).items() if name != "free-ends"}
    if free is not None:
        distilled["free-ends"] = free
    provenance = joined(artefact.provenance, other.provenance)
    return replace(
        artefact,
        config=joined(artefact.config, other.config),
        metrics=joined(artefact.metrics, other.metrics),
        provenance={**provenance, **({"distilled": distilled} if distilled else {})},
    )


def _others(start: Artefact) -> dict[str, Any]:
    """Return the arrays of a model that training on legs from rest to rest leaves as they are."""
    return {
        name: array
        for name, array in start.arrays.items()
        if name.startswith(("final_mass/", FREE_ENDS.prefix))
    }


def _noting(epochs: list[MarginEpoch], on_epoch: OnEpoch | None) -> OnEpoch:
    def note(epoch: MarginEpoch) -> None:
        epochs.append(epoch)
        if on_epoch is not None:
            on_epoch(epoch)

    return note


def _record(dataset: Dataset) -> dict[str, Any]:
    """Return what a dataset is, without the folders of the machine that made it."""
    protocol, catalogue = dict(dataset.metadata["protocol"]), dict(dataset.metadata["catalogue"])
    table = dict(protocol.get("catalogue", {}))
    if table.get("file") is not None:
        table["file"] = catalogue["source"] = Path(table["file"]).name
    return {
        "protocol": protocol | {"catalogue": table},
        "catalogue": catalogue,
        "seed": dataset.metadata["seed"],
        "legs": len(dataset),
    }
