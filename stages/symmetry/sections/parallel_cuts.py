"""Where parallel planes cut a surface in sections that are alike: docking sites that take all that passes there, slabs
and rails too (symmetry §3.2, §3.4.1)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.triangles import unit_normals
from stages.symmetry.sections.cross_sections import CrossSection, cross_section, shared_share
from stages.symmetry.surface.boundary_lines import SAME_ANGLE
from stages.symmetry.surface.corner_frames import creases
from stages.symmetry.surface.grid import has_area
from stages.symmetry.surface.welding import weld

# Lengths are shares of the longest side of the model's box.
NEAR = 1.5e-3
"""Points of sections closer than this are one."""
STEP = 2.5e-3
"""Spacing of points along a section, less than twice as far: sections may be drawn in other pieces."""
SAME = 0.92
"""Sections that have more than this share in common are alike: a cable that hangs as it likes is no difference."""
FINE = 1e-5
"""Vertices closer than this lie on one plane."""
STRETCH = 4e-3
"""A stretch in which a section stays the same is looked at if it is longer."""
WAYS = 3
"""So many directions of edges are tried beside the axes, those of the longest edges in all."""
ONE_WAY = 5e-3
"""Directions closer than this, in radians, are one."""
SQUARE = 0.05
"""Planes of two families stand square if the cosine of their angle is below this."""
SHIFTS = 5
"""Of so many shifts along a direction the rows are looked for, those of most vertices."""
MATES = 8
"""Each vertex votes for the shifts to so many vertices after it."""
LEAST_SHIFT = 0.012
HOPES = 16
"""So many rows are looked at closely, those that promise most planes."""
PHASES = 4
"""At so many places within a shift the planes of a row are tried."""
FAR = 0.4
"""Planes of one kind are of use to each other if no more than this share of the model lies between them."""
JOINT = 0.5
"""Share of the shortest stretch of a kind that is cut out as a joint."""
MOST_JOINTS = 16
LONG = 0.08
"""A stretch whose section is like no other's is worth cuts if it is longer."""
SLABS = 4
"""Into so many equal slabs a long stretch is cut."""
FEWEST = 3
"""A family has at least so many borders."""


@dataclass(frozen=True)
class ParallelCuts:
    """A family of parallel planes at which a model is cut.

    way: float64 (3,), their unit normal; offsets: float64 (n,), ascending: a plane is where `way` times x is one.
    planes: how many of them are docking sites; a joint, cut out between two borders, is one.
    """

    way: FloatArray
    offsets: FloatArray
    planes: int


def find_parallel_cuts(corners: FloatArray) -> list[ParallelCuts]:
    """Families of planes at which triangles (f, 3, 3) can be cut into slabs that may be there once more or gone, of any
    two families square to each other, that of most planes first; empty where nothing is alike.

    The directions are those of long edges. Along each a section stays the same over a stretch of walls, or comes back
    after a shift. Two planes with like sections are docking sites of each other. From stretches thin joints are cut,
    which are then equal, whatever stands between them: parts that stand between joints can change places.
    """
    corners = corners[has_area(corners)]
    normals = unit_normals(corners)
    extent = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    places, vertices = weld(corners, FINE * extent)
    edges, _, _ = creases(places, normals)
    families = []
    for way in _ways(vertices[edges[:, 1]] - vertices[edges[:, 0]]):
        model = _Model(corners, normals, way, extent)
        plain = _plain(model)
        found = max(_joints(model, plain), _rows(model, plain, vertices), key=lambda each: each.planes)
        if len(found.offsets) >= FEWEST:
            families.append(found)
    families.sort(key=lambda each: -each.planes)
    chosen: list[ParallelCuts] = []
    for family in families:
        if all(abs(float(family.way @ other.way)) < SQUARE for other in chosen):
            chosen.append(family)
    return chosen


@dataclass(frozen=True)
class _Model:
    """Triangles (f, 3, 3) with their unit normals (f, 3), a direction (3,) to cut across, and the longest side."""

    corners: FloatArray
    normals: FloatArray
    way: FloatArray
    extent: float

    @cached_property
    def heights(self) -> FloatArray:
        """Of each corner along the direction, float64 (f, 3)."""
        found: FloatArray = self.corners @ self.way
        return found

    @cached_property
    def spans(self) -> tuple[FloatArray, FloatArray]:
        """The lowest and the highest corner of each triangle along the direction, float64 (f,) each."""
        return self.heights.min(axis=1), self.heights.max(axis=1)

    def section(self, offset: float) -> CrossSection:
        low, high = self.spans
        crossed = np.flatnonzero((low <= offset) & (high > offset))
        heights = self.heights[crossed] - offset
        return cross_section(self.corners[crossed], self.normals[crossed], heights, STEP * self.extent)

    def alike(self, one: CrossSection, other: CrossSection, shift: float) -> float:
        """The share of the one section, moved by so much along the direction, and the other that they have in common,
        from 0, where they are not alike, to 1."""
        return max(0.0, shared_share(one, other, shift * self.way, NEAR * self.extent, SAME) - SAME) / (1 - SAME)

    def kinds(self, offsets: FloatArray) -> np.ndarray:
        """For each of ascending offsets the first before it with a section like its own, int64 (n,); itself where there
        is none."""
        sections = [self.section(offset) for offset in offsets]
        about = self.signatures(sections)
        kinds = np.arange(len(offsets))
        for place, offset in enumerate(offsets):
            firsts = np.flatnonzero((kinds[:place] == np.arange(place)) & _close(about[:place], about[place]))
            for first in firsts.tolist():
                if self.alike(sections[first], sections[place], float(offset - offsets[first])) > 0:
                    kinds[place] = first
                    break
        return kinds

    def signatures(self, sections: Sequence[CrossSection]) -> FloatArray:
        """Numbers in which sections that are alike hardly differ, float64 (n, 10): of length, middle and spread."""
        found = np.zeros((len(sections), 10))
        for place, each in enumerate(sections):
            if each.length == 0:
                continue
            weights = each.lengths / each.length
            across = (each.points - self.corners[0, 0]) / self.extent
            across = across - np.outer(across @ self.way, self.way)
            middle = weights @ across
            spread = (across - middle).T @ ((across - middle) * weights[:, None])
            found[place] = np.r_[np.log(each.length / self.extent), middle, spread[np.triu_indices(3)]]
        return found


def _close(numbers: FloatArray, others: FloatArray) -> BoolArray:
    """Which signatures (n, 10) may be of sections alike to that of others (n, 10), or of one (10,): bool (n,)."""
    found: BoolArray = np.asarray((np.abs(numbers - others) < 1 - SAME).all(axis=1))
    return found


def _ways(edges: FloatArray) -> list[FloatArray]:
    """The axes, and the directions (3,) of the longest in all of edges (e, 3)."""
    lengths = np.linalg.norm(edges, axis=1)
    edges, lengths = edges[lengths > 0], lengths[lengths > 0]
    units = edges / lengths[:, None]
    first = np.abs(units).argmax(axis=1)
    units *= np.sign(units[np.arange(len(units)), first])[:, None]
    found: list[FloatArray] = list(np.eye(3))
    left = (np.abs(units) < np.cos(2 * ONE_WAY)).all(axis=1)
    while left.any() and len(found) < WAYS + 3:
        _, bucket = np.unique(np.round(units[left] / ONE_WAY), axis=0, return_inverse=True)
        total = np.bincount(bucket.reshape(-1), weights=lengths[left])
        members = units[left][bucket.reshape(-1) == total.argmax()]
        weights = lengths[left][bucket.reshape(-1) == total.argmax()]
        way = (members * weights[:, None]).sum(axis=0)
        way /= np.linalg.norm(way)
        found.append(way)
        left &= np.abs(units @ way) < np.cos(2 * ONE_WAY)
    return found


def _plain(model: _Model) -> FloatArray:
    """Stretches along which the section stays the same, float64 (n, 2), ascending."""
    heights, (low, high) = model.heights, model.spans
    _, first = np.unique(np.round(heights / (FINE * model.extent)), return_index=True)
    levels = heights.reshape(-1)[first]
    slanted = np.abs(model.normals @ model.way) > SAME_ANGLE
    slanted &= high - low > FINE * model.extent
    opened = np.searchsorted(np.sort(low[slanted]), levels[:-1] + FINE / 2 * model.extent)
    closed = np.searchsorted(np.sort(high[slanted]), levels[:-1] + 2 * FINE * model.extent)
    plain = (opened == closed) & (np.diff(levels) > STRETCH * model.extent)
    found: FloatArray = np.column_stack([levels[:-1], levels[1:]])[plain]
    return found


def _joints(model: _Model, plain: FloatArray) -> ParallelCuts:
    """Joints in plain stretches (n, 2) of kinds that occur more than once, and cuts through those that are long."""
    kinds = model.kinds(plain.mean(axis=1))
    joined: list[tuple[float, float, int]] = []
    for (begin, end), kind in zip(plain.tolist(), kinds.tolist(), strict=True):
        if joined and joined[-1][2] == kind and begin - joined[-1][1] < FINE * model.extent:
            joined[-1] = (joined[-1][0], end, kind)
        else:
            joined.append((begin, end, kind))
    borders: list[float] = []
    total = 0
    for members in _of_one_kind(joined):
        if len(members) == 1:
            begin, end, _ = members[0]
            if end - begin > LONG * model.extent:
                borders += np.linspace(begin, end, SLABS + 3)[1:-1].tolist()
                total += SLABS + 1
            continue
        near = _near(members, float(np.ptp(model.heights)))
        if not near or (total and total + len(near) > MOST_JOINTS):
            continue
        width = JOINT * min(end - begin for begin, end, _ in near)
        for begin, end, _ in near:
            borders += [(begin + end - width) / 2, (begin + end + width) / 2]
        total += len(near)
    return ParallelCuts(model.way, np.sort(np.array(borders)), total)


def _of_one_kind(stretches: list[tuple[float, float, int]]) -> list[list[tuple[float, float, int]]]:
    """The stretches of each kind, the commonest first."""
    kinds: dict[int, list[tuple[float, float, int]]] = {}
    for each in stretches:
        kinds.setdefault(each[2], []).append(each)
    return sorted(kinds.values(), key=lambda each: -len(each))


def _near(members: list[tuple[float, float, int]], extent: float) -> list[tuple[float, float, int]]:
    """Those of some stretches that are not far from all others."""
    return [
        each
        for each in members
        if any(other is not each and abs(other[0] - each[0]) < FAR * extent for other in members)
    ]


def _rows(model: _Model, plain: FloatArray, vertices: FloatArray) -> ParallelCuts:
    """The planes at which the section comes back after one shift along the direction, for the shift after which it does
    so most and best; none of them in a plain stretch (n, 2) that is longer than the shift: there any would do.

    Shifts are ranked by the signatures of their sections, and looked at until none that is left can be better.
    """
    begin, end = float(model.heights.min()), float(model.heights.max())
    hopes = []
    for shift in _shifts(model, vertices):
        for phase in range(PHASES):
            offsets = np.arange(begin + shift * (phase + 0.5) / PHASES, end, shift)
            long = plain[plain[:, 1] - plain[:, 0] > shift]
            inside = (offsets[:, None] > long[:, 0]) & (offsets[:, None] < long[:, 1])
            offsets = offsets[~inside.any(axis=1)]
            about = model.signatures([model.section(offset) for offset in offsets])
            hopes.append((int(_in_rows(_close(about[1:], about[:-1])).sum()), offsets))
    best, worth = ParallelCuts(model.way, np.empty(0), 0), 0.0
    for hope, offsets in sorted(hopes, key=lambda each: -each[0])[:HOPES]:
        if hope <= worth:
            break
        sections = [model.section(offset) for offset in offsets]
        same = _like_the_first(model, sections, offsets)
        if sum(same) > worth:
            chosen = offsets[_in_rows(np.array(same) > 0)]
            best, worth = ParallelCuts(model.way, chosen, len(chosen)), sum(same)
    return best


def _like_the_first(model: _Model, sections: Sequence[CrossSection], offsets: FloatArray) -> list[float]:
    """How alike each section but the first is to the first of its row, 0 where a new row begins.

    Not to the one before it: a shift that is nearly the right one hardly shows from plane to plane, and adds up.
    """
    first, found = 0, []
    for place in range(1, len(sections)):
        found.append(model.alike(sections[first], sections[place], float(offsets[place] - offsets[first])))
        if found[-1] == 0:
            first = place
    return found


def _in_rows(same: np.ndarray) -> BoolArray:
    """Which of some planes are like the plane before or after, by whether each is like the next, bool (n - 1,)."""
    found: BoolArray = np.r_[False, same] | np.r_[same, False]
    return found


def _shifts(model: _Model, vertices: FloatArray) -> Iterator[float]:
    """The commonest distances of vertices (v, 3) that lie behind each other along the direction."""
    across = np.linalg.svd(model.way[None])[2][1:]
    behind = np.round(vertices @ across.T / (NEAR * model.extent)).astype(np.int64)
    height = vertices @ model.way
    order = np.lexsort((height, behind[:, 1], behind[:, 0]))
    behind, height = behind[order], height[order]
    found = []
    for apart in range(1, MATES + 1):
        one_line = (behind[apart:] == behind[:-apart]).all(axis=1)
        found.append((height[apart:] - height[:-apart])[one_line])
    shifts = np.concatenate(found)
    shifts = shifts[(shifts > LEAST_SHIFT * model.extent) & (shifts < FAR * model.extent)]
    grain = NEAR / 4 * model.extent
    _, which, votes = np.unique(np.round(shifts / grain), return_inverse=True, return_counts=True)
    for each in np.argsort(-votes, kind="stable")[:SHIFTS]:
        yield float(np.median(shifts[which.reshape(-1) == each]))
