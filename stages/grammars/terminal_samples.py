"""The terminals of a grammar as points, one in each cell of the lattice for each way that their surface faces."""

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
from stages.symmetry.surface.lattice import pack

TILT = np.array([1.0, 1.0137, 1.0271])
"""By so much an axis weighs more where a surface faces between two: what faces halfway must not go by rounding."""
FACING = 3
"""Bits of a key that say which way the surface faces."""
HELD = 300_000_000
"""Bytes of samples that are held. Hundreds of terminals that have most of a large surface each have gigabytes."""
BYTES_A_POINT = 72
"""Of a point, its normal, and its place in a tree."""


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
    """The samples of each mesh of a grammar, taken when they are asked for; those asked for last are held."""

    def __init__(self, grammar: ShapeGrammar) -> None:
        self._grammar = grammar
        self._taken: BoundedCache[int, SurfaceSamples] = BoundedCache(
            lambda mesh: sample_surface(grammar.meshes[mesh], self.cell),
            lambda taken: BYTES_A_POINT * len(taken.points),
            HELD,
        )

    @property
    def cell(self) -> float:
        """The width of a cell of the lattice."""
        return self._grammar.radius / CELLS_PER_RADIUS

    def __getitem__(self, mesh: int) -> SurfaceSamples:
        return self._taken[mesh]


def sample_surface(part: PartMesh, size: float) -> SurfaceSamples:
    """The samples of a mesh on a lattice of cells of this size."""
    corners = part.vertices[part.faces]
    normals = unit_normals(corners)
    where, owner, middles = fragments(corners, corners.min(axis=(0, 1)) - size / 3, size)
    _, first = np.unique((pack(where) << FACING) + facing_axis(normals)[owner], return_index=True)
    return SurfaceSamples(np.ascontiguousarray(middles[first, :3]), normals[owner[first]])


def facing_axis(normals: FloatArray) -> np.ndarray:
    """Along which axis normals (n, 3) point most, int64 (n,): 0 to 2 along x, y, z, 3 to 5 against them."""
    axis = np.abs(normals * TILT).argmax(axis=1)
    found: np.ndarray = axis + 3 * (normals[np.arange(len(normals)), axis] < 0)
    return found
