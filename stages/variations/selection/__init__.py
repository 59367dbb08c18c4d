"""The selection of samples from the pool: diverse ones, in splits that no near relatives share, and their shards."""
