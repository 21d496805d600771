"""How large a study is: sizes, seeds and trials of the presets."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, final

from feasibility.errors import InputError
from feasibility.runtime.toml_file import convert_table, parse_toml, read_toml_text

BASELINES: Final = ("ensemble", "knn", "svm", "tree")
"""The models that are compared with the network."""

NETWORKS: Final = ("dnn1", "dnn2")
"""The two networks of Table 5: 60 and 103 features."""

MODELS: Final = (*BASELINES, *NETWORKS)
"""All models of Table 6."""


@final
@dataclass(frozen=True)
class Preset:
    """Sizes, seeds and trials of every experiment.

    A size that the data cannot give is replaced by the largest they can.

    Attributes
    ----------
    name : str
        Name of the preset.
    legs : int
        Legs that are generated where no dataset is given.
    test_share : float
        Share of the legs held out, by pairs of bodies.
    test_rows : int
        Most test legs, after balancing.
    epochs : int
        Epochs of a network.
    least_steps : int
        Least steps of a network: epochs are added where the training set is small.
    data_size : mapping of str to tuple of int
        Fig. 3: training sizes of each model (balanced).
    data_size_seeds : int
        Fig. 3: draws of the training set for each size.
    margin_sizes : tuple of int
        Fig. 3: training sizes of the margin model, some of DNN1's; Table 6 has the largest.
    comparison : mapping of str to int
        Table 6: training size of each model.
    comparison_seeds : int
        Table 6: draws of the training set.
    large, large_seeds : int
        Fig. 3 and Table 6: training sets of this size and above get at most this number of draws.
    n_features : tuple of int
        Table 4: numbers of features.
    n_features_rows, n_features_folds : int
        Table 4: legs shared by the folds, and how many of five folds are used in turn.
    curve_rows, curve_seeds : int
        Fig. 8: training legs and draws.
    feasible : mapping of str to int
        Figs 4 to 7: feasible training legs of each model.
    ratios : tuple of float
        Figs 4 to 7: infeasible legs for each feasible one.
    imbalance_seeds : int
        Figs 4 to 7: draws of the training set.
    tuning_model : str
        Fig. 9: model whose hyperparameters are optimised.
    tuning_rows, tuning_trials, tuning_epochs, tuning_workers : int
        Fig. 9: legs, trials, epochs of a trial and parallel workers.
    ranking_seeds : int
        Fig. 2: forests whose importances are averaged.
    label_legs : int
        Legs that get the paper's label too, two starts each.
    label_models : tuple of str
        Models trained on either label.
    """

    name: str
    legs: int
    test_share: float
    test_rows: int
    epochs: int
    least_steps: int
    data_size: Mapping[str, tuple[int, ...]]
    data_size_seeds: int
    margin_sizes: tuple[int, ...]
    comparison: Mapping[str, int]
    comparison_seeds: int
    large: int
    large_seeds: int
    n_features: tuple[int, ...]
    n_features_rows: int
    n_features_folds: int
    curve_rows: int
    curve_seeds: int
    feasible: Mapping[str, int]
    ratios: tuple[float, ...]
    imbalance_seeds: int
    tuning_model: str
    tuning_rows: int
    tuning_trials: int
    tuning_epochs: int
    tuning_workers: int
    ranking_seeds: int
    label_legs: int
    label_models: tuple[str, ...]

    def seeds(self, wanted: int, samples: int) -> range:
        """Return the seeds of a training set: `wanted` of them, fewer where it is large."""
        return range(min(wanted, self.large_seeds) if samples >= self.large else wanted)

    def to_dict(self) -> dict[str, Any]:
        """Return every setting as plain data."""
        return asdict(self)


def _same(sizes: tuple[int, ...], *models: str) -> dict[str, tuple[int, ...]]:
    return dict.fromkeys(models, sizes)


_TABLE_4_COUNTS: Final = (30, 40, 50, 55, 60, 65, 70, 103)

_QUICK: Final = Preset(
    name="quick",
    legs=6000,
    test_share=0.2,
    test_rows=2000,
    epochs=12,
    least_steps=100,
    data_size=_same((250, 500, 1000, 2000), "ensemble", "knn", "svm", "tree", "dnn1"),
    data_size_seeds=3,
    margin_sizes=(500, 2000),
    comparison=dict.fromkeys(MODELS, 2000),
    comparison_seeds=3,
    large=400_000,
    large_seeds=3,
    n_features=_TABLE_4_COUNTS,
    n_features_rows=1000,
    n_features_folds=2,
    curve_rows=1500,
    curve_seeds=2,
    feasible=dict.fromkeys((*BASELINES, "dnn1"), 400),
    ratios=(1.0, 2.0, 4.0),
    imbalance_seeds=2,
    tuning_model="dnn",
    tuning_rows=2000,
    tuning_trials=6,
    tuning_epochs=20,
    tuning_workers=2,
    ranking_seeds=3,
    label_legs=80,
    label_models=("ensemble", "tree"),
)

_LAPTOP: Final = Preset(
    name="laptop",
    legs=640_000,
    test_share=0.06,
    test_rows=20_000,
    epochs=14,
    least_steps=600,
    data_size={
        **_same((1000, 2000, 5000, 10_000, 20_000, 50_000), "ensemble", "knn", "tree"),
        "svm": (1000, 2000, 5000, 10_000, 20_000, 30_000),
        "dnn1": (1000, 5000, 20_000, 100_000, 400_000),
    },
    data_size_seeds=3,
    margin_sizes=(5000, 20_000),
    comparison={
        "ensemble": 50_000,
        "knn": 50_000,
        "svm": 30_000,
        "tree": 50_000,
        "dnn1": 400_000,
        "dnn2": 400_000,
    },
    comparison_seeds=3,
    large=400_000,
    large_seeds=3,
    n_features=_TABLE_4_COUNTS,
    n_features_rows=20_000,
    n_features_folds=3,
    curve_rows=20_000,
    curve_seeds=3,
    feasible=dict.fromkeys((*BASELINES, "dnn1"), 3000),
    ratios=(1.0, 2.0, 5.0),
    imbalance_seeds=3,
    tuning_model="dnn",
    tuning_rows=5000,
    tuning_trials=30,
    tuning_epochs=10,
    tuning_workers=2,
    ranking_seeds=5,
    label_legs=400,
    label_models=("ensemble", "tree"),
)

_PAPER: Final = Preset(
    name="paper",
    legs=720_000,
    test_share=0.06,
    test_rows=40_000,
    epochs=40,
    least_steps=1000,
    data_size={
        **_same((1000, 2000, 5000, 10_000, 20_000, 30_000, 50_000), "ensemble", "knn", "tree"),
        "svm": (1000, 2000, 5000, 10_000, 20_000, 30_000),
        "dnn1": (1000, 5000, 10_000, 20_000, 30_000, 50_000, 100_000, 200_000, 400_000),
    },
    data_size_seeds=5,
    margin_sizes=(5000, 20_000, 100_000, 400_000),
    comparison={
        "ensemble": 50_000,
        "knn": 50_000,
        "svm": 30_000,
        "tree": 50_000,
        "dnn1": 400_000,
        "dnn2": 400_000,
    },
    comparison_seeds=5,
    large=400_000,
    large_seeds=5,
    n_features=_TABLE_4_COUNTS,
    n_features_rows=400_000,
    n_features_folds=5,
    curve_rows=400_000,
    curve_seeds=3,
    feasible={"ensemble": 10_000, "knn": 10_000, "svm": 10_000, "tree": 10_000, "dnn1": 45_000},
    ratios=(1.0, 2.0, 3.0, 4.0, 5.0),
    imbalance_seeds=3,
    tuning_model="dnn",
    tuning_rows=50_000,
    tuning_trials=30,
    tuning_epochs=16,
    tuning_workers=8,
    ranking_seeds=5,
    label_legs=20_000,
    label_models=("ensemble", "tree", "dnn1"),
)

PRESETS: Final[Mapping[str, Preset]] = {
    preset.name: preset for preset in (_QUICK, _LAPTOP, _PAPER)
}
"""The presets by name: minutes, at most six hours on 2 cores, and the paper's sizes."""


def find_preset(name: str) -> Preset:
    """Return a preset by name, or read one from a TOML file.

    A file names the preset it starts from as ``base`` and sets what differs; a
    table such as ``[data_size]`` changes the models it names.

    Raises
    ------
    InputError
        No preset or file has that name, or the file has an unknown key or a wrong value.
    """
    if name in PRESETS:
        return PRESETS[name]
    path = Path(name)
    if not path.is_file():
        raise InputError(f"--preset {name}: expected one of {', '.join(PRESETS)}, or a TOML file")
    given = parse_toml(read_toml_text(path), str(path))
    base = given.pop("base", "quick")
    if base not in PRESETS:
        raise InputError(f"{path}: base = {base!r}, expected one of {', '.join(PRESETS)}")
    settings = {**PRESETS[base].to_dict(), "name": path.stem}
    for key, value in given.items():
        if key not in settings or key == "name":
            raise InputError(f"{path}: unknown key {key!r}; known keys are {', '.join(settings)}")
        known = settings[key]
        settings[key] = {**known, **value} if isinstance(known, dict) else value
    return convert_table(settings, Preset, str(path))
