"""A dataset as tables see it: its config, and what exists of it so far."""

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
    """The config of a dataset, and where the dataset is."""

    config: Config
    out: Path
    """The folder that holds all datasets."""
    workers: int = 1
    """Processes for tables of several models."""

    @property
    def folder(self) -> Path:
        """The finished dataset."""
        return self.out / self.config.name

    @property
    def models(self) -> Path:
        """The models trained on the dataset, one folder each."""
        return self.out / f"{self.config.name}-models"

    @property
    def corpus(self) -> Path:
        """The strings of its samples, one file for each kit and split."""
        return self.out / f"{self.config.name}-corpus"

    @property
    def results(self) -> Path:
        """The folder of its tables."""
        return self.out / f"{self.config.name}-eval"

    @property
    def paths(self) -> DatasetPaths:
        """The pipeline's folders of the dataset."""
        return DatasetPaths(self.out, self.config.name)

    @cached_property
    def manifest(self) -> Mapping[str, Any]:
        """The manifest of the finished dataset; empty without one."""
        path = self.folder / MANIFEST
        manifest: dict[str, Any] = json.loads(path.read_bytes()) if path.is_file() else {}
        return manifest

    @property
    def samples(self) -> int:
        """Samples of the finished dataset."""
        return int(self.manifest.get("samples", 0))


def load_dataset_run(config: Path, out: Path, workers: int = 1) -> DatasetRun:
    """Read the config of a dataset. Raises ConfigError for an invalid one."""
    sections = {name: stage.config for name, stage in find_stages().items()}
    return DatasetRun(load_config(config, sections), out, workers)
