"""The five models: they learn, they repeat themselves, and arrays predict as the libraries do."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from feasibility import InputError, MissingDependencyError
from feasibility.evaluation.metrics import auc
from feasibility.learning.paper.feature_ranking import rank_features
from feasibility.learning.paper.models import DNN1, DNN2, KINDS, StopTraining, make_model
from feasibility.learning.paper.models.dnn import DnnConfig
from feasibility.learning.paper.models.precision import resolve_precision

pytest.importorskip("sklearn")
torch = pytest.importorskip("torch")

SMALL = {
    "dnn": {"layers": 3, "width": 40, "batch": 100, "epochs": 6, "threads": 1},
    "ensemble": {"max_iter": 40},
    "knn": {"neighbours": 7},
    "svm": {},
    "tree": {},
}


def examples(n=1500, k=8):
    """Return features of which the first three decide, with some noise."""
    rng = np.random.default_rng(0)
    X = rng.normal(size=(n, k))
    y = X[:, 0] * X[:, 1] + X[:, 2] + 0.3 * rng.normal(size=n) > 0
    return X, y


X, Y = examples()
TRAIN, TEST = slice(0, 1000), slice(1000, None)


def fitted(kind, seed=1, **changes):
    model = make_model(kind, **{**SMALL[kind], **changes})
    return model.fit(X[TRAIN], Y[TRAIN], rng=np.random.default_rng(seed))


@pytest.fixture(scope="module", params=KINDS)
def model(request):
    return fitted(request.param)


def test_every_model_learns(model):
    probability = model.predict_probability(X[TEST])
    assert probability.shape == (500,)
    assert ((probability >= 0) & (probability <= 1)).all()
    assert auc(Y[TEST], probability) > 0.8


def test_the_same_seed_gives_the_same_model(model):
    again = fitted(model.kind)
    assert np.array_equal(again.predict_probability(X[TEST]), model.predict_probability(X[TEST]))


def test_a_leg_has_the_same_probability_alone_and_among_others(model):
    together = model.predict_probability(X[TEST])
    assert np.array_equal(model.predict_probability(X[TEST][::-1])[::-1], together)
    for row in (0, 77, 499):
        assert model.predict_probability(X[TEST][row : row + 1])[0] == together[row]
    assert model.predict_probability(X[:0]).shape == (0,)


def test_arrays_need_no_pickle(model):
    assert all(array.dtype != object for array in model.to_arrays().values())


def libraries_probability(model):
    """Return what the library itself predicts, fitted in the same way."""
    from sklearn.ensemble import HistGradientBoostingClassifier
    from sklearn.neighbors import KNeighborsClassifier
    from sklearn.svm import SVC
    from sklearn.tree import DecisionTreeClassifier
    from threadpoolctl import threadpool_limits

    arrays = model.to_arrays()
    rng = np.random.default_rng(1)
    if model.kind == "dnn":
        layers = []
        for i in range(4):
            weight, bias = (torch.tensor(arrays[f"{name}_{i}"]) for name in ("weight", "bias"))
            linear = torch.nn.Linear(weight.shape[1], weight.shape[0])
            linear.load_state_dict({"weight": weight, "bias": bias})
            layers += [linear, torch.nn.LeakyReLU()]
        with torch.no_grad():
            logits = torch.nn.Sequential(*layers[:-1])(torch.tensor(X[TEST]).float())
        return torch.softmax(logits.double(), dim=1).numpy()[:, 1]
    if model.kind == "svm":
        machine = SVC(C=10.0, gamma=1 / 8)
        # The machine has seen nine tenths; its support vectors alone define it.
        coefficients = arrays["coefficients"]
        machine.fit(arrays["vectors"], coefficients > 0)
        distance = ((X[TEST][:, None] - arrays["vectors"]) ** 2).sum(axis=2)
        decision = np.exp(-distance / 8) @ coefficients + arrays["intercept"]
        assert np.allclose(np.abs(coefficients).max(), 10.0)
        assert np.mean((machine.decision_function(X[TEST]) > 0) == (decision > 0)) > 0.99
        slope, offset = arrays["sigmoid"]
        return 1 / (1 + np.exp(-slope * decision - offset))
    estimator = {
        "ensemble": lambda: HistGradientBoostingClassifier(
            max_iter=40, early_stopping=False, random_state=int(rng.integers(2**31))
        ),
        "knn": lambda: KNeighborsClassifier(7, weights="distance"),
        "tree": lambda: DecisionTreeClassifier(
            min_samples_leaf=5, random_state=int(rng.integers(2**31))
        ),
    }[model.kind]()
    single = X.astype(np.float32) if model.kind == "ensemble" else X
    # Beside other work, threads that wait for each other make this test ten times slower.
    with threadpool_limits(1):
        return estimator.fit(single[TRAIN], Y[TRAIN]).predict_proba(single[TEST])[:, 1]


def test_arrays_predict_what_the_library_predicts(model):
    expected = libraries_probability(model)
    assert np.abs(model.predict_probability(X[TEST]) - expected).max() < 1e-6


@pytest.mark.parametrize("activation", ["relu", "elu"])
def test_other_activations_predict_what_torch_predicts(activation):
    arrays = fitted("dnn", activation=activation).to_arrays()
    function = {"relu": torch.relu, "elu": torch.nn.functional.elu}[activation]
    x = torch.tensor(X[TEST]).float()
    for i in range(4):
        x = x @ torch.tensor(arrays[f"weight_{i}"]).T + torch.tensor(arrays[f"bias_{i}"])
        x = function(x) if i < 3 else x
    expected = torch.softmax(x.double(), dim=1).numpy()[:, 1]
    probability = fitted("dnn", activation=activation).predict_probability(X[TEST])
    assert np.abs(probability - expected).max() < 1e-6


def test_uniform_votes_are_shares():
    votes = fitted("knn", neighbours=5, weighting="uniform").predict_probability(X[TEST])
    assert set(np.round(5 * votes, 9)) <= {0, 1, 2, 3, 4, 5}


def test_a_training_row_outvotes_all_others():
    model = fitted("knn")
    assert np.array_equal(model.predict_probability(X[TRAIN]) > 0.5, Y[TRAIN])


def test_the_rate_falls_stepwise():
    config = DnnConfig(learning_rate=0.01, drop_period=3, drop_factor=0.5)
    assert [config.rate(epoch) for epoch in (1, 3, 4, 7)] == [0.01, 0.01, 0.005, 0.0025]


def test_the_presets_are_those_of_table_5():
    assert make_model("dnn1").config == make_model("dnn", **DNN1).config
    config = make_model("dnn2").config
    assert {name: config[name] for name in DNN2} == DNN2
    assert make_model("dnn2", epochs=3).config["epochs"] == 3


def train_network(tmp_path: Path | None, epochs: int, seen: list | None = None, **changes):
    model = make_model("dnn", **{**SMALL["dnn"], "epochs": epochs, **changes})
    return model.fit(
        X[TRAIN],
        Y[TRAIN],
        rng=np.random.default_rng(1),
        X_val=X[TEST],
        y_val=Y[TEST],
        on_epoch=None if seen is None else seen.append,
        checkpoint=None if tmp_path is None else tmp_path / "net.checkpoint",
    )


def test_a_resumed_training_ends_as_an_uninterrupted_one(tmp_path):
    whole = train_network(None, 6)
    train_network(tmp_path, 2)
    seen: list = []
    resumed = train_network(tmp_path, 6, seen)
    assert [epoch.number for epoch in seen] == [3, 4, 5, 6]
    for name, array in whole.to_arrays().items():
        assert np.array_equal(resumed.to_arrays()[name], array)


def test_a_checkpoint_of_another_training_or_damaged_is_refused(tmp_path):
    train_network(tmp_path, 1)
    with pytest.raises(InputError, match="another training"):
        train_network(tmp_path, 2, width=41)
    path = tmp_path / "net.checkpoint"
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(InputError, match="damaged"):
        train_network(tmp_path, 2)


def test_validation_rows_do_not_change_the_training():
    with_rows = train_network(None, 3).to_arrays()
    without = fitted("dnn", epochs=3).to_arrays()
    assert all(np.array_equal(with_rows[name], without[name]) for name in without)


def test_early_stopping_keeps_the_best_weights():
    seen: list = []
    changes = {"learning_rate": 0.02, "drop_factor": 1.0, "patience": 2, "keep_best": True}
    model = train_network(None, 60, seen, **changes)
    losses = [epoch.validation_loss for epoch in seen]
    best = int(np.argmin(losses))
    assert len(seen) == best + 1 + 2 < 60
    accuracy = np.mean((model.predict_probability(X[TEST]) > 0.5) == Y[TEST])
    assert accuracy == pytest.approx(seen[best].validation_accuracy, abs=0.003)


def test_a_callback_may_stop_the_training():
    def stop(epoch):
        if epoch.number == 2:
            raise StopTraining

    model = make_model("dnn", **SMALL["dnn"])
    model.fit(X[TRAIN], Y[TRAIN], rng=np.random.default_rng(1), on_epoch=stop)
    two = fitted("dnn", epochs=2).to_arrays()
    assert np.array_equal(model.to_arrays()["weight_0"], two["weight_0"])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: make_model("forest"), "forest"),
        (lambda: make_model("tree", depth=3), "depth"),
        (lambda: make_model("dnn", activation="sine"), "sine"),
        (lambda: make_model("dnn", width=0), "width"),
        (lambda: make_model("dnn", precision="float8"), "float8"),
        (lambda: make_model("knn", neighbours=0), "neighbours"),
        (lambda: make_model("knn", weighting="odd"), "weighting"),
        (lambda: make_model("svm").predict_probability(X), "not fitted"),
        (lambda: fitted("dnn", patience=2), "validation"),
        (lambda: fitted("dnn", device="abacus"), "abacus"),
        (lambda: make_model("tree").fit(X, Y[:3], rng=np.random.default_rng()), r"\(3,\)"),
        (lambda: make_model("tree").fit(X, Y | True, rng=np.random.default_rng()), "one class"),
        (lambda: make_model("tree").fit(X * np.nan, Y, rng=np.random.default_rng()), "finite"),
    ],
)
def test_what_cannot_be_done_is_refused_in_one_line(call, message):
    with pytest.raises(InputError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_a_baseline_learns_from_no_more_rows_than_it_may():
    assert len(fitted("knn", max_samples=100).to_arrays()["rows"]) == 100


def test_a_missing_package_is_named_with_its_extra(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "sklearn.tree", None)
    with pytest.raises(MissingDependencyError, match=r"scikit-learn.*seqsearch\[train\]"):
        fitted("tree")


def test_the_ranking_finds_the_features_that_decide():
    order, importance = rank_features(X, Y, np.random.default_rng(0))
    assert set(order[:3]) == {0, 1, 2}
    assert (np.diff(importance[order]) <= 0).all()
    assert (importance >= 0).all()


def test_importance_of_one_split_is_the_decrease_of_risk():
    from sklearn.tree import DecisionTreeClassifier

    from feasibility.learning.paper.feature_ranking import tree_importance

    points = np.array([[0.0, 0], [1, 0], [2, 0], [3, 0]])
    tree = DecisionTreeClassifier().fit(points, [False, False, True, True])
    assert np.allclose(tree_importance(tree.tree_, 2), [0.5, 0.0])


def pretend(monkeypatch, **answers):
    """Let torch answer as on other hardware, or in a version that has other names for it."""
    monkeypatch.setattr(torch, "cpu", SimpleNamespace(**answers))


@pytest.mark.parametrize(
    ("answers", "expected"),
    [
        ({"get_capabilities": lambda: {"amx_bf16": True}}, "bfloat16"),
        ({"get_capabilities": lambda: {"amx_bf16": False}}, "float32"),
        ({"get_capabilities": lambda: {"neon": True}}, "float32"),
        ({"_is_amx_tile_supported": lambda: True}, "bfloat16"),
        ({"_is_amx_tile_supported": lambda: False}, "float32"),
        ({}, "float32"),
    ],
)
def test_the_precision_follows_the_processor_and_falls_back(monkeypatch, answers, expected):
    pretend(monkeypatch, **answers)
    assert resolve_precision(torch, "auto", "cpu") == expected
    assert resolve_precision(torch, "float32", "cpu") == "float32"
    assert resolve_precision(torch, "bfloat16", "cpu") == "bfloat16"


@pytest.mark.parametrize(("capability", "expected"), [((9, 0), "bfloat16"), ((7, 5), "float32")])
def test_the_precision_follows_the_gpu(monkeypatch, capability, expected):
    monkeypatch.setattr(torch.cuda, "get_device_capability", lambda: capability)
    assert resolve_precision(torch, "auto", "cuda") == expected


def test_without_tiles_a_network_is_trained_in_single_precision(monkeypatch):
    single = fitted("dnn", precision="float32")
    pretend(monkeypatch)
    automatic = fitted("dnn", precision="auto")
    assert automatic.config["precision"] == "float32"
    for name, array in single.to_arrays().items():
        assert np.array_equal(automatic.to_arrays()[name], array)


def test_bfloat16_rounds_the_training_but_not_what_is_kept():
    single, rounded = (fitted("dnn", precision=p, epochs=30) for p in ("float32", "bfloat16"))
    assert rounded.config["precision"] == "bfloat16"
    arrays = rounded.to_arrays()
    assert all(arrays[f"weight_{i}"].dtype == np.float32 for i in range(4))
    assert not np.array_equal(arrays["weight_0"], single.to_arrays()["weight_0"])
    # bfloat16 has 8 binary digits; the kept weights have more.
    assert np.any(arrays["weight_1"].view(np.uint32) & 0xFFFF)
    scores = [auc(Y[TEST], model.predict_probability(X[TEST])) for model in (single, rounded)]
    assert scores[1] == pytest.approx(scores[0], abs=0.02)
