"""How shapes of a grammar are derived: productions in productions, and grids of so many cells (symmetry §3.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import invert

START = -1
"""The site of the start symbol: the whole shape."""
ENDS = ("rest", "cell", "end")
"""What a piece of a grid is along each of its rows: before the row, the cell that is repeated, or after it."""


@dataclass(frozen=True)
class Derivation:
    """A shape of a grammar: a production, by its place among all, and what stands at its places, in their order."""

    production: int
    parts: tuple[Derivation, ...] = ()


@dataclass(frozen=True)
class NonTerminal:
    """A non-terminal in a production: a site of class `site`, where it is in the exemplar, `frame` (4, 4), and what the
    exemplar has there."""

    site: int
    frame: FloatArray
    original: Derivation


def grid_poses(
    motions: FloatArray, own: Sequence[int], pieces: Sequence[Sequence[int]], counts: Sequence[int]
) -> list[tuple[int, FloatArray]]:
    """Where the pieces of a grid stand that has `counts` cells along its rows: a place among them and a pose (4, 4).

    motions, own and pieces: those of a `Grid`, its counts, and of each piece where it is along the rows.
    """
    found = []
    for number, where in enumerate(pieces):
        along = [
            (range(1), range(count), range(count - had, count - had + 1))[place]
            for place, count, had in zip(where, counts, own, strict=True)
        ]
        for multiples in product(*along):
            pose = np.eye(4)
            for motion, times in zip(motions, multiples, strict=True):
                pose = pose @ _power(motion, times)
            found.append((number, pose))
    return found


def row_seams(
    motions: FloatArray, frames: FloatArray, sites: Sequence[int], counts: Sequence[int]
) -> list[tuple[int, FloatArray]]:
    """The seams of a grid that has `counts` cells along its rows: of each the class of its site, and its frame (4, 4).

    motions, frames and sites: those of a `Grid`.
    """
    found = []
    for frame, site in zip(frames, sites, strict=True):
        for multiples in product(*(range(count + 1) for count in counts)):
            pose = np.eye(4)
            for motion, times in zip(motions, multiples, strict=True):
                pose = pose @ _power(motion, times)
            found.append((site, pose @ frame))
    return found


def _power(motion: FloatArray, times: int) -> FloatArray:
    """A motion so many times, or its inverse."""
    found: FloatArray = np.linalg.matrix_power(motion if times >= 0 else invert(motion), abs(times))
    return found
