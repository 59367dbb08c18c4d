"""How shapes of a grammar are derived: productions in productions, and resized grids (symmetry §3.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import invert

START_SITE = -1
"""The site of the start symbol: the whole shape."""
GRID_PARTS = ("rest", "cell", "end")
"""What a piece of a grid is in each of its rows: before the row, the cell that is repeated, or after the row."""


@dataclass(frozen=True)
class Derivation:
    """A shape of a grammar: a production, by its index, and the derivations of its non-terminals, in their order."""

    production: int
    parts: tuple[Derivation, ...] = ()


@dataclass(frozen=True)
class ResizedGrid:
    """A shape of a grammar: a grid, by its index, with these numbers of cells in its rows."""

    grid: int
    counts: tuple[int, ...]


@dataclass(frozen=True)
class NonTerminal:
    """A non-terminal in a production.

    site: class of its site
    frame: float64 (4, 4), where it is in the exemplar
    original: what the exemplar has there
    """

    site: int
    frame: FloatArray
    original: Derivation


def grid_poses(
    transforms: FloatArray, own: Sequence[int], pieces: Sequence[Sequence[int]], counts: Sequence[int]
) -> list[tuple[int, FloatArray]]:
    """Return the pieces of a grid that has `counts` cells in its rows: an index and a pose (4, 4) each.

    transforms: float64 (k, 4, 4), of the grid's rows
    own: cells of its rows in the exemplar
    pieces: for each piece its part in each row, as in GRID_PARTS
    """
    placed = []
    for number, parts in enumerate(pieces):
        along = [
            (range(1), range(count), range(count - had, count - had + 1))[part]
            for part, count, had in zip(parts, counts, own, strict=True)
        ]
        placed += [(number, _powers(transforms, multiples)) for multiples in product(*along)]
    return placed


def row_seams(
    transforms: FloatArray, frames: FloatArray, sites: Sequence[int], counts: Sequence[int]
) -> list[tuple[int, FloatArray]]:
    """Return the seams of a grid that has `counts` cells in its rows: the class of a site and its frame (4, 4) each.

    transforms, frames, sites: of the grid's rows
    """
    return [
        (site, _powers(transforms, multiples) @ frame)
        for frame, site in zip(frames, sites, strict=True)
        for multiples in product(*(range(count + 1) for count in counts))
    ]


def _powers(transforms: FloatArray, multiples: Sequence[int]) -> FloatArray:
    """Return the product of the transforms, each to its power."""
    pose: FloatArray = np.eye(4)
    for transform, times in zip(transforms, multiples, strict=True):
        pose = pose @ np.linalg.matrix_power(transform if times >= 0 else invert(transform), abs(times))
    return pose
