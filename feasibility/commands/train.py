"""The command ``feasibility train``."""

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from feasibility.commands.options import add_common, one_or_more
from feasibility.errors import InputError

_DESCRIPTION: Final = """\
Train a classifier on the labelled legs of a dataset and save it as one file,
which a search loads as a pruner.

The legs are split by pairs of bodies into training (80 %), validation and
calibration (10 % each). Features are ranked by an ensemble of trees and the
first of them taken, standardised, the classes balanced if asked for. A network
writes a checkpoint after each epoch beside the model; run the command again to
go on after an interruption.

The model "margin" learns the maximum initial mass instead, for any spacecraft, from one or
more datasets; the learning curve is drawn beside it. Legs with free ends, such as launches and
fly-bys, get nets of their own in the same model. "free-margin" trains these alone and adds them to
a margin model given by --start. "final-mass" adds to such a model the mass at arrival with least
propellant. The rest of the model stays as it is. The datasets of the latter have
propellant = true in their protocol.

--tune looks for hyperparameters first, those of --set, --epochs and so on being fixed. Its trials
are kept beside the model, and the same command goes on with them; or in a --storage that the
same command, started several times and on any number of machines, shares.

  feasibility train data/search data/table1 data/general --model margin --out any.seqmodel
  feasibility train data/flyby --model free-margin --start any.seqmodel --out more.seqmodel
  feasibility train data/flown --model final-mass --start more.seqmodel --out whole.seqmodel
  feasibility train data/table1 --preset dnn1 --out dnn1.seqmodel
  feasibility train data/table1 --model ensemble --balance adasyn
  feasibility train data/table1 --tune 30 --epochs 20 --out tuned.seqmodel
  feasibility train data/table1 --tune 300 --storage postgresql://user@host/trials
  seqsearch run mission.toml --pruner dnn1.seqmodel:0.99
"""

_MODELS: Final = ("margin", "free-margin", "final-mass", "dnn", "ensemble", "knn", "svm", "tree")
_TUNABLE: Final = ("dnn", "ensemble", "knn", "svm", "tree")
_DEFAULT_FEATURES: Final = 60
_STARTED: Final = ("free-margin", "final-mass")
"""Models that are added to another one."""


def add_parser(commands: Any) -> None:
    """Add the command to the parser's sub-commands."""
    parser = commands.add_parser(
        "train",
        help="train a classifier",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "dataset",
        nargs="+",
        metavar="DATASET",
        help="folder of a dataset; several for margin, free-margin and final-mass",
    )
    parser.add_argument("--model", choices=_MODELS, help="kind of model (default: dnn)")
    parser.add_argument(
        "--preset",
        choices=("dnn1", "dnn2"),
        help="the paper's optimised network with 60 or with all 103 features",
    )
    parser.add_argument(
        "--features", type=int, metavar="K", help="how many features (default: 60, dnn2: 103)"
    )
    parser.add_argument(
        "--balance",
        choices=("none", "adasyn"),
        default="none",
        help="fill up the smaller class of the training part (default: none)",
    )
    parser.add_argument("--epochs", type=int, help="epochs of a network")
    parser.add_argument(
        "--patience",
        type=int,
        metavar="N",
        help="stop a network when the validation loss has not fallen for N epochs, keep its best",
    )
    parser.add_argument("--device", choices=("cpu", "cuda", "auto"), help="where a network trains")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="any other hyperparameter, such as width=200; may be given several times",
    )
    parser.add_argument(
        "--start",
        metavar="FILE",
        help='margin model that free-margin or final-mass is added to, or "default"',
    )
    parser.add_argument(
        "--tune",
        type=one_or_more,
        metavar="TRIALS",
        help="find hyperparameters first, in this number of trials",
    )
    parser.add_argument(
        "--storage",
        metavar="URL",
        help="where the trials are: sqlite:///FILE, journal:///FILE, postgresql://..., "
        "mysql://... (default: a journal OUT.trials of this command alone)",
    )
    add_common(parser, seed="everything", workers=None)
    parser.add_argument(
        "--out", metavar="FILE", help="the model (default: MODEL.seqmodel, or PRESET.seqmodel)"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Do what the command line asks for and return the exit code.

    Raises
    ------
    InputError
        Options that contradict each other, or a dataset that cannot be used.
    """
    if options.preset is not None and options.model not in (None, "dnn"):
        raise InputError(f"--preset {options.preset}: is a dnn, but --model is {options.model}")
    name = options.preset or options.model or "dnn"
    out = Path(options.out or f"{name}.seqmodel")
    if not out.parent.is_dir():
        raise InputError(f"--out {out}: no folder {out.parent}")
    if (name in _STARTED) != (options.start is not None):
        raise InputError("--start: goes with --model final-mass or free-margin, which need it")
    if options.storage is not None and options.tune is None:
        raise InputError("--storage: goes with --tune")
    if options.tune is not None and (options.preset is not None or name not in _TUNABLE):
        raise InputError(f"--tune: is for --model {', '.join(_TUNABLE)}, not for {name}")
    if name in ("margin", "free-margin"):
        return _train_margin(options, out)
    if name == "final-mass":
        return _train_final_mass(options, out)
    if len(options.dataset) > 1:
        raise InputError(
            f"{len(options.dataset)} datasets: only --model margin, free-margin and "
            "final-mass take several"
        )
    return _train(options, name, out)


def _train_margin(options: argparse.Namespace, out: Path) -> int:
    from feasibility.classifier.classifier import FeasibilityClassifier
    from feasibility.dataset import read_dataset
    from feasibility.learning.margin.curves import draw_learning_curve
    from feasibility.learning.margin.train import MarginRecipe, train_free_ends, train_margin

    settings = _margin_settings(options)
    try:
        recipe = MarginRecipe(**settings, seed=options.seed)
    except TypeError as error:
        raise InputError(f"--set: {error}") from None
    checkpoint = out.with_name(out.name + ".checkpoint")
    datasets = [read_dataset(folder) for folder in options.dataset]
    how: dict[str, Any] = {"checkpoint": checkpoint, "on_epoch": _print_margin_epoch}
    if options.model == "free-margin":
        start = FeasibilityClassifier.load(options.start).artefact
        artefact = train_free_ends(start, datasets, recipe, **how)
    else:
        artefact = train_margin(datasets, recipe, **how)
    artefact.save(out)
    checkpoint.unlink(missing_ok=True)
    if options.model == "margin":
        _print_fit("", artefact.config, artefact.metrics)
        curve = out.with_suffix(".png")
        draw_learning_curve(artefact, curve)
    if any(dataset.legs.free_ends.any() for dataset in datasets):
        _print_fit("free ends: ", artefact.config["free_ends"], artefact.metrics["free_ends"])
    print(f"wrote {out}" + (f" and {curve}" if options.model == "margin" else ""))
    return 0


def _print_fit(which: str, config: Any, metrics: Any) -> None:
    legs, measures = config["legs"], metrics["calibration"]
    print(
        f"{which}{legs['training']} legs for training, {legs['validation']} for validation, "
        f"{legs['calibration']} for calibration"
    )
    print(
        f"{which}calibration legs: error of log m*, median "
        f"{measures['median_absolute_log_error']:.5f}, mean "
        f"{measures['mean_absolute_log_error']:.5f} (hint alone: median "
        f"{measures['hint_median_absolute_log_error']:.5f})"
    )


def _train_final_mass(options: argparse.Namespace, out: Path) -> int:
    from feasibility.classifier.classifier import FeasibilityClassifier
    from feasibility.dataset import read_dataset
    from feasibility.learning.margin.train_final_mass import FINAL_MASS_RECIPE, train_final_mass

    settings = _margin_settings(options)
    try:
        recipe = replace(FINAL_MASS_RECIPE, **settings, seed=options.seed)
    except TypeError as error:
        raise InputError(f"--set: {error}") from None
    checkpoint = out.with_name(out.name + ".checkpoint")
    datasets = [read_dataset(folder) for folder in options.dataset]
    artefact = train_final_mass(
        FeasibilityClassifier.load(options.start).artefact,
        datasets,
        recipe,
        checkpoint=checkpoint,
        on_epoch=_print_margin_epoch,
    )
    artefact.save(out)
    checkpoint.unlink(missing_ok=True)
    free = [dataset.legs.free_ends for dataset in datasets]
    if not all(ends.all() for ends in free):
        _print_final_mass("", artefact.metrics["final_mass"])
    if any(ends.any() for ends in free):
        _print_final_mass("free ends: ", artefact.metrics["free_ends"]["final_mass"])
    print(f"wrote {out}")
    return 0


def _print_final_mass(which: str, measures: Any) -> None:
    print(
        f"{which}{measures['legs']} legs for training; validation legs: relative error of the "
        f"final mass, median {measures['median_relative_error']:.5f}, "
        f"mean {measures['mean_relative_error']:.5f}"
    )


def _margin_settings(options: argparse.Namespace) -> dict[str, Any]:
    """Return what the options set for a net of a margin model.

    Raises
    ------
    InputError
        An option of the other models.
    """
    for name in ("preset", "features"):
        if getattr(options, name) is not None:
            raise InputError(f"--{name}: is not for --model {options.model}")
    if options.balance != "none":
        raise InputError(
            f"--balance: is not for --model {options.model}, which learns masses, not classes"
        )
    settings = _hyperparameters(options, network=True)
    settings.pop("keep_best", None)
    return settings


def _print_margin_epoch(epoch: Any) -> None:
    print(
        f"epoch {epoch.number:>3}: training loss {epoch.train_loss:.5f}, "
        f"validation loss {epoch.validation_loss:.5f}",
        flush=True,
    )


def _train(options: argparse.Namespace, name: str, out: Path) -> int:
    from feasibility.dataset import read_dataset
    from feasibility.learning.paper.models import PRESETS
    from feasibility.learning.paper.train import Recipe, train

    n_features = options.features
    if n_features is None:
        n_features = PRESETS[name][1] if name in PRESETS else _DEFAULT_FEATURES
    recipe = Recipe(
        model=name,
        hyperparameters=_hyperparameters(options, network=name in ("dnn", *PRESETS)),
        n_features=n_features,
        balance=options.balance,
        seed=options.seed,
    )
    dataset = read_dataset(options.dataset[0])
    if options.tune is not None:
        recipe = _tuned(options, dataset, recipe, out)
    checkpoint = out.with_name(out.name + ".checkpoint")
    artefact = train(dataset, recipe, checkpoint=checkpoint, on_epoch=_print_epoch)
    artefact.save(out)
    checkpoint.unlink(missing_ok=True)
    legs = artefact.config["legs"]
    print(
        f"{legs['training']} legs for training, {legs['synthetic']} synthetic ones, "
        f"{legs['validation']} for validation, {legs['calibration']} for calibration"
    )
    measures = artefact.metrics["validation"]
    shown = ("accuracy", "precision", "recall", "f1", "f10", "auc", "balanced_accuracy")
    print("validation: " + ", ".join(f"{measure} {measures[measure]:.4f}" for measure in shown))
    print(f"wrote {out}")
    return 0


def _tuned(options: argparse.Namespace, dataset: Any, recipe: Any, out: Path) -> Any:
    from feasibility.learning.paper.tuned import tuned

    best = tuned(
        dataset,
        recipe,
        options.storage or out.with_name(out.name + ".trials"),
        n_trials=options.tune,
        on_trial=_print_trial,
    )
    found = {
        name: value
        for name, value in best.hyperparameters.items()
        if name not in recipe.hyperparameters
    }
    print("best: " + ", ".join(f"{name} {_shown(value)}" for name, value in found.items()))
    return best


def _print_trial(trial: Any) -> None:
    outcome = f"accuracy {trial.value:.4f}" if trial.state == "complete" else trial.state
    print(f"trial {trial.number:>3}: {outcome}, {trial.seconds:.1f} s", flush=True)


def _shown(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _hyperparameters(options: argparse.Namespace, *, network: bool) -> dict[str, Any]:
    """Return what the options set.

    Raises
    ------
    InputError
        An option of networks for another model, or ``--set`` without a value.
    """
    given = {
        name: getattr(options, name)
        for name in ("epochs", "patience", "device")
        if getattr(options, name) is not None
    }
    if given and not network:
        raise InputError(f"--{next(iter(given))}: is for networks, but --model is {options.model}")
    if "patience" in given:
        given["keep_best"] = True
    for setting in options.set:
        name, equals, value = setting.partition("=")
        if not equals:
            raise InputError(f"--set {setting}: expected NAME=VALUE")
        try:
            given[name] = json.loads(value)
        except ValueError:
            given[name] = value
    return given


def _print_epoch(epoch: Any) -> None:
    print(
        f"epoch {epoch.number:>3}: rate {epoch.learning_rate:.2e}, "
        f"training loss {epoch.train_loss:.4f} accuracy {epoch.train_accuracy:.4f}, "
        f"validation loss {epoch.validation_loss:.4f} accuracy {epoch.validation_accuracy:.4f}, "
        f"{epoch.seconds:.1f} s",
        flush=True,
    )
