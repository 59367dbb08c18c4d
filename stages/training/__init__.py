"""Models that learn from a dataset: rounds that read each other, checkpoints, curves and cards; one folder a kind."""
