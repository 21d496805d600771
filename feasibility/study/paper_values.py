"""The paper's own figures, printed beside ours.

Source of every number: Xie & Dempster, "Feasible low-thrust trajectory
identification via a deep neural network classifier"; the table or figure is
named with each constant.
"""

from typing import Final

METRICS: Final = ("accuracy", "precision", "recall", "f1", "f10", "auc")
"""The figures of merit of Table 6, in its order (equations 11 to 14, trapezoidal AUC)."""

TABLE_6: Final[dict[str, tuple[float, ...]]] = {
    "ensemble": (0.9108, 0.8967, 0.9285, 0.9123, 0.9282, 0.9649),
    "knn": (0.8018, 0.7565, 0.8900, 0.8178, 0.8884, 0.8823),
    "svm": (0.8385, 0.8348, 0.8440, 0.8394, 0.8439, 0.9135),
    "tree": (0.8723, 0.8751, 0.8685, 0.8718, 0.8686, 0.9427),
    "dnn1": (0.9790, 0.9707, 0.9877, 0.9792, 0.9876, 0.9953),
    "dnn2": (0.9522, 0.9430, 0.9625, 0.9526, 0.9623, 0.9864),
}
"""Table 6: final comparison on balanced data, columns as `METRICS`."""

TABLE_6_SAMPLES: Final[dict[str, int]] = {
    "ensemble": 50_000,
    "knn": 50_000,
    "svm": 30_000,
    "tree": 50_000,
    "dnn1": 400_000,
    "dnn2": 400_000,
}
"""Training samples behind Table 6."""

TABLE_6_ORDER: Final = ("dnn1", "dnn2", "ensemble", "tree", "svm", "knn")
"""Models of Table 6 by falling accuracy."""

TABLE_4: Final[dict[int, tuple[float, float]]] = {
    30: (0.9622, 0.9922),
    40: (0.9739, 0.9950),
    50: (0.9735, 0.9951),
    55: (0.9744, 0.9951),
    60: (0.9751, 0.9953),
    65: (0.9741, 0.9950),
    70: (0.9730, 0.9948),
    103: (0.9522, 0.9864),
}
"""Table 4: accuracy and AUC of the network by number of features."""

FIGURE_3: Final[dict[str, dict[int, float]]] = {
    "ensemble": {20_000: 0.91, 50_000: 0.9108},
    "dnn1": {20_000: 0.87, 30_000: 0.91, 400_000: 0.9790},
    "knn": {50_000: 0.8018},
    "svm": {30_000: 0.8385},
    "tree": {50_000: 0.8723},
}
"""Fig. 3: accuracy by training samples, as far as the text says (last value: Table 6)."""

FIGURE_3_ELBOW: Final[dict[str, str]] = {
    "ensemble": "near 20 000",
    "knn": "near 20 000",
    "tree": "near 20 000",
    "svm": "near 10 000",
    "dnn1": "above 400 000",
}
"""Fig. 3: where accuracy stops growing."""

FIGURE_9_HOURS: Final = {"sequential": 17.0, "parallel": 2.7}
"""Fig. 9: hours of 30 evaluations, one after another and in parallel."""

FIGURE_9_TRIALS: Final = 30
"""Fig. 9: evaluations within which the optimum was found."""

RECALL_LOSS_OF_BIAS: Final = 0.06
"""Fig. 7: recall lost by the network (50 000 feasible, 250 000 not); negligible with ADASYN."""

ACCURACY_LOSS_OF_ADASYN: Final = 0.01
"""Fig. 7: accuracy and precision lost by the network when the data are augmented."""

SELECTED_FEATURES: Final = 60
"""Features kept after the ranking of Fig. 2."""

FEASIBLE_SHARE: Final = 0.07
"""Share of random pairs whose optimisation converges."""
