"""Parallel planes that cut a surface in equal sections: docking sites that take everything that passes there, slabs
and rails included (symmetry §3.2, §3.4.1)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.triangles import unit_normals
from stages.symmetry.sections.cross_sections import PlaneSection, plane_section, shared_share
from stages.symmetry.surface.boundary_lines import SAME_ANGLE_RADIANS
from stages.symmetry.surface.corner_frames import creases
from stages.symmetry.surface.grid import has_area
from stages.symmetry.surface.welding import weld

# Lengths are shares of the longest side of the model's box.
SAME_POINT_SHARE = 1.5e-3
"""Points of sections that are closer are equal."""
POINT_SPACING = 2.5e-3
"""Spacing of points along a section, less than twice SAME_POINT_SHARE: sections may be divided differently."""
MIN_EQUAL_SHARE = 0.92
"""Sections that share more are equal: a cable that hangs freely makes no difference."""
SAME_PLANE_SHARE = 1e-5
"""Vertices that are closer lie on one plane."""
MIN_STRETCH_SHARE = 4e-3
"""Shorter stretches of one section are ignored."""
MAX_EDGE_DIRECTIONS = 3
"""Directions of edges that are tried after the axes, those of the largest total length."""
SAME_DIRECTION_RADIANS = 5e-3
MAX_SQUARE_COSINE = 0.05
"""Two families of planes are square to each other if the cosine of their angle is less."""
MAX_ROW_SHIFTS = 5
"""Shifts along a direction that are tried for rows, those of most vertices."""
MATES_PER_VERTEX = 8
"""Each vertex votes for its distances to this number of following vertices."""
MIN_SHIFT_SHARE = 0.012
MAX_TESTED_ROWS = 16
"""Rows that are tested exactly, those with most promising planes first."""
PHASES_PER_SHIFT = 4
"""Offsets within a shift at which the planes of a row are tried."""
MAX_DISTANCE_SHARE = 0.4
"""Planes of one kind that are farther from each other are of no use."""
JOINT_SHARE = 0.5
"""Share of the shortest stretch of a kind that is cut out as a joint."""
MAX_JOINTS = 16
LONG_STRETCH_SHARE = 0.08
"""A longer stretch is cut although no other has its section."""
SLABS_PER_LONG_STRETCH = 4
MIN_BORDERS = 3
"""A family has at least this number of planes."""

Stretch = tuple[float, float, int]
"""Begin, end and kind of a stretch along which the section stays the same."""


@dataclass(frozen=True)
class ParallelCuts:
    """A family of parallel planes at which a model is cut.

    normal: float64 (3,), unit length
    offsets: float64 (n,), ascending; a plane is where `normal` times x equals one of them
    planes: how many of them are docking sites; a joint, cut out between two planes, counts once
    """

    normal: FloatArray
    offsets: FloatArray
    planes: int


def find_parallel_cuts(corners: FloatArray) -> list[ParallelCuts]:
    """Find families of planes that cut triangles (f, 3, 3) into slabs that may be repeated or removed.

    Families are square to each other, the one of most planes first; the list is empty where no sections are equal.

    The directions are the axes and those of long edges. Along each direction a section stays the same over a stretch of
    walls, or recurs after a shift. Two planes with equal sections are docking sites of each other. Thin joints are cut
    from stretches and are equal, whatever lies between them, so that parts between joints can change places.
    """
    corners = corners[has_area(corners)]
    normals = unit_normals(corners)
    extent = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    indices, vertices = weld(corners, SAME_PLANE_SHARE * extent)
    edges, _, _ = creases(indices, normals)
    families = []
    for direction in _directions(vertices[edges[:, 1]] - vertices[edges[:, 0]]):
        model = _Model(corners, normals, direction, extent)
        constant = _constant_stretches(model)
        candidates = _joints(model, constant), _rows(model, constant, vertices)
        best = max(candidates, key=lambda family: family.planes)
        if len(best.offsets) >= MIN_BORDERS:
            families.append(best)
    families.sort(key=lambda family: -family.planes)
    chosen: list[ParallelCuts] = []
    for family in families:
        if all(abs(float(family.normal @ other.normal)) < MAX_SQUARE_COSINE for other in chosen):
            chosen.append(family)
    return chosen


@dataclass(frozen=True)
class _Model:
    """A model and a direction to cut across.

    corners: float64 (f, 3, 3), triangles
    normals: float64 (f, 3), unit length
    direction: float64 (3,), unit length
    extent: longest side of the model's box
    """

    corners: FloatArray
    normals: FloatArray
    direction: FloatArray
    extent: float

    @cached_property
    def heights(self) -> FloatArray:
        """Height of each corner along the direction, float64 (f, 3)."""
        heights: FloatArray = self.corners @ self.direction
        return heights

    @cached_property
    def spans(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest corner of each triangle along the direction, float64 (f,) each."""
        return self.heights.min(axis=1), self.heights.max(axis=1)

    def section(self, offset: float) -> PlaneSection:
        low, high = self.spans
        crossed = np.flatnonzero((low <= offset) & (high > offset))
        heights = self.heights[crossed] - offset
        return plane_section(self.corners[crossed], self.normals[crossed], heights, POINT_SPACING * self.extent)

    def likeness(self, one: PlaneSection, other: PlaneSection, shift: float) -> float:
        """Return how equal two sections are once one is shifted along the direction, from 0 (not equal) to 1."""
        tolerance = SAME_POINT_SHARE * self.extent
        shared = shared_share(one, other, shift * self.direction, tolerance, MIN_EQUAL_SHARE)
        return max(0.0, shared - MIN_EQUAL_SHARE) / (1 - MIN_EQUAL_SHARE)

    def kinds(self, offsets: FloatArray) -> np.ndarray:
        """Return for each ascending offset the index of the first with an equal section, int64 (n,)."""
        sections = [self.section(offset) for offset in offsets]
        signatures = self.signatures(sections)
        kinds = np.arange(len(offsets))
        for index, offset in enumerate(offsets):
            is_first = kinds[:index] == np.arange(index)
            firsts = np.flatnonzero(is_first & _close(signatures[:index], signatures[index]))
            for first in firsts.tolist():
                if self.likeness(sections[first], sections[index], float(offset - offsets[first])) > 0:
                    kinds[index] = first
                    break
        return kinds

    def signatures(self, sections: Sequence[PlaneSection]) -> FloatArray:
        """Return length, centre and spread of sections, float64 (n, 10); equal sections hardly differ in them."""
        signatures = np.zeros((len(sections), 10))
        for index, section in enumerate(sections):
            if section.length == 0:
                continue
            weights = section.lengths / section.length
            across = (section.points - self.corners[0, 0]) / self.extent
            across = across - np.outer(across @ self.direction, self.direction)
            middle = weights @ across
            spread = (across - middle).T @ ((across - middle) * weights[:, None])
            signatures[index] = np.r_[np.log(section.length / self.extent), middle, spread[np.triu_indices(3)]]
        return signatures


def _close(signatures: FloatArray, others: FloatArray) -> BoolArray:
    """Return which signatures (n, 10) may belong to sections equal to others (n, 10), or to one (10,): bool (n,)."""
    close: BoolArray = np.asarray((np.abs(signatures - others) < 1 - MIN_EQUAL_SHARE).all(axis=1))
    return close


def _directions(edges: FloatArray) -> list[FloatArray]:
    """Return the axes, and the directions (3,) in which edges (e, 3) have the largest total length."""
    lengths = np.linalg.norm(edges, axis=1)
    edges, lengths = edges[lengths > 0], lengths[lengths > 0]
    units = edges / lengths[:, None]
    first = np.abs(units).argmax(axis=1)
    units *= np.sign(units[np.arange(len(units)), first])[:, None]
    directions: list[FloatArray] = list(np.eye(3))
    left = (np.abs(units) < np.cos(2 * SAME_DIRECTION_RADIANS)).all(axis=1)
    while left.any() and len(directions) < MAX_EDGE_DIRECTIONS + 3:
        _, bucket = np.unique(np.round(units[left] / SAME_DIRECTION_RADIANS), axis=0, return_inverse=True)
        total = np.bincount(bucket.reshape(-1), weights=lengths[left])
        members = units[left][bucket.reshape(-1) == total.argmax()]
        weights = lengths[left][bucket.reshape(-1) == total.argmax()]
        direction = (members * weights[:, None]).sum(axis=0)
        direction /= np.linalg.norm(direction)
        directions.append(direction)
        left &= np.abs(units @ direction) < np.cos(2 * SAME_DIRECTION_RADIANS)
    return directions


def _constant_stretches(model: _Model) -> FloatArray:
    """Return the stretches along which the section stays the same, float64 (n, 2), ascending."""
    heights, (low, high) = model.heights, model.spans
    _, first = np.unique(np.round(heights / (SAME_PLANE_SHARE * model.extent)), return_index=True)
    levels = heights.reshape(-1)[first]
    slanted = np.abs(model.normals @ model.direction) > SAME_ANGLE_RADIANS
    slanted &= high - low > SAME_PLANE_SHARE * model.extent
    opened = np.searchsorted(np.sort(low[slanted]), levels[:-1] + SAME_PLANE_SHARE / 2 * model.extent)
    closed = np.searchsorted(np.sort(high[slanted]), levels[:-1] + 2 * SAME_PLANE_SHARE * model.extent)
    constant = (opened == closed) & (np.diff(levels) > MIN_STRETCH_SHARE * model.extent)
    stretches: FloatArray = np.column_stack([levels[:-1], levels[1:]])[constant]
    return stretches


def _joints(model: _Model, constant: FloatArray) -> ParallelCuts:
    """Cut joints in constant stretches (n, 2) of recurring kinds, and cut long stretches of other kinds."""
    kinds = model.kinds(constant.mean(axis=1))
    stretches: list[Stretch] = []
    for (begin, end), kind in zip(constant.tolist(), kinds.tolist(), strict=True):
        if stretches and stretches[-1][2] == kind and begin - stretches[-1][1] < SAME_PLANE_SHARE * model.extent:
            stretches[-1] = (stretches[-1][0], end, kind)
        else:
            stretches.append((begin, end, kind))
    borders: list[float] = []
    total = 0
    for members in _by_kind(stretches):
        if len(members) == 1:
            begin, end, _ = members[0]
            if end - begin > LONG_STRETCH_SHARE * model.extent:
                borders += np.linspace(begin, end, SLABS_PER_LONG_STRETCH + 3)[1:-1].tolist()
                total += SLABS_PER_LONG_STRETCH + 1
            continue
        near = _with_near_mate(members, float(np.ptp(model.heights)))
        if not near or (total and total + len(near) > MAX_JOINTS):
            continue
        width = JOINT_SHARE * min(end - begin for begin, end, _ in near)
        for begin, end, _ in near:
            borders += [(begin + end - width) / 2, (begin + end + width) / 2]
        total += len(near)
    return ParallelCuts(model.direction, np.sort(np.array(borders)), total)


def _by_kind(stretches: list[Stretch]) -> list[list[Stretch]]:
    """Group stretches by kind, the most common kind first."""
    kinds: dict[int, list[Stretch]] = {}
    for stretch in stretches:
        kinds.setdefault(stretch[2], []).append(stretch)
    return sorted(kinds.values(), key=lambda members: -len(members))


def _with_near_mate(members: list[Stretch], extent: float) -> list[Stretch]:
    """Return the stretches that are not far from all others."""
    reach = MAX_DISTANCE_SHARE * extent
    return [
        stretch
        for stretch in members
        if any(other is not stretch and abs(other[0] - stretch[0]) < reach for other in members)
    ]


def _rows(model: _Model, constant: FloatArray, vertices: FloatArray) -> ParallelCuts:
    """Return the planes at which the section recurs after one shift, for the shift with most and best recurrences.

    constant: float64 (n, 2), stretches of one section; planes in a stretch longer than the shift are left out, because
        any plane there would do

    Shifts are ranked by the signatures of their sections, and tested until no remaining one can be better.
    """
    begin, end = float(model.heights.min()), float(model.heights.max())
    candidates = []
    for shift in _shifts(model, vertices):
        for phase in range(PHASES_PER_SHIFT):
            offsets = np.arange(begin + shift * (phase + 0.5) / PHASES_PER_SHIFT, end, shift)
            long = constant[constant[:, 1] - constant[:, 0] > shift]
            inside = (offsets[:, None] > long[:, 0]) & (offsets[:, None] < long[:, 1])
            offsets = offsets[~inside.any(axis=1)]
            signatures = model.signatures([model.section(offset) for offset in offsets])
            candidates.append((int(_in_rows(_close(signatures[1:], signatures[:-1])).sum()), offsets))
    best, best_score = ParallelCuts(model.direction, np.empty(0), 0), 0.0
    for bound, offsets in sorted(candidates, key=lambda candidate: -candidate[0])[:MAX_TESTED_ROWS]:
        if bound <= best_score:
            break
        sections = [model.section(offset) for offset in offsets]
        likeness = _likeness_to_first(model, sections, offsets)
        if sum(likeness) > best_score:
            chosen = offsets[_in_rows(np.array(likeness) > 0)]
            best, best_score = ParallelCuts(model.direction, chosen, len(chosen)), sum(likeness)
    return best


def _likeness_to_first(model: _Model, sections: Sequence[PlaneSection], offsets: FloatArray) -> list[float]:
    """Return the likeness of each section but the first to the first of its row, 0 where a new row begins.

    It is not compared to the section before it: a shift that is slightly wrong hardly shows from plane to plane, and
    adds up.
    """
    first, likeness = 0, []
    for index in range(1, len(sections)):
        likeness.append(model.likeness(sections[first], sections[index], float(offsets[index] - offsets[first])))
        if likeness[-1] == 0:
            first = index
    return likeness


def _in_rows(same: np.ndarray) -> BoolArray:
    """Return which planes equal the one before or after; `same`, bool (n - 1,): whether each equals the next."""
    in_rows: BoolArray = np.r_[False, same] | np.r_[same, False]
    return in_rows


def _shifts(model: _Model, vertices: FloatArray) -> Iterator[float]:
    """Yield the most common distances of vertices (v, 3) that lie on one line along the direction."""
    across = np.linalg.svd(model.direction[None])[2][1:]
    line = np.round(vertices @ across.T / (SAME_POINT_SHARE * model.extent)).astype(np.int64)
    height = vertices @ model.direction
    order = np.lexsort((height, line[:, 1], line[:, 0]))
    line, height = line[order], height[order]
    distances = []
    for ahead in range(1, MATES_PER_VERTEX + 1):
        one_line = (line[ahead:] == line[:-ahead]).all(axis=1)
        distances.append((height[ahead:] - height[:-ahead])[one_line])
    shifts = np.concatenate(distances)
    shifts = shifts[(shifts > MIN_SHIFT_SHARE * model.extent) & (shifts < MAX_DISTANCE_SHARE * model.extent)]
    grain = SAME_POINT_SHARE / 4 * model.extent
    _, bucket, votes = np.unique(np.round(shifts / grain), return_inverse=True, return_counts=True)
    for most_voted in np.argsort(-votes, kind="stable")[:MAX_ROW_SHIFTS]:
        yield float(np.median(shifts[bucket.reshape(-1) == most_voted]))
