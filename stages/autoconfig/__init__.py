"""Settings that a config leaves at `auto`, resolved from geometry and short trial searches."""
