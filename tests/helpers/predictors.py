"""Predictors that several tests share."""

from dataclasses import dataclass

import numpy as np

from feasibility.classifier.predictor import lambert_final_mass


@dataclass(frozen=True)
class Toy:
    """A margin that grows with the flight time and falls with the change of speed and the mass."""

    bias: float = 0.0

    def margin(self, legs, /):
        speed_dep = np.linalg.norm(legs.rv_dep[:, 3:], axis=1)
        speed_arr = np.linalg.norm(legs.rv_arr[:, 3:], axis=1)
        gap = np.hypot(speed_arr - speed_dep, 300.0) / 3e3
        return 1300.0 / (legs.m0 * (0.3 + gap)) * (legs.tof_days / 150.0) ** 1.2

    def quick_margin(self, legs, /):
        return self.margin(legs) * np.exp(self.bias)

    def final_mass(self, legs, /):
        return lambert_final_mass(legs)
