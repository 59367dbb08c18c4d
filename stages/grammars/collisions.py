"""Whether a piece of a grammar runs into others: it may come near them at seams alone, or as it does in the exemplar
(symmetry §3.2, §3.4.3)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from stages.grammars.bounded_cache import BoundedCache
from stages.grammars.derivation import Derivation, row_seams
from stages.grammars.derivation_text import PlacedTerminal, ResizedGrid, placed_terminals
from stages.grammars.grammar import ShapeGrammar
from stages.grammars.terminal_samples import TerminalSamples
from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.pose import invert, transform_points

NEAR = 1.8
"""Pieces are apart where no two of their points, one in each cell, are closer than so many cells."""
BESIDE = 2.0
"""At a seam they may be near as far as so many radii from it."""
DECIMALS = 6
"""Digits of relative poses, shifts in cells, that count."""
HELD = 100_000_000
"""Bytes of answers that are held."""
BYTES_A_KEY = 500
"""Of an answer's key, about."""
SAME = 0.5
"""Cells by which the corners of a piece may lie elsewhere and the piece still stand as another one does."""


class Collisions:
    """What stands near what in the exemplar, as far as the grammar shows it, and whether anything else is near."""

    def __init__(self, grammar: ShapeGrammar) -> None:
        self._grammar = grammar
        self.samples = TerminalSamples(grammar)
        self._cell = self.samples.cell
        self._answers: BoundedCache[tuple[int, int, bytes], IntArray] = BoundedCache(
            lambda key: self._points_near(*key), lambda near: BYTES_A_KEY + near.nbytes, HELD
        )
        self._seam_trees: dict[int, Any] = {}

    def collides(
        self, piece: PlacedTerminal, others: Sequence[PlacedTerminal], seams: Sequence[tuple[int, FloatArray]]
    ) -> bool:
        """Whether a piece is near one of others where no seam is, a class of sites and its frame (4, 4) each, and
        nothing in the exemplar is so near."""
        for other in others:
            near = self._near(piece, other)
            if not len(near) or self._as_in_exemplar(piece, other):
                continue
            points = transform_points(piece.pose, self.samples[piece.mesh].points[near])
            if not self._at_seams(points, seams).all():
                return True
        return False

    def whole(self, made: ResizedGrid) -> bool:
        """Whether pieces of a resized grid run into each other."""
        grid = self._grammar.grids[made.grid]
        seams = row_seams(grid.transforms, grid.frames, grid.sites, made.counts)
        pieces = placed_terminals(self._grammar, made)
        return any(self.collides(each, pieces[:place], seams) for place, each in enumerate(pieces))

    @cached_property
    def _known(self) -> dict[tuple[int, int], list[FloatArray]]:
        """For each two meshes how the second stands to the first in the exemplar, near to it or not."""
        grammar = self._grammar
        shown: list[Derivation | ResizedGrid] = [
            Derivation(number, tuple(place.original for place in rule.non_terminals))
            for number, rule in enumerate(grammar.productions)
        ]
        shown += [ResizedGrid(number, grid.counts) for number, grid in enumerate(grammar.grids)]
        found: dict[tuple[int, int], list[FloatArray]] = {}
        for made in shown:
            pieces = placed_terminals(grammar, made)
            for place, one in enumerate(pieces):
                for other in pieces[:place]:
                    pose = invert(one.pose) @ other.pose
                    listed = found.setdefault((one.mesh, other.mesh), [])
                    if not self._listed(listed, other.mesh, pose):
                        listed.append(pose)
                        found.setdefault((other.mesh, one.mesh), []).append(invert(pose))
        return found

    def _as_in_exemplar(self, one: PlacedTerminal, other: PlacedTerminal) -> bool:
        listed = self._known.get((one.mesh, other.mesh), [])
        return self._listed(listed, other.mesh, invert(one.pose) @ other.pose)

    def _listed(self, listed: Sequence[FloatArray], mesh: int, pose: FloatArray) -> bool:
        """Whether a pose of a mesh is one of those listed."""
        corners = self._grammar.bounds[mesh]
        here = transform_points(pose, corners)
        return any(np.abs(transform_points(each, corners) - here).max() < SAME * self._cell for each in listed)

    def _near(self, one: PlacedTerminal, other: PlacedTerminal) -> IntArray:
        """Which points of a piece are near another piece, int32 (k,). Relative poses recur, so that answers are held,
        each for the rounded value of its pose."""
        pose = invert(other.pose) @ one.pose
        pose[:3, 3] /= self._cell
        pose = np.round(pose, DECIMALS) + 0.0
        return self._answers[one.mesh, other.mesh, pose.tobytes()]

    def _points_near(self, mesh: int, other: int, key: bytes) -> IntArray:
        """Which points of a mesh are near another in whose coordinates it has a pose, float64 (4, 4), shifts in cells,
        as bytes."""
        pose = np.frombuffer(key).reshape(4, 4).copy()
        pose[:3, 3] *= self._cell
        low, high = self._grammar.bounds[other]
        reach = NEAR * self._cell
        box = self._grammar.bounds[mesh]
        middle, half = box.mean(axis=0), (box[1] - box[0]) / 2
        around, wide = transform_points(pose, middle), np.abs(pose[:3, :3]) @ half
        if ((around - wide > high + reach) | (around + wide < low - reach)).any():
            return np.empty(0, dtype=np.int32)
        moved = transform_points(pose, self.samples[mesh].points)
        close = np.flatnonzero(((moved > low - reach) & (moved < high + reach)).all(axis=1))
        away, _ = self.samples[other].tree.query(moved[close], distance_upper_bound=reach)
        near: IntArray = close[np.isfinite(away)].astype(np.int32)
        return near

    def _at_seams(self, points: FloatArray, seams: Sequence[tuple[int, FloatArray]]) -> BoolArray:
        """Which of some points lie beside a seam, bool (n,)."""
        from scipy.spatial import KDTree

        found = np.zeros(len(points), dtype=bool)
        for site, frame in seams:
            if site not in self._seam_trees:
                self._seam_trees[site] = KDTree(self._grammar.seams[site])
            away, _ = self._seam_trees[site].query(
                transform_points(invert(frame), points), distance_upper_bound=BESIDE * self._grammar.radius
            )
            found |= np.isfinite(away)
        return found
