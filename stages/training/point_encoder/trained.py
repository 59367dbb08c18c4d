"""A trained encoder of point clouds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import torch

from stages.shape.arrays import FloatArray
from stages.training.checkpoint import load_module
from stages.training.point_encoder.clouds import scaled_to_diagonal
from stages.training.point_encoder.network import PointEncoder
from stages.training.point_encoder.settings import PointEncoderConfig


@dataclass(frozen=True)
class TrainedPointEncoder:
    """An encoder with its header. `module` is a network to train on: clouds of diagonal 1 to embeddings."""

    module: PointEncoder
    header: Mapping[str, Any]

    @torch.no_grad()
    def embed(self, points: FloatArray) -> npt.NDArray[np.float32]:
        """Embed a cloud float (n, 3) of any place and size, y up: unit vectors float32 (n, 32).

        Points of one part lie close together. It was trained on clouds of some 1,000 points.
        Raises ValueError for an array of another shape, without points, or with numbers that are not finite.
        """
        embedded: npt.NDArray[np.float32] = self.module(_one_cloud(points))[0].numpy()
        return embedded

    @torch.no_grad()
    def describe(self, points: FloatArray) -> npt.NDArray[np.float32]:
        """Describe a cloud as a whole, for classifiers and searches: float32 (128,). Takes and raises as `embed`."""
        description: npt.NDArray[np.float32] = self.module.describe(_one_cloud(points))[0].numpy()
        return description


def _one_cloud(points: FloatArray) -> torch.Tensor:
    cloud = np.asarray(points, np.float64)
    if cloud.ndim != 2 or cloud.shape[1] != 3 or not len(cloud) or not np.isfinite(cloud).all():
        raise ValueError(f"a cloud is finite points (n, 3), at least one; this one has the shape {cloud.shape}")
    return torch.from_numpy(scaled_to_diagonal(cloud))[None]


def load_point_encoder(path: Path, expected: Mapping[str, Any] | None = None) -> TrainedPointEncoder:
    """Read the model in a file of weights, as `load_module`. expected: such as `{"collection": "pretraining"}`."""
    kind = {"kind": "point_encoder", **(expected or {})}
    return TrainedPointEncoder(*load_module(path, kind, PointEncoderConfig, lambda config, header: PointEncoder()))
