"""The dataset folder that users load: merged shards, index, card, Croissant, manifest, checksums, preview."""
