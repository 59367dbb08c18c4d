"""How much of a shape one sees to be different from another: more than the cuts of its pieces, or what lies within the
radius of similarity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stages.grammars.derivation_text import PlacedTerminal
from stages.grammars.grammar import ShapeGrammar
from stages.grammars.terminal_samples import FACING, SurfaceSamples, TerminalSamples, facing_axis, sample_surface
from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import transform_points

ASKED = 8
"""Every so many-th voxel is looked for in the other shape."""
AXIS = 16
"""Bits of a key that say where a voxel lies along an axis."""
EDGE = 0.381966
"""Where in its voxel the box's corner lies: surfaces of models stand at round numbers."""
STEPS = np.array([(x << 2 * AXIS) + (y << AXIS) + z for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)])
AROUND = STEPS << FACING
"""What a voxel and its 26 neighbours have more in their keys."""


@dataclass(frozen=True, eq=False)
class VoxelSignature:
    """What one sees of a shape: the voxels, as wide as the radius of similarity, that its surface is in, and which way
    it faces in each, as keys int64 (n,) ascending, counted from the low corner of the box and from its high corner;
    sides: float64 (3,), of the box, in voxels."""

    from_low: np.ndarray
    from_high: np.ndarray
    sides: FloatArray


def voxel_signature(
    placed: Sequence[tuple[SurfaceSamples, FloatArray]], low: FloatArray, high: FloatArray, size: float
) -> VoxelSignature:
    """What one sees of samples, each at a pose (4, 4), in a box from `low` to `high` (3,), by voxels of this size."""
    points = np.concatenate([transform_points(pose, each.points) for each, pose in placed])
    ways = facing_axis(np.concatenate([each.normals @ pose[:3, :3].T for each, pose in placed]))
    return VoxelSignature(_keys((points - low) / size, ways), _keys((high - points) / size, ways), (high - low) / size)


def difference(one: VoxelSignature, other: VoxelSignature) -> float:
    """The share of what one sees of a shape that the other one has nowhere near, of both the greater, 0.0 to 1.0.

    Near is the same voxel or one beside it, for surface that faces alike: what moves by less than the radius has not
    moved. Shapes are laid onto each other at the low corners of their boxes, or the high ones, whatever differs less.
    """
    return min(
        max(_lacking(first, second), _lacking(second, first))
        for first, second in ((one.from_low, other.from_low), (one.from_high, other.from_high))
    )


class KnownShapes:
    """The exemplar of a grammar, and the shapes that were drawn of it."""

    def __init__(self, grammar: ShapeGrammar, samples: TerminalSamples) -> None:
        self._grammar, self._samples = grammar, samples
        whole, (low, high) = sample_surface(grammar.exemplar, samples.cell), grammar.exemplar.bounds
        self.exemplar = voxel_signature([(whole, np.eye(4))], low, high, grammar.radius)
        self._drawn: list[VoxelSignature] = []

    def sight(self, pieces: Sequence[PlacedTerminal]) -> VoxelSignature:
        """What one sees of pieces."""
        corners = (transform_points(each.pose, self._grammar.meshes[each.mesh].vertices) for each in pieces)
        boxes = np.array([(each.min(axis=0), each.max(axis=0)) for each in corners])
        low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
        return voxel_signature(
            [(self._samples[each.mesh], each.pose) for each in pieces], low, high, self._grammar.radius
        )

    def nearest(self, sight: VoxelSignature) -> float:
        """The least difference to a shape that was drawn before; 1.0 where there is none."""
        return min((difference(sight, each) for each in self._drawn if _as_large(sight, each)), default=1.0)

    def add(self, sight: VoxelSignature) -> None:
        """Hold a shape as drawn."""
        self._drawn.append(sight)


def _as_large(one: VoxelSignature, other: VoxelSignature) -> bool:
    """Whether the boxes of two shapes differ by no more than what counts as near: else nobody takes one for the
    other."""
    return bool((np.abs(one.sides - other.sides) <= 2.0).all())


def _keys(at: FloatArray, ways: np.ndarray) -> np.ndarray:
    cells = np.floor(at + EDGE).astype(np.int64) + 1
    packed = (cells[:, 0] << 2 * AXIS) + (cells[:, 1] << AXIS) + cells[:, 2]
    return np.unique((packed << FACING) + ways)


def _lacking(keys: np.ndarray, others: np.ndarray) -> float:
    """The share of keys that have nothing near them among others."""
    asked = keys[::ASKED, None] + AROUND
    place = np.minimum(np.searchsorted(others, asked), len(others) - 1)
    return float(1 - (others[place] == asked).any(axis=1).mean())
