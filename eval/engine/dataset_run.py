"""What tables are about: a config, and whatever has been made of it so far."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from pipeline.config import Config, load_config
from pipeline.paths import DatasetPaths
from pipeline.registry import find_stages
from stages.package.layout import MANIFEST


@dataclass(frozen=True)
class DatasetRun:
    """config: the dataset's; out: the folder that datasets are made in."""

    config: Config
    out: Path

    @property
    def folder(self) -> Path:
        """The finished dataset."""
        return self.out / self.config.name

    @property
    def models(self) -> Path:
        """The folder of what was trained on the dataset, a folder a model."""
        return self.out / f"{self.config.name}-models"

    @property
    def corpus(self) -> Path:
        """The strings of its samples, a file for each kit and split."""
        return self.out / f"{self.config.name}-corpus"

    @property
    def results(self) -> Path:
        """Where tables about the dataset are kept."""
        return self.out / f"{self.config.name}-eval"

    @property
    def paths(self) -> DatasetPaths:
        """The mill's folders of the dataset."""
        return DatasetPaths(self.out, self.config.name)

    @cached_property
    def manifest(self) -> Mapping[str, Any]:
        """What the finished dataset says of itself, empty where none stands."""
        path = self.folder / MANIFEST
        described: dict[str, Any] = json.loads(path.read_bytes()) if path.is_file() else {}
        return described

    @property
    def samples(self) -> int:
        """Samples of the finished dataset."""
        return int(self.manifest.get("samples", 0))


def load_dataset_run(config: Path, out: Path) -> DatasetRun:
    """The subject of a config file. Raises ConfigError for a config that is not valid."""
    return DatasetRun(load_config(config, {name: stage.config for name, stage in find_stages().items()}), out)
