"""The terminals of a grammar as points, one per cell of the lattice and facing direction of the surface there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from stages.grammars.bounded_cache import BoundedCache
from stages.grammars.grammar import ShapeGrammar
from stages.shape.arrays import FloatArray
from stages.shape.geometry.triangles import unit_normals
from stages.shape.kit import PartMesh
from stages.symmetry.surface.clip import fragments
from stages.symmetry.surface.grid import CELLS_PER_RADIUS
from stages.symmetry.surface.lattice import pack_cells

AXIS_WEIGHTS = np.array([1.0, 1.0137, 1.0271])
"""Weights of the axes for a surface that faces between two: rounding must not decide what faces halfway."""
FACING_BITS = 3
"""Bits of a key for the facing direction."""
MAX_SAMPLE_BYTES = 300_000_000
"""Samples of hundreds of terminals that each have most of a large surface take gigabytes."""
BYTES_PER_POINT = 72
"""Size of a point, its normal, and its entry in a tree."""


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Points of a mesh, float64 (n, 3), and its outward normals there, float64 (n, 3)."""

    points: FloatArray
    normals: FloatArray

    @cached_property
    def tree(self) -> Any:
        """A `scipy.spatial.KDTree` of the points."""
        from scipy.spatial import KDTree

        return KDTree(self.points)


class TerminalSamples:
    """The samples of each mesh of a grammar, made on demand and cached."""

    def __init__(self, grammar: ShapeGrammar) -> None:
        self._grammar = grammar
        self._samples: BoundedCache[int, SurfaceSamples] = BoundedCache(
            lambda mesh: sample_mesh(grammar.meshes[mesh], self.cell),
            lambda samples: BYTES_PER_POINT * len(samples.points),
            MAX_SAMPLE_BYTES,
        )

    @property
    def cell(self) -> float:
        """Width of a cell of the lattice."""
        return self._grammar.radius / CELLS_PER_RADIUS

    def __getitem__(self, mesh: int) -> SurfaceSamples:
        return self._samples[mesh]


def sample_mesh(part: PartMesh, size: float) -> SurfaceSamples:
    """Return the samples of a mesh on a lattice of cells of this size."""
    corners = part.vertices[part.faces]
    normals = unit_normals(corners)
    cells, owner, middles = fragments(corners, corners.min(axis=(0, 1)) - size / 3, size)
    _, first = np.unique((pack_cells(cells) << FACING_BITS) + facing_direction(normals)[owner], return_index=True)
    return SurfaceSamples(np.ascontiguousarray(middles[first, :3]), normals[owner[first]])


def facing_direction(normals: FloatArray) -> np.ndarray:
    """Return the axis along which each normal (n, 3) points most, int64 (n,): 0 to 2 along x, y, z, 3 to 5 against."""
    axis = np.abs(normals * AXIS_WEIGHTS).argmax(axis=1)
    direction: np.ndarray = axis + 3 * (normals[np.arange(len(normals)), axis] < 0)
    return direction
