"""The recipes in the documentation of `feasibility.pruners`, run as they stand there."""

import doctest
import sys
import types

import numpy as np
import pytest

from feasibility import AllOf, KeepAll, check_pruner, pruners
from feasibility.classifier.margin.features import log_acceleration, margin_features
from tests.helpers.labelled import labelled_dataset


@pytest.fixture(scope="module")
def recipes():
    """The module in which the examples of the documentation were run."""
    module = types.ModuleType("recipes")
    # Classes can be pickled only where they can be imported.
    sys.modules["recipes"] = module
    module.__dict__.update({name: getattr(pruners, name) for name in pruners.__all__})
    test = doctest.DocTestParser().get_doctest(pruners.__doc__, {}, "recipes", None, 0)
    test.globs = vars(module)
    module.failures = doctest.DocTestRunner().run(test, clear_globs=False).failed
    yield module
    del sys.modules["recipes"]


@pytest.fixture(scope="module")
def fitted():
    """Return a scikit-learn model fitted as the recipe has it, and its legs."""
    linear = pytest.importorskip("sklearn.linear_model")
    pipeline = pytest.importorskip("sklearn.pipeline")
    preprocessing = pytest.importorskip("sklearn.preprocessing")
    dataset = labelled_dataset()
    legs = dataset.legs
    X, hint = margin_features(legs)
    X = np.column_stack([X, log_acceleration(legs, legs.m0) - hint])
    model = pipeline.make_pipeline(
        preprocessing.StandardScaler(), linear.LogisticRegression(max_iter=500)
    )
    return model.fit(X, dataset.columns["log_margin"] >= 0), dataset


def test_the_examples_print_what_they_say(recipes):
    assert recipes.failures == 0


def test_a_pruner_of_ones_own_honours_the_contract_also_among_others(recipes):
    nearby = recipes.NearbyOnly(3e11)
    check_pruner(nearby)
    check_pruner(AllOf(KeepAll(), nearby))


def test_a_scikit_learn_model_is_a_pruner(recipes, fitted):
    model, dataset = fitted
    pruner = recipes.ModelPruner(model, 0.3)
    check_pruner(pruner)
    kept, feasible = pruner.keep(dataset.legs), dataset.columns["log_margin"] >= 0
    assert kept[feasible].mean() > 0.9
    assert kept[~feasible].mean() < 0.4


def test_an_onnx_model_is_a_pruner(recipes, fitted):
    pytest.importorskip("onnxruntime")
    skl2onnx = pytest.importorskip("skl2onnx")
    model, dataset = fitted
    columns = model[0].n_features_in_
    kind = skl2onnx.common.data_types.FloatTensorType([None, columns])
    network = skl2onnx.convert_sklearn(
        model, initial_types=[("X", kind)], options={"zipmap": False}
    )
    pruner = recipes.ModelPruner(recipes.OnnxModel(network.SerializeToString()), 0.3)
    check_pruner(pruner)
    same = pruner.keep(dataset.legs) == recipes.ModelPruner(model, 0.3).keep(dataset.legs)
    assert same.mean() > 0.995
