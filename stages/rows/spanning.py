"""Parts that span a slab: they are lengthened where they are prisms in it, cut where they repeat themselves, or
stretched as a whole.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stages.rows.layout import VERTEX_REACH, LengthenedMesh
from stages.shape.appearance import barycentric
from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.kit import PartMesh

MAX_SLOPE = 2e-3
"""Largest cosine between a step and the normal of a face that is parallel to it."""
MIN_AREA_SHARE = 1e-9
"""Faces below this share of the square of the part's diagonal have no direction."""
WELDED_SHARE = 1e-7
"""Corners nearer to each other than this share of a part's size are one."""
MAX_SECTION_DIFFERENCE = 0.01
"""Largest relative difference of the lengths of two equal sections."""

MAX_STRETCH = 1.6
"""Largest factor by which one change of a row stretches a part, and one over the smallest."""


@dataclass(frozen=True)
class Span:
    """A part that spans a slab.

    pose: of the part, float64 (4, 4)
    points: its vertices in the world, float64 (v, 3)
    mates, previous: the vertex one step after and one step before each vertex, or -1, int64 (v,)
    heights: their positions along the slab's normal, float64 (v,)
    low, high: where the slab begins and ends along its normal
    shift: step of the slab, float64 (3,)
    tolerance: distance up to which ends coincide
    """

    mesh: PartMesh
    pose: FloatArray
    points: FloatArray
    mates: np.ndarray
    previous: np.ndarray
    heights: FloatArray
    low: float
    high: float
    shift: FloatArray
    tolerance: float

    @cached_property
    def can_change(self) -> bool:
        """Whether the part can become longer and shorter without being stretched."""
        return self.is_regular or self._repeats_itself

    def can_stretch(self, times: int) -> bool:
        """Whether the part keeps its look when it is stretched by `times` periods."""
        factor = 1.0 + times * (self.high - self.low) / max(float(np.ptp(self.heights)), 1e-300)
        return 1.0 / MAX_STRETCH <= factor <= MAX_STRETCH

    def changed(self, times: int) -> tuple[LengthenedMesh, FloatArray]:
        """Return surface and pose of the part with `times` more periods (-1: one less)."""
        if not self.can_change:
            return _stretched(self, times)
        if not self.is_regular:
            return _clipped_and_repeated(self, times)
        return _longer(self, times) if times > 0 else _shorter(self)

    @cached_property
    def sides(self) -> np.ndarray:
        """Whether each vertex is before (0), in (1) or beyond (2) the slab, int64 (v,)."""
        begins = (self.heights >= self.low - self.tolerance).astype(np.int64)
        return begins + (self.heights >= self.high - self.tolerance)

    @cached_property
    def ranges(self) -> tuple[np.ndarray, np.ndarray]:
        """The lowest and the highest side of the vertices of each face, int64 (f,) each."""
        sides = self.sides[self.mesh.faces]
        return sides.min(axis=1), sides.max(axis=1)

    @cached_property
    def recurs(self) -> bool:
        """Whether every vertex in the slab has one a step before, or every one has one a step after."""
        inside = self.sides == 1
        return bool((self.mates[inside] >= 0).all() or (self.previous[inside] >= 0).all())

    @cached_property
    def is_regular(self) -> bool:
        """Whether faces across the slab are parallel to its step, and those across its end recur at its start.

        Then periods are inserted without cutting faces. A prism, with no vertex in the slab, is the simplest case.
        """
        if not self.recurs:
            return False
        low, high = self.ranges
        faces = self.mesh.faces
        spanning = (low == 0) & (high == 2)
        if (self.sides[faces[spanning]] == 1).any():
            return False
        if not are_parallel(self.points[faces[spanning]], self.shift, self.points).all():
            return False
        start, end = (low == 0) & (high == 1), (low == 1) & (high == 2)
        if int(start.sum()) != int(end.sum()):
            return False
        if not start.any():
            return True
        at_start, at_end = faces[start], faces[end]
        behind = self.previous[at_end]
        if (self.mates[at_start] < 0).any() or (behind < 0).any():
            return False
        from scipy.spatial import cKDTree

        middles = self.points[at_start].mean(axis=1) + self.shift
        gaps, _ = cKDTree(middles).query(self.points[at_end].mean(axis=1))
        return bool((gaps <= VERTEX_REACH * self.tolerance).all())

    @cached_property
    def _repeats_itself(self) -> bool:
        """Whether vertices in the slab recur and its sections at both ends are equal."""
        if (
            (np.abs(self.heights - self.low) <= self.tolerance) | (np.abs(self.heights - self.high) <= self.tolerance)
        ).any():
            return False
        if not self.recurs:
            return False
        start = _section(self.points, self.mesh.faces, self.heights, self.low) + self.shift
        end = _section(self.points, self.mesh.faces, self.heights, self.high)
        return _equal_sections(start, end, VERTEX_REACH * self.tolerance)


def _longer(span: Span, times: int) -> tuple[LengthenedMesh, FloatArray]:
    """Return a regular part with `times` more periods: a face across the end of the slab joins each two periods."""
    points, faces, sides = span.points, span.mesh.faces, span.sides
    inside = np.flatnonzero(sides == 1)
    copy_of = np.full(len(points), -1, dtype=np.int64)
    copy_of[inside] = np.arange(len(inside))

    def copied(vertices: np.ndarray, number: int) -> np.ndarray:
        """Return the vertices of a period."""
        return vertices if number == 0 else len(points) + (number - 1) * len(inside) + copy_of[vertices]

    low, high = span.ranges
    own, end = np.flatnonzero((low == 1) & (high == 1)), np.flatnonzero((low == 1) & (high == 2))
    stays = (high == 0) | (low == 2) | (low == 0)
    pieces, owners = [faces[stays], faces[own]], [np.flatnonzero(stays), own]
    beyond = sides[faces[end]] == 2
    behind = np.where(beyond, span.previous[faces[end]], faces[end])
    for number in range(times + 1):
        if number:
            pieces.append(copied(faces[own], number))
            owners.append(own)
        here = copied(np.where(beyond, inside[0] if len(inside) else 0, faces[end]), number)
        after = faces[end] if number == times else copied(behind, number + 1)
        pieces.append(np.where(beyond, after, here))
        owners.append(end)
    moved = points + (times * (sides == 2))[:, None] * span.shift
    copies = [points[inside] + number * span.shift for number in range(1, times + 1)]
    return _posed(span, np.concatenate([moved, *copies]), np.concatenate(pieces), np.concatenate(owners))


def _shorter(span: Span) -> tuple[LengthenedMesh, FloatArray]:
    """Return a regular part with one period less: faces across the start of the slab lead on to what was beyond it."""
    faces, sides = span.mesh.faces, span.sides
    low, high = span.ranges
    start = np.flatnonzero((low == 0) & (high == 1))
    stays = np.flatnonzero((high == 0) | (low == 2) | ((low == 0) & (high == 2)))
    led = np.where(sides[faces[start]] == 1, span.mates[faces[start]], faces[start])
    moved = span.points - (sides == 2)[:, None] * span.shift
    owners = np.concatenate([stays, start])
    return _posed(span, moved, np.concatenate([faces[stays], led]), owners)


def _stretched(span: Span, times: int) -> tuple[LengthenedMesh, FloatArray]:
    """Return a part whose end moves by `times` periods, and what is before its end by its share of that."""
    shares = (span.heights - span.heights.min()) / max(float(np.ptp(span.heights)), 1e-300)
    faces = span.mesh.faces
    return _posed(span, span.points + times * shares[:, None] * span.shift, faces, np.arange(len(faces)))


def are_parallel(corners: FloatArray, shift: FloatArray, points: FloatArray) -> BoolArray:
    """Return which triangles (f, 3, 3) of a part with vertices `points` contain the direction of a shift, bool (f,)."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    tiny = areas <= MIN_AREA_SHARE * float(np.ptp(points, axis=0).max()) ** 2
    direction = shift / np.linalg.norm(shift)
    parallel: BoolArray = tiny | (np.abs(normals @ direction) <= MAX_SLOPE * np.maximum(areas, 1e-300))
    return parallel


def _clipped_and_repeated(span: Span, times: int) -> tuple[LengthenedMesh, FloatArray]:
    """Return a part whose faces are cut at both ends of the slab, with the piece between `times` more times."""
    mesh, points, heights, shift = span.mesh, span.points, span.heights, span.shift
    corners, tops = points[mesh.faces], heights[mesh.faces]
    before, owners_before, _ = _clipped(corners, tops, span.low, -1.0)
    after, owners_after, _ = _clipped(corners, tops, span.high, 1.0)
    above, owners_above, tops_above = _clipped(corners, tops, span.low, 1.0)
    middle, of_above, _ = _clipped(above, tops_above, span.high, -1.0)
    owners_middle = owners_above[of_above]
    pieces = [before, *(middle + number * shift for number in range(times + 1)), after + times * shift]
    owners = np.concatenate([owners_before, *(owners_middle for _ in range(times + 1)), owners_after])
    weights = None
    if mesh.appearance is not None:
        cut = np.concatenate([before, *(middle for _ in range(times + 1)), after])
        weights = barycentric(corners[owners], cut)
    joined = np.concatenate(pieces).reshape(-1, 3)
    scale = max(float(np.ptp(joined, axis=0).max()), 1e-12) * WELDED_SHARE
    places = np.rint(joined / scale).astype(np.int64)
    _, first, index = np.unique(places, axis=0, return_index=True, return_inverse=True)
    faces = index.reshape(-1, 3).astype(np.int32)
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 0] != faces[:, 2])
    return _posed(span, joined[first], faces[whole], owners[whole], None if weights is None else weights[whole])


def _posed(
    span: Span, points: FloatArray, faces: np.ndarray, owners: np.ndarray, weights: FloatArray | None = None
) -> tuple[LengthenedMesh, FloatArray]:
    return posed(span.mesh, span.pose, points, faces, owners, weights)


def posed(
    mesh: PartMesh,
    pose: FloatArray,
    points: FloatArray,
    faces: np.ndarray,
    owners: np.ndarray,
    weights: FloatArray | None = None,
) -> tuple[LengthenedMesh, FloatArray]:
    """Return a changed surface of a part, of the used vertices alone, with the origin in the middle of its box, and its
    pose.

    mesh, pose: of the part before
    points: vertices in the world, float64 (v, 3)
    owners: the face of the part that each face is, or is a piece of, int64 (f,)
    weights: barycentric coordinates of the corners of such pieces, float64 (f, 3, 3)
    """
    used, index = np.unique(faces, return_inverse=True)
    points, faces = points[used], index.reshape(-1, 3).astype(np.int32)
    centre = np.round((points.min(axis=0) + points.max(axis=0)) / 2, 12)
    placed = np.eye(4)
    placed[:3, 3] = centre
    look = mesh.appearance
    if look is not None:
        look = look.select(owners) if weights is None else look.interpolated(owners, weights)
        look = look.turned(pose[:3, :3])
    of = mesh.of if isinstance(mesh, LengthenedMesh) else mesh
    colors = mesh.face_colors[owners]
    return LengthenedMesh(mesh.name, points - centre, faces, colors, of, appearance=look), placed


def _clipped(
    corners: FloatArray, heights: FloatArray, bound: float, sign: float
) -> tuple[FloatArray, np.ndarray, FloatArray]:
    """Return the pieces of triangles (f, 3, 3) above a height (below it if `sign` is -1), the triangle of each, and the
    heights of their corners, float64 (k, 3).
    """
    signed = sign * (heights - bound)
    inside = signed >= 0
    count = inside.sum(axis=1)
    pieces, piece_heights, owners = [corners[count == 3]], [heights[count == 3]], [np.flatnonzero(count == 3)]
    for corner in range(3):
        here, after, before = corner, (corner + 1) % 3, (corner + 2) % 3
        for alone_inside, wanted in ((True, 1), (False, 2)):
            faces = np.flatnonzero((count == wanted) & (inside[:, here] == alone_inside))
            tip, next_one, last = corners[faces, here], corners[faces, after], corners[faces, before]
            one, two = _crossing(signed, faces, here, after), _crossing(signed, faces, here, before)
            cut_next, cut_last = tip + one * (next_one - tip), tip + two * (last - tip)
            at = np.full(len(faces), bound)
            of_tip, of_next, of_last = heights[faces, here], heights[faces, after], heights[faces, before]
            if alone_inside:
                triangles = [((tip, cut_next, cut_last), (of_tip, at, at))]
            else:
                triangles = [
                    ((cut_next, next_one, last), (at, of_next, of_last)),
                    ((cut_next, last, cut_last), (at, of_last, at)),
                ]
            for points, tops in triangles:
                pieces.append(np.stack(points, axis=1).reshape(-1, 3, 3))
                piece_heights.append(np.stack(tops, axis=1).reshape(-1, 3))
                owners.append(faces)
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(pieces)[order], owner[order], np.concatenate(piece_heights)[order]


def _crossing(signed: FloatArray, faces: np.ndarray, one: int, other: int) -> FloatArray:
    """Return where the plane cuts an edge of each of the faces, as a share of the edge, float64 (k, 1)."""
    share: FloatArray = signed[faces, one] / (signed[faces, one] - signed[faces, other])
    return share[:, None]


def _section(points: FloatArray, faces: np.ndarray, heights: FloatArray, bound: float) -> FloatArray:
    """Return the segments in which a plane at a height cuts faces, float64 (k, 2, 3)."""
    above = heights[faces] > bound
    cut = np.flatnonzero(above.any(axis=1) & ~above.all(axis=1))
    ends = []
    for corner in range(3):
        one, other = faces[cut, corner], faces[cut, (corner + 1) % 3]
        crosses = above[cut, corner] != above[cut, (corner + 1) % 3]
        rise = np.where(crosses, heights[other] - heights[one], 1.0)
        share = np.where(crosses, (bound - heights[one]) / rise, np.nan)
        ends.append(points[one] + share[:, None] * (points[other] - points[one]))
    stacked = np.stack(ends, axis=1)
    segments: FloatArray = stacked[~np.isnan(stacked[:, :, 0])].reshape(-1, 2, 3)
    return segments


def _equal_sections(first: FloatArray, second: FloatArray, tolerance: float) -> bool:
    """Return whether two sets of segments (k, 2, 3) cover the same curve."""
    lengths = [float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()) for ends in (first, second)]
    if not len(first) or not len(second):
        return len(first) == len(second)
    if abs(lengths[0] - lengths[1]) > MAX_SECTION_DIFFERENCE * max(lengths) + tolerance:
        return False
    return _lie_on(first, second, tolerance) and _lie_on(second, first, tolerance)


def _lie_on(segments: FloatArray, others: FloatArray, tolerance: float) -> bool:
    """Return whether ends and middles of segments are on other segments."""
    samples = np.concatenate([segments[:, 0], segments[:, 1], segments.mean(axis=1)])
    starts, ways = others[:, 0], others[:, 1] - others[:, 0]
    squares = np.maximum((ways**2).sum(axis=1), 1e-30)
    for chunk in np.array_split(samples, 1 + len(samples) * len(others) // 1_000_000):
        gaps = chunk[:, None] - starts
        shares = np.clip((gaps * ways).sum(axis=2) / squares, 0.0, 1.0)
        if (np.linalg.norm(gaps - shares[:, :, None] * ways, axis=2).min(axis=1) > tolerance).any():
            return False
    return True
