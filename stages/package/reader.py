"""Finished datasets, sample by sample."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.errors import ConfigError
from pipeline.shards import read_shard
from stages.package.dataset_sample import DatasetSample
from stages.package.layout import CLASSES, MANIFEST
from stages.package.locations import file_system, index_location
from stages.package.split import DatasetSplit

SPLITS = ("train", "val", "test")


@dataclass(frozen=True)
class Dataset:
    """A finished dataset.

    location: path or URL of the folder that holds `manifest.json`.
    manifest: name, version, seed, counts, config and versions.
    classes: the part label of each class id.
    """

    location: str
    manifest: Mapping[str, Any]
    classes: tuple[str, ...]

    @classmethod
    def open(cls, location: str | Path) -> Dataset:
        """Open the dataset in a folder or at a URL. Raises ConfigError where there is no finished dataset."""
        files, root = file_system(str(location))
        try:
            manifest = json.loads(files.cat_file(f"{root}/{MANIFEST}"))
            listed = json.loads(files.cat_file(f"{root}/{CLASSES}"))
        except FileNotFoundError:
            remedy = "make it with `make dataset`, or name the folder that holds it"
            raise ConfigError(f"{location} is no finished dataset: it has no {MANIFEST}; {remedy}") from None
        except (OSError, json.JSONDecodeError) as error:
            raise ConfigError(f"{location} is no finished dataset: {error}; make it with `make dataset`") from None
        return cls(str(location), manifest, tuple(entry["name"] for entry in listed))

    def __len__(self) -> int:
        return int(self.manifest["samples"])

    def samples(self, split: str = "") -> Iterator[DatasetSample]:
        """Yield the samples of one split, or of all, in the order of the shards; one is in memory at a time."""
        files, root = file_system(self.location)
        for name in (_checked(split),) if split else SPLITS:
            for path in sorted(files.glob(f"{root}/data/{name}/*.tar")):
                with files.open(path, "rb") as stream:
                    for key, members in read_shard(stream):
                        yield DatasetSample(key, name, members)

    def split(self, name: str) -> DatasetSplit:
        """Return one split with random access, a map-style dataset for torch.

        Raises ValueError for another word than a split's, and ConfigError where the index cannot be read.
        """
        index = index_location(self.location, str(self.manifest["index"]["path"]))
        return DatasetSplit(self.location, index, _checked(name))

    def __iter__(self) -> Iterator[DatasetSample]:
        return self.samples()


def _checked(split: str) -> str:
    if split not in SPLITS:
        raise ValueError(f"{split!r} is no split; take one of {', '.join(SPLITS)}")
    return split
