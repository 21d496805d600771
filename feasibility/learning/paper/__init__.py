"""Training the paper's models: balance, tuning, ranking of features."""
