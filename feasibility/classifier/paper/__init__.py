"""The paper's models as they are asked: 103 features and predictors without scikit-learn."""
