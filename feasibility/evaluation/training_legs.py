"""Whether legs that a model is judged on are among those that it was trained on."""

import json
from collections.abc import Mapping
from typing import Any, Final

from feasibility.classifier.artefact import Artefact

_NOT_OF_THE_DRAW: Final = ("name", "description", "label", "solver", "propellant", "catalogue")
"""Parts of a protocol that do not decide which legs are drawn, or are compared otherwise."""


def trained_on(artefact: Artefact, metadata: Mapping[str, Any]) -> bool:
    """Return whether a model has learned from legs with the same draws as a dataset's.

    Leg k depends on protocol, catalogue, seed and k alone, so that datasets of the same recipe
    share their first legs, whatever their sizes.

    Parameters
    ----------
    artefact : Artefact
        The model; its provenance has the recipes of what it learned from.
    metadata : mapping
        Those of the dataset.
    """
    provenance = artefact.provenance
    free = provenance.get("free_ends")
    learned = [
        *_records(provenance.get("datasets")),
        *_records([provenance.get("dataset")]),
        *_records(free.get("datasets") if isinstance(free, Mapping) else None),
    ]
    return _recipe(metadata) in [_recipe(record) for record in learned]


def _records(entries: object) -> list[Mapping[str, Any]]:
    if not isinstance(entries, list):
        return []
    return [
        entry
        for entry in entries
        if isinstance(entry, Mapping)
        and all(isinstance(entry.get(key), Mapping) for key in ("protocol", "catalogue"))
    ]


def _recipe(record: Mapping[str, Any]) -> str:
    """Return what decides the draws as text."""
    protocol, catalogue = record["protocol"], record["catalogue"]
    draw = {key: value for key, value in protocol.items() if key not in _NOT_OF_THE_DRAW}
    bodies = catalogue.get("sha256") or [
        catalogue.get("bodies"),
        protocol.get("catalogue", {}).get("synthetic_seed", 0),
    ]
    # Through JSON, tuples and lists are the same.
    return json.dumps([draw, bodies, record.get("seed")], sort_keys=True)
