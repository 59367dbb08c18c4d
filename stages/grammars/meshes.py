"""The meshes of a grammar's terminals, each made of the exemplar's surface when it is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import overload

import numpy as np

from stages.exemplars.symmetry.carve import Soup, joined
from stages.exemplars.symmetry.terminals import Terminal
from stages.exemplars.symmetry.welding import WeldedSurface
from stages.shape.arrays import ByteArray, FloatArray, IntArray
from stages.shape.kit import PartMesh

__all__ = ["TerminalMeshes", "part_around_middle"]


class TerminalMeshes(Sequence[PartMesh]):
    """A mesh for each terminal, around the middle of its box, made anew whenever it is asked for: hundreds that hold
    most of a large surface each are gigabytes."""

    def __init__(
        self,
        corners: FloatArray,
        pieces: Soup,
        colors: ByteArray,
        terminals: Sequence[tuple[str, Terminal]],
        tolerance: float,
    ) -> None:
        """Of a surface with triangles `corners` (f, 3, 3) and their colours, uint8 (f, 3), and its `pieces`. Corners
        closer than `tolerance` are one vertex."""
        every = joined(Soup(corners, np.arange(len(corners), dtype=np.int32)), pieces)
        self._surface = WeldedSurface(every.corners, tolerance)
        self._faces, self._first, self._colors = every.faces, len(corners), colors
        self._terminals = tuple(terminals)

    def __len__(self) -> int:
        return len(self._terminals)

    @overload
    def __getitem__(self, place: int) -> PartMesh: ...
    @overload
    def __getitem__(self, place: slice) -> Sequence[PartMesh]: ...
    def __getitem__(self, place: int | slice) -> PartMesh | Sequence[PartMesh]:
        if isinstance(place, slice):
            return [self[each] for each in range(*place.indices(len(self)))]
        return self._made(place)[1]

    def middles(self) -> FloatArray:
        """Where the middle of each is in the exemplar, float64 (m, 3)."""
        return np.array([self._made(place)[0] for place in range(len(self))]).reshape(-1, 3)

    def _made(self, place: int) -> tuple[FloatArray, PartMesh]:
        name, terminal = self._terminals[place]
        whole, pieces = terminal.whole.places, self._first + terminal.pieces
        faces, vertices = self._surface.around(whole, terminal.cut.corners, pieces)
        colors = self._colors[np.concatenate([whole, terminal.cut.faces, self._faces[pieces]])]
        return part_around_middle(name, faces, vertices, colors)


def part_around_middle(
    name: str, faces: IntArray, vertices: FloatArray, colors: ByteArray
) -> tuple[FloatArray, PartMesh]:
    """Where the middle of a mesh's box is, float64 (3,), and the mesh around it, without triangles that have fewer than
    three vertices."""
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    one, two, three = faces.T
    real = (one != two) & (two != three) & (three != one)
    return middle, PartMesh(name, vertices - middle, faces[real], colors[real])
