"""A shape grammar of an exemplar: which terminals fit which sites, and its grids (symmetry §3.4)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from stages.grammars.derivation import START_SITE, NonTerminal
from stages.shape.arrays import FloatArray
from stages.shape.kit import LengthUnit, PartMesh

SITE_LETTERS = "ABCDEFHIJKLMNOPQRTUVWXYZ"


@dataclass(frozen=True, eq=False)
class Production:
    """What may replace a non-terminal: a terminal mesh with non-terminals of its own.

    site: class of the site where it fits
    frame: float64 (4, 4), of the site where the exemplar has it
    terminal: index of the mesh
    non_terminals: where the exemplar has them
    """

    name: str
    site: int
    frame: FloatArray
    terminal: int
    non_terminals: tuple[NonTerminal, ...]


@dataclass(frozen=True, eq=False)
class Grid:
    """A grid of k rows that cross.

    transforms: float64 (k, 4, 4), from cell to cell of each row
    counts: cells of each row in the exemplar
    sites: class of the site where each row begins
    frames: float64 (k, 4, 4), of these sites
    pieces: for each piece the index of its mesh, and its part in each row, as in GRID_PARTS
    """

    name: str
    transforms: FloatArray
    counts: tuple[int, ...]
    sites: tuple[int, ...]
    frames: FloatArray
    pieces: tuple[tuple[int, tuple[int, ...]], ...]


@dataclass(frozen=True, eq=False)
class ShapeGrammar:
    """The grammar of one exemplar.

    radius: of similarity, in units of the exemplar
    meshes: terminals of the productions, then pieces of the grids, each around the middle of its box
    middles: float64 (m, 3), where these middles are in the exemplar
    productions: those of the start symbol first
    seams: for each class of sites points on its first site, float64 (k, 3)
    exemplar: the whole surface
    splats: whether the exemplar is a point cloud, and triangles stand for its points, one each
    unit: of all coordinates
    """

    name: str
    up: Literal["y", "z"]
    radius: float
    meshes: Sequence[PartMesh]
    middles: FloatArray
    productions: tuple[Production, ...]
    grids: tuple[Grid, ...]
    seams: Mapping[int, FloatArray]
    exemplar: PartMesh
    splats: bool = False
    unit: LengthUnit = "unknown"

    @property
    def made_of(self) -> str:
        """What surfaces consist of."""
        return "points" if self.splats else "triangles"

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """The names of all meshes."""
        return tuple(mesh.name for mesh in self.meshes)

    @cached_property
    def bounds(self) -> FloatArray:
        """Lowest and highest corner of the box around each mesh, float64 (m, 2, 3)."""
        return np.array([mesh.bounds for mesh in self.meshes]).reshape(-1, 2, 3)

    @cached_property
    def productions_of_site(self) -> Mapping[int, tuple[int, ...]]:
        """Indices of the productions of each class of sites."""
        numbers: dict[int, list[int]] = {}
        for number, production in enumerate(self.productions):
            numbers.setdefault(production.site, []).append(number)
        return {site: tuple(of_site) for site, of_site in numbers.items()}

    def mesh_pose(self, mesh: int, transform: FloatArray) -> FloatArray:
        """Return the pose (4, 4) of a mesh that is transformed from where the exemplar has it."""
        pose = transform.copy()
        pose[:3, 3] = transform[:3, :3] @ self.middles[mesh] + transform[:3, 3]
        return np.asarray(pose + 0.0)


def site_name(site: int) -> str:
    """Return the name of a class of sites: a letter, after the last with a number; S is the start symbol, G a grid."""
    if site == START_SITE:
        return "S"
    turn, letter = divmod(site, len(SITE_LETTERS))
    return SITE_LETTERS[letter] + (f"{turn}_" if turn else "")
