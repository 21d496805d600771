"""Training: the margin model and the paper's five classifiers, from datasets to models as files.

Needs the extra ``train`` (torch, scikit-learn, imbalanced-learn, optuna), imported where it is
used. Asking the models that come of it needs none of them: `feasibility.classifier`.
"""
