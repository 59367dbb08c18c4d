"""Where each file of a dataset stands below the output folder."""

from __future__ import annotations

from pipeline.config import Config

CARD = "README.md"
CROISSANT = "croissant.json"
MANIFEST = "manifest.json"
SCHEMA = "schema.json"
CLASSES = "classes.json"
CHECKSUMS = "checksums.txt"
PREVIEW = "preview.png"


def shard_path(config: Config, split: str, index: int) -> str:
    """A shard, relative to the dataset's folder: `data/train/castle-1_0_0-train-000007.tar`.

    The version stands in the name because mlcroissant keeps what it has unpacked by name; without dots, because
    loaders cut names at dots.
    """
    version = config.version.replace(".", "_")
    return f"data/{split}/{config.name}-{version}-{split}-{index:06d}.tar"


def index_path(config: Config) -> str:
    """The index, relative to the output folder: a folder of its own, since `load_dataset` reads one format a folder."""
    return f"{config.name}-index/{config.name}.parquet"
