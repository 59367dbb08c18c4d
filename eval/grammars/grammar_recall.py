"""Grammar recall: the exchanges known from a model's parts that its shape grammar finds (symmetry §3.3, §3.4)."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
import open3d as o3d

from eval.engine.table import Cell, Table
from eval.grammars.decomposition import points_of_parts, scene_of_parts, write_merged
from eval.grammars.exchanges import MAX_PIECE_SHARE, Exchange, known_exchanges
from stages.grammars.extraction.docked_pieces import DockedPiece
from stages.grammars.extraction.extract import extract_grammar
from stages.grammars.read_surface import read_surface
from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.pose import invert, transform_points
from stages.shape.kit import Kit
from stages.shape.shape import Shape, kit_shape
from stages.symmetry.matching.cell_lookup import is_among
from stages.symmetry.surface.grid import SurfaceGrid

RADIUS_SHARE = 0.016
"""Radius of similarity, as a share of the longest side of the box (symmetry §5)."""
MIN_EXCHANGE_OVERLAP = 0.8
"""Intersection over union from which two exchanges are one, of what they remove and of what they add."""
MIN_WHOLE_SHARE = 0.9
"""Share of a part that stays, or leaves, in an exchange of whole parts."""
MIN_CHANGED_SHARE = 4e-3
"""Of the surface, removed and added; borders of cells do not move with docked pieces."""
MAX_DISTANCE_CELLS = 0.25
"""Between surfaces that are the same."""
MIN_NORMAL_COSINE = 0.95
"""Between normals of surfaces that are the same."""


@dataclass(frozen=True)
class GrammarRecall:
    """Exchanges of a model by its parts and by its grammar."""

    name: str
    parts: int
    known: int
    """Exchanges that the parts allow."""
    found: int
    """Of these, in the grammar."""
    docked_pieces: int
    classes: int
    """Of docked pieces."""
    pairs: int
    """Exchanges of two docked pieces of one class."""
    whole: int
    """Of these, of whole parts."""
    seconds: float
    """CPU seconds for the grammar."""


@dataclass(frozen=True, eq=False)
class _Change:
    """The change of an exchange, as points of a sample, bool (p,) each."""

    removed: BoolArray
    added: BoolArray
    """Points whose copies are added."""

    @property
    def is_any(self) -> bool:
        return bool(self.removed.mean() + self.added.mean() > MIN_CHANGED_SHARE)

    def is_like(self, other: _Change) -> bool:
        """Return whether both change the same, or one reverts the other."""
        return (_same(self.removed, other.removed) and _same(self.added, other.added)) or (
            _same(self.removed, other.added) and _same(self.added, other.removed)
        )


def measure_recall(name: str, kit: Kit) -> GrammarRecall:
    """Merge the first exemplar of a kit, extract its grammar, and compare the exchanges.

    A docking site can move within what is symmetric without changing the exchange (symmetry §3.3, figure 4a), so
    exchanges are compared by what they change. Raises ConfigError if no grammar can be extracted.
    """
    shape = kit_shape(kit, kit.exemplars[0].whole)
    start = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "merged.glb"
        write_merged(shape, path)
        surface, _, _ = read_surface(path)
    extraction = extract_grammar(surface, name, RADIUS_SHARE, kit.up, np.random.default_rng(0))
    seconds = time.process_time() - start
    sample = _Sample(shape, extraction.grid)
    known = [change for exchange in known_exchanges(kit) if (change := sample.of_parts(exchange)).is_any]
    found, whole = [], 0
    for first, second in combinations(extraction.docked_pieces, 2):
        if first.site != second.site:
            continue
        if max(sample.held(first).mean(), sample.held(second).mean()) <= MAX_PIECE_SHARE:
            change, leaves_whole = sample.of_docked_pieces(first, second)
            if change.is_any:
                found.append(change)
                whole += leaves_whole
    return GrammarRecall(
        name,
        len(shape.assembly),
        len(known),
        sum(any(change.is_like(other) for other in found) for change in known),
        len(extraction.docked_pieces),
        len({piece.site for piece in extraction.docked_pieces}),
        len(found),
        whole,
        seconds,
    )


class _Sample:
    """Points of a shape, each of one part, and the surface at their images under transforms."""

    def __init__(self, shape: Shape, grid: SurfaceGrid) -> None:
        from scipy.spatial import KDTree

        cloud = points_of_parts(shape)
        self._points, self._normals = cloud.points, cloud.normals
        self._part = cloud.instances.astype(np.int64)
        self._scene, self._part_of = scene_of_parts(shape)
        self._grid, self._cells = grid, KDTree(grid.cells)
        self._home = self._cells_at(np.eye(4))

    def held(self, piece: DockedPiece) -> BoolArray:
        """Return which points a docked piece holds, bool (p,)."""
        return is_among(piece.cells, self._home)

    def of_parts(self, exchange: Exchange) -> _Change:
        """Return the change of an exchange of parts."""
        covered_before, part_before = self._surface_at(invert(exchange.transform))
        covered, part = self._surface_at(exchange.transform)
        return _Change(
            exchange.removed[self._part] & ~(covered_before & exchange.piece[part_before]),
            exchange.piece[self._part] & ~(covered & exchange.removed[part]),
        )

    def of_docked_pieces(self, first: DockedPiece, second: DockedPiece) -> tuple[_Change, bool]:
        """Return the change of replacing one docked piece by another of its class, and whether it keeps parts whole.

        Each part then either stays, with hardly any change, or can leave as a whole, since the rest of it is symmetric.
        At least one part leaves, and those that leave are not most of the surface.
        """
        transform = first.frame @ invert(second.frame)  # from the second to where the first is
        changed, whole, any_leaves = [], True, False
        for own, other, there in ((first, second, invert(transform)), (second, first, transform)):
            covered, _ = self._surface_at(there)
            held = self.held(own)
            changed.append(held & ~(covered & is_among(other.cells, self._cells_at(there))))
            leaves = self._share(changed[-1]) > 1 - MIN_WHOLE_SHARE
            whole &= bool((self._share(held | covered)[leaves] >= MIN_WHOLE_SHARE).all())
            whole &= bool((held | leaves[self._part]).mean() <= MAX_PIECE_SHARE)
            any_leaves |= bool(leaves.any())
        return _Change(*changed), whole and any_leaves

    def _share(self, chosen: BoolArray) -> FloatArray:
        """Return the chosen share of each part, float64 (n,)."""
        count = np.bincount(self._part)
        share: FloatArray = np.bincount(self._part, weights=chosen, minlength=len(count)) / np.maximum(count, 1)
        return share

    def _cells_at(self, transform: FloatArray) -> np.ndarray:
        """Return the occupied cell nearest to each point's image under a transform (4, 4), int64 (p,)."""
        image = (transform_points(transform, self._points) - self._grid.origin) / self._grid.cell_size
        found: np.ndarray = self._cells.query(image - 0.5)[1]
        return found

    def _surface_at(self, transform: FloatArray) -> tuple[BoolArray, np.ndarray]:
        """Look at the surface at each point's image under a transform (4, 4).

        Return whether it matches in position and normal, bool (p,), and the nearest part, int64 (p,).
        """
        image = transform_points(transform, self._points)
        closest = self._scene.compute_closest_points(o3d.core.Tensor(image.astype(np.float32)))
        distance = np.linalg.norm(closest["points"].numpy() - image, axis=1)
        cosine = (closest["primitive_normals"].numpy() * (self._normals @ transform[:3, :3].T)).sum(axis=1)
        parts = np.array(
            [self._part_of[geometry] for geometry in closest["geometry_ids"].numpy().tolist()], dtype=np.int64
        )
        return (distance < MAX_DISTANCE_CELLS * self._grid.cell_size) & (cosine > MIN_NORMAL_COSINE), parts


def _same(first: BoolArray, second: BoolArray) -> bool:
    """Return whether two sets of points overlap by MIN_EXCHANGE_OVERLAP, intersection over union."""
    return bool((first & second).sum() >= MIN_EXCHANGE_OVERLAP * (first | second).sum())


def grammar_table(kits: Iterable[tuple[str, Kit]]) -> Table:
    """Return one row for each model with known parts."""
    rows: list[tuple[Cell, ...]] = []
    for name, kit in kits:
        recall = measure_recall(name, kit)
        found: Cell = 100 * recall.found / recall.known if recall.known else ""
        whole: Cell = 100 * recall.whole / recall.pairs if recall.pairs else ""
        counts = (f"{recall.docked_pieces} / {recall.classes}", recall.pairs)
        rows.append((name, recall.parts, recall.known, found, *counts, whole, recall.seconds))
    columns = ("model", "parts", "exchanges", "found %", "pieces / classes", "pairs", "whole parts %", "CPU s")
    notes = (
        "Models with known parts, merged to one mesh and welded, and their shape grammar by symmetry, with a radius of "
        f"{100 * RADIUS_SHARE:g} %. Exchanges: those that the parts allow. Transforms align equal parts of the model; "
        "as "
        "few of the remaining regions as possible change places so that every part keeps a neighbourhood of the model. "
        "These are elementary docking sites (symmetry §3.3), with parts and neighbours for points and radius. Pairs: "
        "exchanges of two docked pieces of one class. Both count only pieces of at most half of the surface: a larger "
        "exchange is one of the rest. Found: exchanges that are a pair, by the removed and the added surface, with "
        f"{100 * MIN_EXCHANGE_OVERLAP:g} % intersection over union, since a site can move within what is symmetric. "
        f"Whole parts: pairs that keep or replace every part as a whole, by {100 * MIN_WHOLE_SHARE:g} % of it. "
        "Collisions of added and kept parts are not checked.",
    )
    return Table("Grammar recall of known parts", columns, tuple(rows), notes)
