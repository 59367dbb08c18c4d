"""The collection of a dataset as the stages after its producer see it; no stage of its own."""
