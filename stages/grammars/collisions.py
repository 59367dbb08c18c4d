"""Whether a piece of a grammar runs into others: it may come near them at seams alone, or as it does in the exemplar
(symmetry §3.2, §3.4.3)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from stages.exemplars.symmetry.derivations import Derivation, row_seams
from stages.grammars.derivation import Piece, Resized, pieces_of
from stages.grammars.grammar import ShapeGrammar
from stages.grammars.samples import TerminalSamples
from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.pose import invert, transform_points

__all__ = ["Collisions"]

NEAR = 1.8
"""Pieces are apart where no two of their points, one in each cell, are closer than so many cells."""
BESIDE = 2.0
"""At a seam they may be near as far as so many radii from it."""
DECIMALS = 6
"""Digits of relative poses, shifts in cells, that count."""
SAME = 0.5
"""Cells by which the corners of a piece may lie elsewhere and the piece still stand as another one does."""


class Collisions:
    """What stands near what in the exemplar, as far as the grammar shows it, and whether anything else is near."""

    def __init__(self, grammar: ShapeGrammar) -> None:
        self._grammar = grammar
        self.samples = TerminalSamples(grammar)
        self._cell = self.samples.cell
        self._answers: dict[tuple[int, int, bytes], BoolArray | None] = {}
        self._trees: dict[int, Any] = {}
        self._seam_trees: dict[int, Any] = {}

    def collides(self, piece: Piece, others: Sequence[Piece], seams: Sequence[tuple[int, FloatArray]]) -> bool:
        """Whether a piece is near one of others where no seam is, a class of sites and its frame (4, 4) each, and
        nothing in the exemplar is so near."""
        own: FloatArray | None = None
        for other in others:
            near = self._near(piece, other)
            if near is None or self._as_in_exemplar(piece, other):
                continue
            if own is None:
                own = transform_points(piece.pose, self.samples[piece.mesh].points)
            if (near & ~self._at_seams(own, near, seams)).any():
                return True
        return False

    def whole(self, made: Resized) -> bool:
        """Whether pieces of a resized grid run into each other."""
        grid = self._grammar.grids[made.grid]
        seams = row_seams(grid.motions, grid.frames, grid.sites, made.counts)
        pieces = pieces_of(self._grammar, made)
        return any(self.collides(each, pieces[:place], seams) for place, each in enumerate(pieces))

    @cached_property
    def _known(self) -> dict[tuple[int, int], list[FloatArray]]:
        """For each two meshes how the second stands to the first where both are near in the exemplar."""
        grammar = self._grammar
        shown: list[Derivation | Resized] = [
            Derivation(number, tuple(place.original for place in rule.places))
            for number, rule in enumerate(grammar.rules)
        ]
        shown += [Resized(number, grid.counts) for number, grid in enumerate(grammar.grids)]
        found: dict[tuple[int, int], list[FloatArray]] = {}
        for made in shown:
            pieces = pieces_of(grammar, made)
            for place, one in enumerate(pieces):
                for other in pieces[:place]:
                    pose = invert(one.pose) @ other.pose
                    listed = found.setdefault((one.mesh, other.mesh), [])
                    if not self._listed(listed, other.mesh, pose) and self._near(one, other) is not None:
                        listed.append(pose)
                        found.setdefault((other.mesh, one.mesh), []).append(invert(pose))
        return found

    def _as_in_exemplar(self, one: Piece, other: Piece) -> bool:
        listed = self._known.get((one.mesh, other.mesh), [])
        return self._listed(listed, other.mesh, invert(one.pose) @ other.pose)

    def _listed(self, listed: Sequence[FloatArray], mesh: int, pose: FloatArray) -> bool:
        """Whether a pose of a mesh is one of those listed."""
        corners = self._grammar.meshes[mesh].bounds
        here = transform_points(pose, corners)
        return any(np.abs(transform_points(each, corners) - here).max() < SAME * self._cell for each in listed)

    def _tree(self, mesh: int) -> Any:
        from scipy.spatial import KDTree

        if mesh not in self._trees:
            self._trees[mesh] = KDTree(self.samples[mesh].points)
        return self._trees[mesh]

    def _near(self, one: Piece, other: Piece) -> BoolArray | None:
        """Which points of a piece are near another piece, bool (n,); None for none. Relative poses recur, so that each
        is answered once, at its rounded value."""
        pose = invert(other.pose) @ one.pose
        pose[:3, 3] /= self._cell
        pose = np.round(pose, DECIMALS) + 0.0
        key = (one.mesh, other.mesh, pose.tobytes())
        if key not in self._answers:
            pose[:3, 3] *= self._cell
            self._answers[key] = self._points_near(one.mesh, other.mesh, pose)
        return self._answers[key]

    def _points_near(self, mesh: int, other: int, pose: FloatArray) -> BoolArray | None:
        """Which points of a mesh at a pose in the coordinates of another are near that."""
        low, high = self._grammar.meshes[other].bounds
        reach = NEAR * self._cell
        box = self._grammar.meshes[mesh].bounds
        middle, half = box.mean(axis=0), (box[1] - box[0]) / 2
        around, wide = transform_points(pose, middle), np.abs(pose[:3, :3]) @ half
        if ((around - wide > high + reach) | (around + wide < low - reach)).any():
            return None
        moved = transform_points(pose, self.samples[mesh].points)
        close = np.flatnonzero(((moved > low - reach) & (moved < high + reach)).all(axis=1))
        away, _ = self._tree(other).query(moved[close], distance_upper_bound=reach)
        found = np.zeros(len(moved), dtype=bool)
        found[close] = np.isfinite(away)
        return found if found.any() else None

    def _at_seams(self, points: FloatArray, asked: BoolArray, seams: Sequence[tuple[int, FloatArray]]) -> BoolArray:
        """Which of the points asked for lie beside a seam, bool (n,)."""
        from scipy.spatial import KDTree

        found = np.zeros(len(points), dtype=bool)
        places = np.flatnonzero(asked)
        for site, frame in seams:
            if site not in self._seam_trees:
                self._seam_trees[site] = KDTree(self._grammar.seams[site])
            away, _ = self._seam_trees[site].query(
                transform_points(invert(frame), points[places]), distance_upper_bound=BESIDE * self._grammar.radius
            )
            found[places] |= np.isfinite(away)
        return found
