"""Worth of a dataset: what a network that is trained on it does on real shapes."""
