"""How much of the visible surface of a shape differs from another, by voxels as wide as the radius of similarity.

Differences between cuts of the pieces, or within the radius, do not count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stages.grammars.derived_shape import PlacedTerminal
from stages.grammars.grammar import ShapeGrammar
from stages.grammars.terminal_samples import (
    FACING_BITS,
    SurfaceSamples,
    TerminalSamples,
    facing_direction,
    sample_mesh,
)
from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import transform_points

VOXEL_STRIDE = 8
"""Every eighth voxel is looked up in the other shape."""
BITS_PER_AXIS = 16
"""Bits of a key for the position of a voxel along one axis."""
CORNER_OFFSET = 0.381966
"""Position of the box's corner in its voxel: surfaces of models lie at round numbers."""
SAME_SIZE_VOXELS = 2.0
"""Boxes whose sides differ by more belong to different shapes."""
_STEPS = [
    (x << 2 * BITS_PER_AXIS) + (y << BITS_PER_AXIS) + z for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)
]
NEIGHBOUR_OFFSETS = np.array(_STEPS) << FACING_BITS
"""Differences of the keys of a voxel and its 26 neighbours."""


@dataclass(frozen=True, eq=False)
class VoxelSignature:
    """The voxels that the surface of a shape occupies, with its facing direction in each.

    from_low, from_high: int64 (n,), keys counted from the low and from the high corner of the box, ascending
    sides: float64 (3,), of the box, in voxels
    """

    from_low: np.ndarray
    from_high: np.ndarray
    sides: FloatArray


def voxel_signature(
    placed: Sequence[tuple[SurfaceSamples, FloatArray]], low: FloatArray, high: FloatArray, size: float
) -> VoxelSignature:
    """Return the signature of samples at poses (4, 4) in a box from `low` to `high` (3,), with voxels of this size."""
    points = np.concatenate([transform_points(pose, samples.points) for samples, pose in placed])
    facing = facing_direction(np.concatenate([samples.normals @ pose[:3, :3].T for samples, pose in placed]))
    return VoxelSignature(
        _keys((points - low) / size, facing), _keys((high - points) / size, facing), (high - low) / size
    )


def difference(one: VoxelSignature, other: VoxelSignature) -> float:
    """Return the share of the surface of a shape that the other one lacks, the larger of both, from 0.0 to 1.0.

    Surface in the same voxel or a neighbouring one that faces the same way is equal: what moves by less than the radius
    has not moved. Shapes are aligned at the low or the high corners of their boxes, whichever differs less.
    """
    return min(
        max(_missing_share(first, second), _missing_share(second, first))
        for first, second in ((one.from_low, other.from_low), (one.from_high, other.from_high))
    )


class KnownShapes:
    """The exemplar of a grammar, and the shapes that were sampled from it."""

    def __init__(self, grammar: ShapeGrammar, samples: TerminalSamples) -> None:
        self._grammar, self._samples = grammar, samples
        whole, (low, high) = sample_mesh(grammar.exemplar, samples.cell), grammar.exemplar.bounds
        self.exemplar = voxel_signature([(whole, np.eye(4))], low, high, grammar.radius)
        self._sampled: list[VoxelSignature] = []

    def signature(self, terminals: Sequence[PlacedTerminal]) -> VoxelSignature:
        """Return the signature of placed terminals."""
        corners = (transform_points(placed.pose, self._grammar.meshes[placed.mesh].vertices) for placed in terminals)
        boxes = np.array([(points.min(axis=0), points.max(axis=0)) for points in corners])
        low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
        samples = [(self._samples[placed.mesh], placed.pose) for placed in terminals]
        return voxel_signature(samples, low, high, self._grammar.radius)

    def min_difference(self, signature: VoxelSignature) -> float:
        """Return the smallest difference to a sampled shape; 1.0 before the first."""
        near = (known for known in self._sampled if _same_size(signature, known))
        return min((difference(signature, known) for known in near), default=1.0)

    def add(self, signature: VoxelSignature) -> None:
        """Record a shape as sampled."""
        self._sampled.append(signature)


def _same_size(one: VoxelSignature, other: VoxelSignature) -> bool:
    """Return whether the boxes of two shapes differ by no more than SAME_SIZE_VOXELS."""
    return bool((np.abs(one.sides - other.sides) <= SAME_SIZE_VOXELS).all())


def _keys(at: FloatArray, facing: np.ndarray) -> np.ndarray:
    cells = np.floor(at + CORNER_OFFSET).astype(np.int64) + 1
    packed = (cells[:, 0] << 2 * BITS_PER_AXIS) + (cells[:, 1] << BITS_PER_AXIS) + cells[:, 2]
    return np.unique((packed << FACING_BITS) + facing)


def _missing_share(keys: np.ndarray, others: np.ndarray) -> float:
    """Return the share of keys without an equal or a neighbour among others."""
    near = keys[::VOXEL_STRIDE, None] + NEIGHBOUR_OFFSETS
    index = np.minimum(np.searchsorted(others, near), len(others) - 1)
    return float(1 - (others[index] == near).any(axis=1).mean())
