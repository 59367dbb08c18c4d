"""One dataset of many producers: their samples joined, without near copies between splits, and mixed into shards."""
