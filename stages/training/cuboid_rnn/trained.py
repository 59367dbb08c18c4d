"""A trained network of cuboids, read from its published weights alone."""

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
from stages.training.checkpoint import CheckpointError, load_checkpoint
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
    """header: what the weights say of themselves."""

    module: CuboidRnn
    header: Mapping[str, Any]

    def sample(
        self, count: int, rng: np.random.Generator, temperature: float = 1.0
    ) -> tuple[list[tuple[Box, ...]], int]:
        """The cuboids of so many shapes, and how many were begun for them: those without one count too. temperature:
        how far numbers spread about the means of their Gaussians. Raises ValueError where nearly all have none."""
        kept: list[tuple[Box, ...]] = []
        begun = 0
        while len(kept) < count:
            if begun > 50 * (count + SHAPES_PER_BATCH):
                raise ValueError(f"{len(kept)} of {begun} shapes had a cuboid; train the model longer")
            for each in _written(self.module, SHAPES_PER_BATCH, rng, temperature):
                if len(kept) < count:
                    begun += 1
                    kept += [each] if each else []
        return kept, begun


@torch.no_grad()
def _written(module: CuboidRnn, count: int, rng: np.random.Generator, temperature: float) -> list[tuple[Box, ...]]:
    """The cuboids of so many shapes, mirror images among them."""
    found = np.zeros((MAX_BOXES, count, BOX_WIDTH))
    flags = np.zeros((count, FLAG_COUNT), np.float32)
    pairs = np.zeros((MAX_BOXES, count), np.bool_)
    lengths = np.full(count, MAX_BOXES)
    shown = np.zeros((count, INPUT_WIDTH), np.float32)
    state: torch.Tensor | None = None
    for step in range(3 * MAX_BOXES):
        place, axis = divmod(step, 3)
        shown[:, NUMBERS_PER_STEP + FLAG_COUNT :] = np.eye(3)[axis]
        states, state = module.read(torch.from_numpy(shown)[:, None], state)
        if axis == 0:
            kinds = (module.kinds(states[:, 0]).double().numpy() + rng.gumbel(size=(count, KIND_COUNT))).argmax(axis=1)
            lengths = np.where(kinds == END_KIND, np.minimum(lengths, place), lengths)
            pairs[place], turned = kinds // 2 == 1, kinds % 2 == 1
            flags = np.stack([pairs[place], turned], axis=1).astype(np.float32)
            if (lengths <= place).all():
                break
        said, mean, deviation = (
            each[:, 0].double().numpy() for each in module.numbers(states, torch.from_numpy(flags)[:, None])
        )
        numbers = _drawn(said, mean, deviation, temperature, rng)
        numbers[flags[:, 1] == 0, 2] = 0
        found[place, :, axis::3] = numbers
        shown[:, :NUMBERS_PER_STEP], shown[:, NUMBERS_PER_STEP : NUMBERS_PER_STEP + FLAG_COUNT] = numbers, flags
    return [_boxes(found[: lengths[row], row], pairs[: lengths[row], row]) for row in range(count)]


def _drawn(
    weights: FloatArray, means: FloatArray, deviations: FloatArray, temperature: float, rng: np.random.Generator
) -> FloatArray:
    """Numbers (n, NUMBERS) of mixtures with logits (n, k), means and deviations (n, k, NUMBERS)."""
    chosen = (weights + rng.gumbel(size=weights.shape)).argmax(axis=1)
    rows = np.arange(len(chosen))
    noise = temperature * rng.standard_normal((len(chosen), NUMBERS_PER_STEP))
    found: FloatArray = means[rows, chosen] + deviations[rows, chosen] * noise
    return found


def _boxes(numbers: FloatArray, pairs: BoolArray) -> tuple[Box, ...]:
    rows = np.concatenate([numbers, mirror_cuboids(numbers[pairs])])
    return tuple(box_from_vector(each) for each in rows)


def load_cuboid_rnn(path: Path, expected: Mapping[str, Any] | None = None) -> TrainedCuboidRnn:
    """The model in a file of weights, on the CPU.

    Raises CheckpointError for whatever is not one, or says something else of itself than `expected`, such as
    `{"kit": "chair"}`.
    """
    tensors, header = load_checkpoint(path, {"kind": "cuboid_rnn", **(expected or {})})
    module = CuboidRnn(CuboidRnnConfig.model_validate({"name": "trained", "kind": "cuboid_rnn", **header["settings"]}))
    if module.state_dict().keys() != tensors.keys():
        raise CheckpointError(f"{path} has other tensors than this version of Shapemill: train it again (make train)")
    module.load_state_dict(tensors)
    return TrainedCuboidRnn(module.eval(), header)
