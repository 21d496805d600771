"""Learning: features, models, balance, tuning and the artefact that a search loads.

Floor 5 of the house. Training needs the extra ``train`` (torch, scikit-learn,
imbalanced-learn, optuna), imported where it is used; features, artefacts and
prediction from them need numpy, scipy and numba alone.
"""
