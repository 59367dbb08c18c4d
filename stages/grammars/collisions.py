"""Whether a terminal collides with others: it may come near them only at seams, or as in the exemplar
(symmetry §3.2, §3.4.3)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from stages.grammars.bounded_cache import BoundedCache
from stages.grammars.derivation import Derivation, ResizedGrid, row_seams
from stages.grammars.derived_shape import PlacedTerminal, placed_terminals
from stages.grammars.grammar import ShapeGrammar
from stages.grammars.terminal_samples import TerminalSamples
from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.pose import invert, transform_points

NEAR_CELLS = 1.8
"""Terminals are near each other if two of their points, one per cell, are closer, in cells."""
SEAM_RADII = 2.0
"""Terminals may be near each other within this distance of a seam, in radii of similarity."""
POSE_DECIMALS = 6
"""Decimals of relative poses that count, with translations in cells."""
MAX_CACHE_BYTES = 100_000_000
BYTES_PER_KEY = 500
"""About the size of a key of the cache."""
SAME_POSE_CELLS = 0.5
"""Distance of the corners of a box, in cells, up to which two poses are the same."""


class Collisions:
    """What is near what in the exemplar, as far as the grammar shows it, and whether anything else is near."""

    def __init__(self, grammar: ShapeGrammar) -> None:
        self._grammar = grammar
        self.samples = TerminalSamples(grammar)
        self._cell = self.samples.cell
        self._near_cache: BoundedCache[tuple[int, int, bytes], IntArray] = BoundedCache(
            lambda key: self._points_near(*key), lambda near: BYTES_PER_KEY + near.nbytes, MAX_CACHE_BYTES
        )
        self._seam_trees: dict[int, Any] = {}

    def collides(
        self, terminal: PlacedTerminal, others: Sequence[PlacedTerminal], seams: Sequence[tuple[int, FloatArray]]
    ) -> bool:
        """Return whether a terminal is near another one away from all seams and unlike anything in the exemplar.

        seams: the class of a site and its frame (4, 4) each
        """
        for other in others:
            near = self._near(terminal, other)
            if not len(near) or self._as_in_exemplar(terminal, other):
                continue
            points = transform_points(terminal.pose, self.samples[terminal.mesh].points[near])
            if not self._at_seams(points, seams).all():
                return True
        return False

    def grid_collides(self, resized: ResizedGrid) -> bool:
        """Return whether pieces of a resized grid collide."""
        grid = self._grammar.grids[resized.grid]
        seams = row_seams(grid.transforms, grid.frames, grid.sites, resized.counts)
        pieces = placed_terminals(self._grammar, resized)
        return any(self.collides(piece, pieces[:number], seams) for number, piece in enumerate(pieces))

    @cached_property
    def _known(self) -> dict[tuple[int, int], list[FloatArray]]:
        """For each two meshes the poses of the second relative to the first in the exemplar, near or not."""
        grammar = self._grammar
        shown: list[Derivation | ResizedGrid] = [
            Derivation(number, tuple(non_terminal.original for non_terminal in production.non_terminals))
            for number, production in enumerate(grammar.productions)
        ]
        shown += [ResizedGrid(number, grid.counts) for number, grid in enumerate(grammar.grids)]
        known: dict[tuple[int, int], list[FloatArray]] = {}
        for derivation in shown:
            terminals = placed_terminals(grammar, derivation)
            for number, one in enumerate(terminals):
                for other in terminals[:number]:
                    pose = invert(one.pose) @ other.pose
                    poses = known.setdefault((one.mesh, other.mesh), [])
                    if not self._is_listed(poses, other.mesh, pose):
                        poses.append(pose)
                        known.setdefault((other.mesh, one.mesh), []).append(invert(pose))
        return known

    def _as_in_exemplar(self, one: PlacedTerminal, other: PlacedTerminal) -> bool:
        poses = self._known.get((one.mesh, other.mesh), [])
        return self._is_listed(poses, other.mesh, invert(one.pose) @ other.pose)

    def _is_listed(self, poses: Sequence[FloatArray], mesh: int, pose: FloatArray) -> bool:
        """Return whether a pose of a mesh is about one of `poses`."""
        corners = self._grammar.bounds[mesh]
        own, limit = transform_points(pose, corners), SAME_POSE_CELLS * self._cell
        return any(np.abs(transform_points(known, corners) - own).max() < limit for known in poses)

    def _near(self, one: PlacedTerminal, other: PlacedTerminal) -> IntArray:
        """Return which points of a terminal are near another one, int32 (k,); cached, because relative poses recur."""
        pose = invert(other.pose) @ one.pose
        pose[:3, 3] /= self._cell
        pose = np.round(pose, POSE_DECIMALS) + 0.0
        return self._near_cache[one.mesh, other.mesh, pose.tobytes()]

    def _points_near(self, mesh: int, other: int, key: bytes) -> IntArray:
        """Return which points of a mesh are near another one, int32 (k,).

        key: bytes of the pose, float64 (4, 4), in the coordinates of the other one, with its translation in cells
        """
        pose = np.frombuffer(key).reshape(4, 4).copy()
        pose[:3, 3] *= self._cell
        low, high = self._grammar.bounds[other]
        reach = NEAR_CELLS * self._cell
        box = self._grammar.bounds[mesh]
        middle, half = box.mean(axis=0), (box[1] - box[0]) / 2
        around, wide = transform_points(pose, middle), np.abs(pose[:3, :3]) @ half
        if ((around - wide > high + reach) | (around + wide < low - reach)).any():
            return np.empty(0, dtype=np.int32)
        moved = transform_points(pose, self.samples[mesh].points)
        close = np.flatnonzero(((moved > low - reach) & (moved < high + reach)).all(axis=1))
        distance, _ = self.samples[other].tree.query(moved[close], distance_upper_bound=reach)
        near: IntArray = close[np.isfinite(distance)].astype(np.int32)
        return near

    def _at_seams(self, points: FloatArray, seams: Sequence[tuple[int, FloatArray]]) -> BoolArray:
        """Return which points (n, 3) lie near a seam, bool (n,)."""
        from scipy.spatial import KDTree

        near = np.zeros(len(points), dtype=bool)
        for site, frame in seams:
            if site not in self._seam_trees:
                self._seam_trees[site] = KDTree(self._grammar.seams[site])
            distance, _ = self._seam_trees[site].query(
                transform_points(invert(frame), points), distance_upper_bound=SEAM_RADII * self._grammar.radius
            )
            near |= np.isfinite(distance)
        return near
