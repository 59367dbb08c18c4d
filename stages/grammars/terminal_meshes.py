"""The meshes of a grammar's terminals, each made of the exemplar's surface when it is asked for."""

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
        every = join_soups(Soup(corners, np.arange(len(corners), dtype=np.int32)), pieces)
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
        name, terminal = self._terminals[place]
        whole, pieces = terminal.whole.indices, self._first + terminal.pieces
        faces, vertices = self._surface.around(whole, terminal.cut.corners, pieces)
        colors = self._colors[np.concatenate([whole, terminal.cut.faces, self._faces[pieces]])]
        return centred_part(self.middles[place], name, faces, vertices, colors)

    @cached_property
    def middles(self) -> FloatArray:
        """Where the middle of each is in the exemplar, float64 (m, 3)."""
        boxes = [
            self._surface.box(each.whole.indices, each.cut.corners, self._first + each.pieces)
            for _, each in self._terminals
        ]
        found: FloatArray = np.array(boxes).reshape(-1, 2, 3).mean(axis=1)
        return found


def centred_part(middle: FloatArray, name: str, faces: IntArray, vertices: FloatArray, colors: ByteArray) -> PartMesh:
    """A mesh with its origin at `middle` (3,), without triangles that have fewer than three vertices."""
    one, two, three = faces.T
    real = (one != two) & (two != three) & (three != one)
    return PartMesh(name, vertices - middle, faces[real], colors[real])
