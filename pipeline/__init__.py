"""The engine: configuration, plans, shards, workers, provenance and progress. Knows no geometry."""
