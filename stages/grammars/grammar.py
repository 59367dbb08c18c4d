"""A shape grammar of an exemplar: what may stand at which site, and which grids there are (symmetry §3.4)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from stages.grammars.derivation import START, NonTerminal
from stages.shape.arrays import FloatArray
from stages.shape.kit import PartMesh

LETTERS = "ABCDEFHIJKLMNOPQRTUVWXYZ"


@dataclass(frozen=True, eq=False)
class Production:
    """A production: at a site of class `site` may stand the mesh `terminal`, with `places` for others.

    frame: float64 (4, 4), of the site where the exemplar has it; places: where the exemplar has them.
    """

    name: str
    site: int
    frame: FloatArray
    terminal: int
    non_terminals: tuple[NonTerminal, ...]


@dataclass(frozen=True, eq=False)
class Grid:
    """A grid of k rows that cross.

    motions: float64 (k, 4, 4), from cell to cell; counts: of the exemplar; sites, frames float64 (k, 4, 4): where the
    rows begin. pieces: the mesh of each piece, and for each row 0 before it, 1 a cell of it, 2 after it.
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

    radius: of similarity, in units of the exemplar; meshes: terminals of the rules, then pieces of the grids, each
    around the middle of its box, which stands at `middles` float64 (m, 3) in the exemplar. rules: those of the start
    symbol first. seams: for each class of sites points on the first of them, float64 (k, 3). exemplar: the whole.
    splats: whether the exemplar is a point cloud, and triangles stand for its points, one each.
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

    @property
    def made_of(self) -> str:
        """What surfaces are made of."""
        return "points" if self.splats else "triangles"

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """The names of all meshes."""
        return tuple(each.name for each in self.meshes)

    @cached_property
    def bounds(self) -> FloatArray:
        """Lowest and highest corner of the box around each mesh, float64 (m, 2, 3)."""
        return np.array([each.bounds for each in self.meshes]).reshape(-1, 2, 3)

    @cached_property
    def productions_of_site(self) -> Mapping[int, tuple[int, ...]]:
        """The rules of each class of sites, by their places."""
        found: dict[int, list[int]] = {}
        for number, rule in enumerate(self.productions):
            found.setdefault(rule.site, []).append(number)
        return {site: tuple(each) for site, each in found.items()}

    def standing(self, mesh: int, motion: FloatArray) -> FloatArray:
        """The pose (4, 4) of a mesh that a motion takes from where the exemplar has it."""
        pose = motion.copy()
        pose[:3, 3] = motion[:3, :3] @ self.middles[mesh] + motion[:3, 3]
        return np.asarray(pose + 0.0)


def site_name(site: int) -> str:
    """What a class of sites is called: a letter and, after the last, a number; S is the start symbol, G a grid."""
    if site == START:
        return "S"
    turn, place = divmod(site, len(LETTERS))
    return LETTERS[place] + (f"{turn}_" if turn else "")
