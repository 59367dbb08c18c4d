"""Paths of the files of a dataset below the output folder."""

from __future__ import annotations

from pipeline.config import Config

CARD = "README.md"
CROISSANT = "croissant.json"
MANIFEST = "manifest.json"
SCHEMA = "schema.json"
CLASSES = "classes.json"
CHECKSUMS = "checksums.txt"
PREVIEW = "preview.png"
VERIFIER = "verify.py"
INDEX = "index"
"""Name of the index in `croissant.json`."""


def shard_path(config: Config, split: str, index: int) -> str:
    """Return the path of a shard in the dataset's folder: `data/train/castle-1_0_0-train-000007.tar`.

    The name holds the version because mlcroissant caches unpacked files by name; it has no dots, since loaders split
    names at dots.
    """
    version = config.version.replace(".", "_")
    return f"data/{split}/{config.name}-{version}-{split}-{index:06d}.tar"


def index_path(config: Config) -> str:
    """Return the path of the index in the output folder; `load_dataset` reads one format per folder."""
    return f"{config.name}-index/{config.name}.parquet"
