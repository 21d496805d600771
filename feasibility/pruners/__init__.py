"""Pruners: they decide which candidate legs are worth a full optimisation.

| pruner | keeps a leg if |
|---|---|
| `KeepAll` | always |
| `LambertPruner` | its best Lambert delta-v is within the engine's means |
| `MimaPruner` | MIMA, a closed-form maximum initial mass, reaches its mass |
| `Mima2Pruner` | MIMA2, the same with gravity along the arc, reaches its mass |
| `ClassifierPruner` | a trained classifier thinks it likely enough, or does not know it |
| `AllOf` | all its pruners keep it, cheap ones asked first |

A pruner of one's own is any object with a method `keep(legs) -> (n,) bool` that
honours the contract of `Pruner`: row-wise, pure, picklable. `check_pruner`
tests just that and raises `PrunerContractError` with one line that says what is
wrong (`quick_check` does part of it in milliseconds):

>>> from dataclasses import dataclass
>>> import numpy as np
>>> @dataclass(frozen=True)
... class NearbyOnly:
...     limit_m: float
...     name = "nearby-only"
...     def keep(self, legs, /):
...         gap = legs.rv_arr[:, :3] - legs.rv_dep[:, :3]
...         return np.linalg.norm(gap, axis=1) < self.limit_m
>>> class Fickle:
...     def keep(self, legs, /):
...         return np.arange(len(legs)) % 2 == 0
>>> try:
...     check_pruner(Fickle())
... except PrunerContractError as error:
...     print(error)
Fickle.keep: not row-wise: a leg gets another answer when the legs are reversed

`NearbyOnly` passes (where its class can be imported, so that it can be pickled),
and goes wherever a pruner is asked for, also inside `AllOf`.

Any scikit-learn model is one with ten lines. `margin_features` gives inputs that fit any
spacecraft; add thrust over mass, which they leave out.

>>> from feasibility.classifier.margin.features import log_acceleration, margin_features
>>> @dataclass(frozen=True)
... class ModelPruner:
...     model: object  # fitted, with predict_proba(X) -> (n, 2)
...     threshold: float
...     name = "my-model"
...     def keep(self, legs, /):
...         X, hint = margin_features(legs)
...         X = np.column_stack([X, log_acceleration(legs, legs.m0) - hint])
...         known = np.isfinite(X).all(axis=1)
...         kept = ~known  # nothing is known against the others
...         if known.any():
...             kept[known] = self.model.predict_proba(X[known])[:, 1] >= self.threshold
...         return kept

An ONNX model takes the model's place there. Its session cannot be pickled, so the bytes of the
file travel; and it has to answer for each leg alone, as single precision sums depend on the
size of a batch.

>>> class OnnxModel:
...     def __init__(self, content):  # bytes of a classifier's .onnx file
...         from onnxruntime import InferenceSession
...         self.content, self.session = content, InferenceSession(content)
...     def __reduce__(self):
...         return OnnxModel, (self.content,)
...     def predict_proba(self, X):
...         name = self.session.get_inputs()[0].name
...         rows = X.astype(np.float32)[:, None]
...         return np.concatenate([self.session.run(None, {name: x})[-1] for x in rows])
"""

from feasibility.pruners.all_of import AllOf, pruner_name
from feasibility.pruners.asking import PrunerContractError
from feasibility.pruners.check import check_pruner, quick_check
from feasibility.pruners.classifier import ClassifierPruner
from feasibility.pruners.keep_all import KeepAll
from feasibility.pruners.lambert import LambertPruner
from feasibility.pruners.mima import Mima2Pruner, MimaPruner
from feasibility.pruners.protocol import Pruner

__all__ = [
    "AllOf",
    "ClassifierPruner",
    "KeepAll",
    "LambertPruner",
    "Mima2Pruner",
    "MimaPruner",
    "Pruner",
    "PrunerContractError",
    "check_pruner",
    "pruner_name",
    "quick_check",
]
