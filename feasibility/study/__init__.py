"""The paper's experiments, each in a file of its own, repeated by ``feasibility study``."""

from typing import Final

EXPERIMENTS: Final = {
    "importance": "which features matter (Fig. 2)",
    "data_size": "accuracy by training size (Fig. 3)",
    "n_features": "how many features (Table 4)",
    "training_curves": "training with and without selection (Fig. 8)",
    "imbalance": "imbalance and ADASYN (Figs 4 to 7)",
    "optimisation": "Bayesian optimisation: history and time (Fig. 9)",
    "labels": "the paper's label beside ours",
    "comparison": "all models (Table 6, Fig. 10)",
}
"""The experiments in the order in which they are run; each is a module of this package."""
