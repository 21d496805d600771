"""The paper's five classifiers behind one face."""

from feasibility.learning.paper.models.base import Epoch, Model, StopTraining
from feasibility.learning.paper.models.make import (
    DNN1,
    DNN2,
    KINDS,
    PRESETS,
    make_model,
)

__all__ = ["DNN1", "DNN2", "KINDS", "PRESETS", "Epoch", "Model", "StopTraining", "make_model"]
