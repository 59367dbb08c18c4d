"""How much of what the parts of a model allow its shape grammar finds again without them (symmetry §3.3, §3.4)."""

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
from eval.grammars.decomposition import merged, points_of_parts, scene_of_parts
from eval.grammars.exchanges import LARGEST, Exchange, known_exchanges
from stages.grammars.extraction.docked_pieces import DockedPiece
from stages.grammars.extraction.extract import extract_grammar
from stages.grammars.read_surface import read_surface
from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.pose import invert, transform_points
from stages.shape.kit import Kit
from stages.shape.shape import Shape, kit_shape
from stages.symmetry.matching.cell_lookup import is_among
from stages.symmetry.surface.grid import SurfaceGrid

RADIUS = 0.016
"""Radius of similarity, as a share of the longest side of the box (symmetry §5)."""
SAME = 0.8
"""Two exchanges are one if what they take away has this share of what both cover in common, and what they bring."""
WHOLE = 0.9
"""Share of a part that stays as it is, or may go along, where an exchange leaves it whole."""
CHANGE = 4e-3
"""Share of the surface, of what goes and what comes together, from which on an exchange changes something: borders of
cells do not move with dockers."""
NEAR = 0.25
"""Surface is the same if it is so near; unit: cells."""
TURNED = 0.95
"""Cosine of the angle of normals up to which it is the same."""


@dataclass(frozen=True)
class GrammarReturned:
    """Exchanges of a model by its parts and by its grammar. known: how many its parts allow; found: how many of them
    the grammar has; dockers, classes: of the grammar; pairs: of dockers of one class; whole: how many of those leave
    every part whole; seconds: CPU seconds for the grammar."""

    name: str
    parts: int
    known: int
    found: int
    docked_pieces: int
    classes: int
    pairs: int
    whole: int
    seconds: float


@dataclass(frozen=True, eq=False)
class _Change:
    """What an exchange changes, of the points of a sample, bool (p,) each: those that go away, and those whose copies
    come; both where the exemplar has them."""

    goes: BoolArray
    comes: BoolArray

    @property
    def is_any(self) -> bool:
        """Whether it is anything."""
        return bool(self.goes.mean() + self.comes.mean() > CHANGE)

    def is_like(self, other: _Change) -> bool:
        """Whether both, or the one and what takes back the other, change the same."""
        return (_same(self.goes, other.goes) and _same(self.comes, other.comes)) or (
            _same(self.goes, other.comes) and _same(self.comes, other.goes)
        )


def grammar_returned(name: str, kit: Kit) -> GrammarReturned:
    """Merge the first exemplar of a kit, make a grammar of it, and compare what can be exchanged.

    A docking site may be moved within what is symmetric, and the exchange is the same (symmetry §3.3, figure 4a). So
    exchanges are compared by what they change. Raises ConfigError where no grammar can be made.
    """
    shape = kit_shape(kit, kit.exemplars[0].whole)
    begun = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "merged.glb"
        merged(shape, path)
        surface, _ = read_surface(path)
    made = extract_grammar(surface, name, RADIUS, kit.up, np.random.default_rng(0))
    seconds = time.process_time() - begun
    sample = _Sample(shape, made.grid)
    known = [change for each in known_exchanges(kit) if (change := sample.of_parts(each)).is_any]
    ours, whole = [], 0
    for one, other in combinations(made.docked_pieces, 2):
        if one.site == other.site and max(sample.held(one).mean(), sample.held(other).mean()) <= LARGEST:
            change, leaves_whole = sample.of_dockers(one, other)
            if change.is_any:
                ours.append(change)
                whole += leaves_whole
    return GrammarReturned(
        name,
        len(shape.assembly),
        len(known),
        sum(any(each.is_like(one) for one in ours) for each in known),
        len(made.docked_pieces),
        len({each.site for each in made.docked_pieces}),
        len(ours),
        whole,
        seconds,
    )


class _Sample:
    """Points of a shape, each of one part, and what stands where motions take them."""

    def __init__(self, shape: Shape, grid: SurfaceGrid) -> None:
        from scipy.spatial import KDTree

        cloud = points_of_parts(shape)
        self._points, self._normals = cloud.points, cloud.normals
        self._part = cloud.instances.astype(np.int64)
        self._scene, self._part_of = scene_of_parts(shape)
        self._grid, self._cells = grid, KDTree(grid.cells)
        self._home = self._cells_at(np.eye(4))

    def held(self, docker: DockedPiece) -> BoolArray:
        """Which points a docker holds, bool (p,)."""
        return is_among(docker.cells, self._home)

    def of_parts(self, exchange: Exchange) -> _Change:
        """What an exchange of parts changes."""
        back_on, back_part = self._met(invert(exchange.motion))
        on, part = self._met(exchange.motion)
        return _Change(
            exchange.taken[self._part] & ~(back_on & exchange.piece[back_part]),
            exchange.piece[self._part] & ~(on & exchange.taken[part]),
        )

    def of_dockers(self, one: DockedPiece, other: DockedPiece) -> tuple[_Change, bool]:
        """What it changes to put one docker where another of its class is, and whether that leaves every part whole.

        Each part either stays, for hardly any of it changes, or can go as a whole, for what of it is not held is
        symmetric; one part goes at least, and all that go are not most of the surface.
        """
        way = one.frame @ invert(other.frame)  # of the other to where the one is
        changed, whole, goes_any = [], True, False
        for own, docked, there in ((one, other, invert(way)), (other, one, way)):
            on, _ = self._met(there)
            held = self.held(own)
            changed.append(held & ~(on & is_among(docked.cells, self._cells_at(there))))
            goes = self._share(changed[-1]) > 1 - WHOLE
            whole &= bool((self._share(held | on)[goes] >= WHOLE).all())
            whole &= bool((held | goes[self._part]).mean() <= LARGEST)
            goes_any |= bool(goes.any())
        return _Change(*changed), whole and goes_any

    def _share(self, chosen: BoolArray) -> FloatArray:
        """Which share of each part is chosen, float64 (n,)."""
        count = np.bincount(self._part)
        share: FloatArray = np.bincount(self._part, weights=chosen, minlength=len(count)) / np.maximum(count, 1)
        return share

    def _cells_at(self, motion: FloatArray) -> np.ndarray:
        """The occupied cell that is nearest to where a motion (4, 4) takes each point, int64 (p,)."""
        at = (transform_points(motion, self._points) - self._grid.origin) / self._grid.cell_size
        found: np.ndarray = self._cells.query(at - 0.5)[1]
        return found

    def _met(self, motion: FloatArray) -> tuple[BoolArray, np.ndarray]:
        """Whether the surface is where a motion (4, 4) takes each point, and as there, bool (p,); and the part that is
        nearest to that place, int64 (p,)."""
        at = transform_points(motion, self._points)
        closest = self._scene.compute_closest_points(o3d.core.Tensor(at.astype(np.float32)))
        away = np.linalg.norm(closest["points"].numpy() - at, axis=1)
        turned = (closest["primitive_normals"].numpy() * (self._normals @ motion[:3, :3].T)).sum(axis=1)
        parts = np.array([self._part_of[each] for each in closest["geometry_ids"].numpy().tolist()], dtype=np.int64)
        return (away < NEAR * self._grid.cell_size) & (turned > TURNED), parts


def _same(one: BoolArray, other: BoolArray) -> bool:
    """Whether two sets of points have SAME of what both cover in common."""
    return bool((one & other).sum() >= SAME * (one | other).sum())


def grammar_table(kits: Iterable[tuple[str, Kit]]) -> Table:
    """A row for each model, of which the parts are known."""
    rows: list[tuple[Cell, ...]] = []
    for name, kit in kits:
        each = grammar_returned(name, kit)
        found: Cell = 100 * each.found / each.known if each.known else ""
        whole: Cell = 100 * each.whole / each.pairs if each.pairs else ""
        counts = (f"{each.docked_pieces} / {each.classes}", each.pairs)
        rows.append((name, each.parts, each.known, found, *counts, whole, each.seconds))
    columns = ("model", "parts", "exchanges", "found %", "dockers / classes", "pairs", "whole parts %", "CPU s")
    notes = (
        "Models whose parts are known, merged to one mesh and welded, of which a shape grammar is made by symmetry, "
        f"radius {100 * RADIUS:g} %. Exchanges: what may take each other's place by the parts. Motions lay the model "
        "upon itself, equal parts upon equal ones; as few of the regions left over change places as it takes for every "
        "part to have neighbours as one like it has them in the model: elementary docking sites (symmetry §3.3), of "
        "parts and their neighbours in place of points and the radius. Pairs: of dockers of one class that are not the "
        "same, each of which may stand where the other does. Of both only pieces of at most half of the surface count: "
        "to exchange more is to exchange the rest. Found: exchanges that are a pair, by the surface that goes and the "
        f"surface that comes, {100 * SAME:g} % of what both cover in common of each; for a site may be moved within "
        "what is symmetric, and the exchange is the same. Whole parts: pairs that let every part stay or go as a "
        f"whole, {100 * WHOLE:g} % of it. Whether what comes runs into what stays is asked of neither.",
    )
    return Table("How much of the grammar of known parts comes back", columns, tuple(rows), notes)
