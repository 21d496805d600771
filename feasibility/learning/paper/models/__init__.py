"""The paper's five classifiers behind one face."""

from feasibility.learning.paper.models.base import Epoch, Model
from feasibility.learning.paper.models.make import (
    DNN1,
    DNN2,
    KINDS,
    PRESETS,
    make_model,
)
from feasibility.learning.training_loop import StopTraining

__all__ = ["DNN1", "DNN2", "KINDS", "PRESETS", "Epoch", "Model", "StopTraining", "make_model"]
