"""A model for one spacecraft: legs of it, fine-tuning, and the proof that it is no worse."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final, final

import msgspec
import numpy as np

from feasibility.classifier.artefact import Artefact
from feasibility.classifier.classifier import FeasibilityClassifier
from feasibility.dataset import Dataset, read_protocol
from feasibility.dataset.protocol import Protocol
from feasibility.errors import InputError
from feasibility.evaluation.evaluate import evaluate
from feasibility.evaluation.tables import markdown_table
from feasibility.learning.margin.train import MarginEpoch, MarginRecipe, train_margin
from feasibility.runtime.atomic import write_json
from feasibility.runtime.provenance import provenance
from feasibility.spacecraft.legs import Part, make, parts_of
from feasibility.spacecraft.spacecraft_file import LEGS_PER_SHARD, SpacecraftFile

FINE_TUNED, RECALIBRATED, UNCHANGED = "fine-tuned", "recalibrated", "unchanged"
"""What may be saved, the best first."""

REPORT: Final = "report.json"

LEAST_SHARE: Final = 0.02
"""Of flyable legs, and of others, below which the legs teach little."""

_FIRST_SEED: Final = 40_000
"""Away from the seeds of the default model's legs."""

_SHOWN: Final = (
    "accuracy",
    "balanced_accuracy",
    "accuracy_within_15_percent",
    "accuracy_within_5_percent",
    "log_loss",
    "calibration_error",
    "median_log_margin_error_near",
    "mean_log_margin_error_near",
    "recall_at_099",
    "infeasible_pruned_at_099",
    "in_domain",
)


@final
@dataclass(frozen=True)
class RetrainSettings:
    """How much is done.

    Parameters
    ----------
    legs, test_legs : int
        Legs of the spacecraft to learn from, and to be judged on.
    general_legs, general_test_legs : int
        Legs of any spacecraft: learned besides, so that nothing is forgotten, and judged on.
    epochs : int
        Of the fine-tuning.
    learning_rate : float
        Largest one.
    seed : int
        Seed of everything.
    workers, threads : int
        Processes of the solver (one a core if not given), and threads of the training.
    device : str
        "cpu", "cuda" or "auto".
    """

    legs: int = 60_000
    test_legs: int = 6000
    general_legs: int = 12_000
    general_test_legs: int = 1500
    epochs: int = 15
    learning_rate: float = 7e-4
    seed: int = 0
    workers: int | None = None
    threads: int = 2
    device: str = "auto"


@final
@dataclass(frozen=True, eq=False)
class Retrained:
    """What came of it.

    Attributes
    ----------
    artefact : Artefact
        The model to be saved.
    choice : str
        `FINE_TUNED`, `RECALIBRATED` or `UNCHANGED`.
    own, general : dict of str to dict
        Figures of each candidate on fresh legs of the spacecraft, and of any spacecraft.
    """

    artefact: Artefact
    choice: str
    own: dict[str, dict[str, float]]
    general: dict[str, dict[str, float]]

    def table(self) -> str:
        """Return the figures as Markdown."""
        parts = []
        for title, figures in (
            ("fresh legs of this spacecraft", self.own),
            ("fresh legs of any spacecraft", self.general),
        ):
            rows = [
                [name, *(f"{candidate[name]:.5f}" for candidate in figures.values())]
                for name in _SHOWN
                if all(name in candidate for candidate in figures.values())
            ]
            parts.append(f"{title}:\n\n{markdown_table(['measure', *figures], rows)}\n")
        return "\n".join(parts)

    def verdict(self) -> str:
        """Return in one sentence what is saved and why."""
        before, after = (self.own[name]["wrong"] for name in (UNCHANGED, self.choice))
        n = self.own[UNCHANGED]["n"]
        texts = {
            FINE_TUNED: "the fine-tuned model is saved: it is no worse than the one it started "
            f"from ({after:.0f} wrong answers of {n:.0f}, {before:.0f} before)",
            RECALIBRATED: "fine-tuning does not help; the model it started from is saved with a "
            "calibration for this spacecraft",
            UNCHANGED: "neither fine-tuning nor a new calibration helps; the model it started "
            "from is saved as it is",
        }
        wide = {name: figures["wrong"] for name, figures in self.general.items()}
        return (
            f"{texts[self.choice]}; of {self.general[UNCHANGED]['n']:.0f} legs of any spacecraft "
            f"it gets {wide[self.choice]:.0f} wrong, {wide[UNCHANGED]:.0f} before"
        )


def retrain(
    craft: SpacecraftFile,
    catalogues: Sequence[str],
    start: Artefact,
    folder: Path,
    settings: RetrainSettings,
    *,
    say: Callable[[str], None] = print,
    on_epoch: Callable[[MarginEpoch], None] | None = None,
) -> Retrained:
    """Make legs, fine-tune, recalibrate, and choose by fresh legs.

    Legs and a checkpoint of the training are kept in `folder`: the same call goes on where an
    interrupted one stopped.

    Parameters
    ----------
    craft : SpacecraftFile
        The spacecraft.
    catalogues : sequence of str
        Asteroid tables; none for a synthetic main belt.
    start : Artefact
        A margin model.
    folder : Path
        Where the legs and the report go.
    settings : RetrainSettings
        How much is done.
    say, on_epoch : callable
        Told about progress.

    Raises
    ------
    InputError
        A model of another kind, legs that cannot be made, a folder of another run.
    MissingDependencyError
        The extra ``train`` or pyarrow is not installed.
    """
    if start.kind != "margin":
        raise InputError(f"retrain: a model of kind {start.kind!r}, expected 'margin'")
    first = _FIRST_SEED + 4 * settings.seed
    learn = parts_of(craft, catalogues, settings.legs, first, "train")
    test = parts_of(craft, catalogues, settings.test_legs, first + 1, "test")
    wide = _general()
    learn.append(Part("train-general", wide, settings.general_legs, first + 2))
    wide_test = Part("test-general", wide, settings.general_test_legs, first + 3)
    wanted = [*test, wide_test, *learn]
    say(f"solving {sum(part.legs for part in wanted)} legs in {folder}")
    made = make(wanted, folder, settings.workers)
    own_test, general_test = made[: len(test)], made[len(test)]
    learned = made[len(test) + 1 :]

    rare = few_flyable([*own_test, *learned[:-1]])
    if rare is not None:
        say(f"warning: {rare}")

    recipe = MarginRecipe(
        epochs=settings.epochs,
        learning_rate=settings.learning_rate,
        batch=int(np.clip(sum(len(part) for part in learned) // 40, 64, 1024)),
        seed=settings.seed,
        device=settings.device,
        threads=settings.threads,
    )
    say("fine-tuning")
    checkpoint = folder / "checkpoint"
    tuned = train_margin(learned, recipe, start=start, checkpoint=checkpoint, on_epoch=on_epoch)
    still = dataclasses.replace(recipe, epochs=0)
    candidates = {
        UNCHANGED: start,
        RECALIBRATED: _over(start, train_margin(learned, still, start=start)),
        FINE_TUNED: _over(start, tuned),
    }
    say("judging")
    own = {name: _figures(model, own_test) for name, model in candidates.items()}
    general = {name: _figures(model, [general_test]) for name, model in candidates.items()}
    choice = choose(own)
    chosen = candidates[choice]
    report = {
        "choice": choice,
        "spacecraft": craft.to_dict(),
        "settings": asdict(settings),
        "own": own,
        "general": general,
        "provenance": provenance(),
    }
    artefact = dataclasses.replace(
        chosen,
        metrics={**chosen.metrics, "retrain": {"own": own[choice], "general": general[choice]}},
        provenance={**chosen.provenance, "retrain": report},
    )
    write_json(folder / REPORT, report)
    checkpoint.unlink(missing_ok=True)
    return Retrained(artefact, choice, own, general)


def few_flyable(datasets: Sequence[Dataset]) -> str | None:
    """Return what is odd where hardly any leg can be flown, or hardly any cannot; else None.

    A model learns the boundary from both sides of it.
    """
    flyable = sum(int(dataset.flyable.sum()) for dataset in datasets)
    solved = sum(int(dataset.labelled.sum()) for dataset in datasets)
    if flyable < LEAST_SHARE * solved or solved == 0:
        return (
            f"of {solved} solved legs {flyable} can be flown; expected a lighter m0_kg, more "
            "thrust or longer tof_days, and thrust_n in N"
        )
    if solved - flyable < LEAST_SHARE * solved:
        return (
            f"of {solved} solved legs {solved - flyable} cannot be flown; expected a heavier "
            "m0_kg or shorter tof_days"
        )
    return None


def choose(own: Mapping[str, Mapping[str, float]]) -> str:
    """Return which candidate is saved: the fine-tuned one if it is no worse, and so on.

    No worse is: as few wrong answers, no larger log loss, no larger mean error of log(m*/m0)
    of legs near the boundary, all on the same fresh legs of the spacecraft.

    Parameters
    ----------
    own : mapping
        Figures of `FINE_TUNED`, `RECALIBRATED` and `UNCHANGED`.
    """
    before = own[UNCHANGED]
    for name in (FINE_TUNED, RECALIBRATED):
        figures = ("wrong", "log_loss", "mean_log_margin_error_near")
        if all(own[name].get(f, 0.0) <= before.get(f, 0.0) for f in figures):
            return name
    return UNCHANGED


def _general() -> Protocol:
    general = read_protocol("general")
    return msgspec.structs.replace(general, propellant=False, legs_per_shard=LEGS_PER_SHARD)


def _over(start: Artefact, trained: Artefact) -> Artefact:
    """Return the trained model with what it has not learned anew taken from the start."""
    return dataclasses.replace(trained, arrays={**start.arrays, **trained.arrays})


def _figures(model: Artefact, datasets: Sequence[Dataset]) -> dict[str, float]:
    classifier = FeasibilityClassifier(model)
    outcome = evaluate(classifier, joined(datasets))
    figures = dict(outcome.metrics)
    # The same run is to give the same file.
    del figures["us_per_leg"]
    figures["wrong"] = float(np.sum((outcome.probability >= 0.5) != outcome.y))
    for row in outcome.pruning:
        if row["recall_asked"] == 0.99:
            figures["recall_at_099"] = row["recall"]
            figures["infeasible_pruned_at_099"] = row["infeasible_pruned"]
    return figures


def joined(datasets: Sequence[Dataset]) -> Dataset:
    """Return the rows of several datasets of one kind of label as one."""
    names = datasets[0].columns
    columns = {
        name: np.concatenate([dataset.columns[name] for dataset in datasets]) for name in names
    }
    return Dataset(columns, datasets[0].metadata)
