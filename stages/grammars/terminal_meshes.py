"""The meshes of a grammar's terminals, each made from the exemplar's surface on demand."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import overload

import numpy as np

from stages.grammars.extraction.terminals import Terminal
from stages.shape.arrays import ByteArray, FloatArray, IntArray
from stages.shape.kit import PartMesh
from stages.symmetry.surface.soup import Soup, join_soups
from stages.symmetry.surface.welding import WeldedSurface


class TerminalMeshes(Sequence[PartMesh]):
    """A mesh for each terminal, around the middle of its box.

    A mesh is made whenever it is read: hundreds that each hold most of a large surface take gigabytes.
    """

    def __init__(
        self,
        corners: FloatArray,
        pieces: Soup,
        colors: ByteArray,
        terminals: Sequence[tuple[str, Terminal]],
        tolerance: float,
    ) -> None:
        """Prepare the meshes of a surface.

        corners: float64 (f, 3, 3), triangles of the surface
        pieces: pieces of triangles that seams have cut
        colors: uint8 (f, 3), of the triangles
        terminals: each with its name
        tolerance: distance up to which corners are one vertex
        """
        every = join_soups(Soup(corners, np.arange(len(corners), dtype=np.int32)), pieces)
        self._surface = WeldedSurface(every.corners, tolerance)
        self._faces, self._first, self._colors = every.faces, len(corners), colors
        self._terminals = tuple(terminals)

    def __len__(self) -> int:
        return len(self._terminals)

    @overload
    def __getitem__(self, index: int) -> PartMesh: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[PartMesh]: ...
    def __getitem__(self, index: int | slice) -> PartMesh | Sequence[PartMesh]:
        if isinstance(index, slice):
            return [self[number] for number in range(*index.indices(len(self)))]
        name, terminal = self._terminals[index]
        whole, pieces = terminal.whole.indices, self._first + terminal.pieces
        faces, vertices = self._surface.around(whole, terminal.cut.corners, pieces)
        colors = self._colors[np.concatenate([whole, terminal.cut.faces, self._faces[pieces]])]
        return centred_part(self.middles[index], name, faces, vertices, colors)

    @cached_property
    def middles(self) -> FloatArray:
        """Where the middle of each mesh's box is in the exemplar, float64 (m, 3)."""
        boxes = [
            self._surface.box(terminal.whole.indices, terminal.cut.corners, self._first + terminal.pieces)
            for _, terminal in self._terminals
        ]
        middles: FloatArray = np.array(boxes).reshape(-1, 2, 3).mean(axis=1)
        return middles


def centred_part(middle: FloatArray, name: str, faces: IntArray, vertices: FloatArray, colors: ByteArray) -> PartMesh:
    """Return a mesh with its origin at `middle` (3,), without triangles of fewer than three vertices."""
    one, two, three = faces.T
    real = (one != two) & (two != three) & (three != one)
    return PartMesh(name, vertices - middle, faces[real], colors[real])
