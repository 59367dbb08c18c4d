"""A trained network of cuboids."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from stages.shape.arrays import BoolArray, FloatArray
from stages.shapeassembly.extraction.hierarchy import Box
from stages.training.box_vectors import BOX_WIDTH, box_from_vector
from stages.training.checkpoint import load_module
from stages.training.cuboid_rnn.batches import (
    END_KIND,
    FLAG_COUNT,
    INPUT_WIDTH,
    KIND_COUNT,
    MAX_BOXES,
    NUMBERS_PER_STEP,
)
from stages.training.cuboid_rnn.corpus import mirror_cuboids
from stages.training.cuboid_rnn.model import CuboidRnn
from stages.training.cuboid_rnn.settings import CuboidRnnConfig

SHAPES_PER_BATCH = 128


@dataclass(frozen=True)
class TrainedCuboidRnn:
    """A network of cuboids with its header."""

    module: CuboidRnn
    header: Mapping[str, Any]

    def sample(
        self, count: int, rng: np.random.Generator, temperature: float = 1.0
    ) -> tuple[list[tuple[Box, ...]], int]:
        """Sample shapes, as cuboids. Returns the shapes and the number of attempts; empty shapes are attempts too.

        temperature: factor of the deviations of the Gaussians.
        Raises ValueError where nearly all shapes are empty.
        """
        shapes: list[tuple[Box, ...]] = []
        attempts = 0
        while len(shapes) < count:
            if attempts > 50 * (count + SHAPES_PER_BATCH):
                raise ValueError(f"{len(shapes)} of {attempts} shapes had a cuboid; train the model longer")
            for boxes in _sample_batch(self.module, SHAPES_PER_BATCH, rng, temperature):
                if len(shapes) < count:
                    attempts += 1
                    shapes += [boxes] if boxes else []
        return shapes, attempts


@torch.no_grad()
def _sample_batch(module: CuboidRnn, count: int, rng: np.random.Generator, temperature: float) -> list[tuple[Box, ...]]:
    """Sample the cuboids of some shapes, mirror images included."""
    vectors = np.zeros((MAX_BOXES, count, BOX_WIDTH))
    flags = np.zeros((count, FLAG_COUNT), np.float32)
    mirrored = np.zeros((MAX_BOXES, count), np.bool_)
    lengths = np.full(count, MAX_BOXES)
    inputs = np.zeros((count, INPUT_WIDTH), np.float32)
    state: torch.Tensor | None = None
    for step in range(3 * MAX_BOXES):
        box, axis = divmod(step, 3)
        inputs[:, NUMBERS_PER_STEP + FLAG_COUNT :] = np.eye(3)[axis]
        states, state = module.read(torch.from_numpy(inputs)[:, None], state)
        if axis == 0:
            kinds = (module.kinds(states[:, 0]).double().numpy() + rng.gumbel(size=(count, KIND_COUNT))).argmax(axis=1)
            lengths = np.where(kinds == END_KIND, np.minimum(lengths, box), lengths)
            mirrored[box], rotated = kinds // 2 == 1, kinds % 2 == 1
            flags = np.stack([mirrored[box], rotated], axis=1).astype(np.float32)
            if (lengths <= box).all():
                break
        weights, means, deviations = (
            tensor[:, 0].double().numpy() for tensor in module.numbers(states, torch.from_numpy(flags)[:, None])
        )
        numbers = _sample_numbers(weights, means, deviations, temperature, rng)
        numbers[flags[:, 1] == 0, 2] = 0
        vectors[box, :, axis::3] = numbers
        inputs[:, :NUMBERS_PER_STEP] = numbers
        inputs[:, NUMBERS_PER_STEP : NUMBERS_PER_STEP + FLAG_COUNT] = flags
    return [_boxes(vectors[: lengths[row], row], mirrored[: lengths[row], row]) for row in range(count)]


def _sample_numbers(
    weights: FloatArray, means: FloatArray, deviations: FloatArray, temperature: float, rng: np.random.Generator
) -> FloatArray:
    """Sample numbers (n, 3) of mixtures with logits (n, k), means and deviations (n, k, 3)."""
    component = (weights + rng.gumbel(size=weights.shape)).argmax(axis=1)
    rows = np.arange(len(component))
    noise = temperature * rng.standard_normal((len(component), NUMBERS_PER_STEP))
    numbers: FloatArray = means[rows, component] + deviations[rows, component] * noise
    return numbers


def _boxes(vectors: FloatArray, mirrored: BoolArray) -> tuple[Box, ...]:
    vectors = np.concatenate([vectors, mirror_cuboids(vectors[mirrored])])
    return tuple(box_from_vector(vector) for vector in vectors)


def load_cuboid_rnn(path: Path, expected: Mapping[str, Any] | None = None) -> TrainedCuboidRnn:
    """Read the model in a file of weights, as `load_module`. expected: such as `{"kit": "chair"}`."""
    kind = {"kind": "cuboid_rnn", **(expected or {})}
    return TrainedCuboidRnn(*load_module(path, kind, CuboidRnnConfig, lambda config, _: CuboidRnn(config)))
