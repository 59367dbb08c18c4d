"""Divisions: a front, such as a door or a drawer, becomes several next to each other in its place.

A front nearly fills the face of its box, and another part holds it along its length. It holds nothing but what hangs on
it alone, such as a handle. Its pieces are stretched copies. What hangs on it is copied with them; what is small keeps
its size.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stages.rows.layout import Layout, sorted_edges, with_classes, with_translates
from stages.rows.slabs import SlabError
from stages.rows.spanning import posed
from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import relative_poses

MIN_COVER = 0.93
"""Smallest share of the face of its box that a front covers with what hangs on it, such as the pane of a glass door."""
COVER_PIXELS = 64
"""Pixels along each side of that face."""
MIN_FLAT_SHARE = 0.5
"""Share of a front's surface that is parallel to that face: the lid of a laptop leans, and a car's bumper is round."""
MIN_FLAT_COSINE = 0.996
"""Cosine of the angle of two faces from which they are parallel."""
MIN_FRONT_SHARE, MAX_FRONT_SHARE = 0.01, 0.4
"""Smallest share of a shape's surface that a front has with what hangs on it, and largest that it has alone."""
MIN_HUNG_SHARE, MAX_HUNG_SHARE = 0.004, 3.0
"""Smallest and largest area of what hangs on a front, as a multiple of the front's own; less are screws in a panel."""
MIN_LARGE_SHARE = 0.3
"""Share of both long sides of a front from which what hangs on it is large: it would be squeezed with the front."""
MAX_CORNER_DISTANCE = 0.15
"""Largest distance of a large part from a corner of its box, both in a unit square: the window of a washing machine is
round, and stays so.
"""
MIN_HELD_SHARE = 0.5
"""Share of a front's length from which a part next to it holds it along its length."""
GAP_SHARE = 0.04
"""Gap between two pieces, as a share of the length of one with its gap."""
MIN_SLENDERNESS = 0.2
"""Smallest length of a piece, as a share of its other long side."""
MIN_THICKNESSES = 1.5
"""Smallest length of a piece, in thicknesses of the front."""
END_SHARE = 0.4
"""Share of a piece from each end up to which nothing is stretched: frames and rounded edges keep their width."""
MAX_SIZE_DIFFERENCE = 0.03
"""Largest relative difference of the sides of fronts that are divided together."""
MAX_PIECES = 4


@dataclass(frozen=True)
class Division:
    """Fronts that are divided.

    fronts: parts of the exemplar, ascending
    axis: index of the axis along which pieces follow each other
    count: pieces of each front
    """

    fronts: tuple[int, ...]
    axis: int
    count: int


@dataclass(frozen=True, eq=False)
class Front:
    """A part that can be divided.

    part: its index
    hung: parts that hang on it alone, int64 (k,) ascending
    thin: index of the axis along which it is thinnest
    pieces: largest number of pieces along each axis; less than two along those where it is not divided
    """

    part: int
    hung: np.ndarray
    thin: int
    pieces: tuple[int, int, int]


def find_divisions(layout: Layout, up: int) -> list[list[Division]]:
    """Return for each set of fronts of one size the divisions of all of them, and of each alone.

    All parts of a type are fronts or behind one, or no part of it is: walls of a building set are structure, also one
    with a banner.

    up: index of the axis that points up; what lies flat is no front, but a shelf with something on it
    """
    fronts = [front for part in range(len(layout)) if (front := _front(layout, part)) is not None and front.thin != up]
    structure = {int(layout.types[part]) for part in range(len(layout)) if not _is_behind_any(layout, part, fronts)}
    fronts = [front for front in fronts if int(layout.types[front.part]) not in structure]
    found: list[list[Division]] = []
    for peers in _peers(layout, fronts):
        groups = [peers, *([front] for front in peers if len(peers) > 1)]
        divisions = [
            Division(tuple(front.part for front in group), axis, count)
            for group in groups
            for axis in range(3)
            for count in range(2, min(front.pieces[axis] for front in group) + 1)
        ]
        valid = [division for division in divisions if _is_valid(layout, division)]
        if valid:
            found.append(valid)
    return found


def _is_behind_any(layout: Layout, part: int, fronts: Sequence[Front]) -> bool:
    """Return whether a part is a front, or has the outline of one, such as the back of a drawer in two sheets."""
    reach = 2.0 * layout.mate_tolerance
    gaps = (np.abs(layout.boxes[part] - layout.boxes[front.part]).max(axis=0) for front in fronts)
    return any(
        front.part == part or (np.delete(gap, front.thin) <= reach).all()
        for front, gap in zip(fronts, gaps, strict=True)
    )


def divided(layout: Layout, division: Division) -> Layout:
    """Return a layout with divided fronts. Raises SlabError where that is not valid."""
    if division.fronts and max(division.fronts) >= len(layout):
        raise SlabError("there is no such front")
    for part in division.fronts:
        front = _front(layout, part)
        if front is None or not 2 <= division.count <= front.pieces[division.axis]:
            raise SlabError("a part cannot be divided like that")
        layout = _divided(layout, front, division.axis, division.count)
    return layout


def _is_valid(layout: Layout, division: Division) -> bool:
    try:
        divided(layout, division)
    except SlabError:
        return False
    return True


def _front(layout: Layout, part: int) -> Front | None:
    """Return a part as a front, or None if it cannot be divided."""
    sides = layout.boxes[part, 1] - layout.boxes[part, 0]
    thin = int(sides.argmin())
    long = [axis for axis in range(3) if axis != thin]
    areas = layout.areas
    if areas[part] > MAX_FRONT_SHARE * areas.sum() or not sides[long].min() > 0:
        return None
    main, hung = _held_by(layout, part)
    hung_area = float(areas[hung].sum())
    if not len(main) or not MIN_HUNG_SHARE * areas[part] <= hung_area <= MAX_HUNG_SHARE * areas[part]:
        return None
    if areas[part] + hung_area < MIN_FRONT_SHARE * areas.sum():
        return None
    low, high = layout.boxes[part, 0] - layout.tolerance, layout.boxes[part, 1] + layout.tolerance
    if (layout.boxes[hung, 0] < low)[:, long].any() or (layout.boxes[hung, 1] > high)[:, long].any():
        return None
    if any(_is_round(layout, other, long) for other in _large(layout, part, hung, long)):
        return None
    if _flat_share(layout, part, thin) < MIN_FLAT_SHARE or _cover(layout, part, hung, thin) < MIN_COVER:
        return None
    if not _stands_out(layout, part, hung, thin) and _cover(layout, part, hung[:0], thin) >= MIN_COVER:
        return None  # what hangs on it is behind it, and it is no frame around a pane
    pieces = [0, 0, 0]
    for axis, other in (long, long[::-1]):
        shortest = max(MIN_SLENDERNESS * sides[other], MIN_THICKNESSES * sides[thin])
        if len(_holders(layout, part, main, axis)):
            pieces[axis] = int(min(MAX_PIECES, sides[axis] / shortest))
    return Front(part, hung, thin, (pieces[0], pieces[1], pieces[2])) if max(pieces) >= 2 else None


def _large(layout: Layout, part: int, hung: np.ndarray, long: Sequence[int]) -> list[int]:
    """Return what hangs on a front and takes much of both its long sides.

    long: indices of the axes along these
    """
    sides = (layout.boxes[:, 1] - layout.boxes[:, 0])[:, long]
    large: list[int] = hung[(sides[hung] >= MIN_LARGE_SHARE * sides[part]).all(axis=1)].tolist()
    return large


def _is_round(layout: Layout, part: int, long: Sequence[int]) -> bool:
    """Return whether a part reaches into no corner of its box, seen across two axes; half a pane reaches into three."""
    points = layout.points[part][:, long]
    unit = (points - points.min(axis=0)) / np.maximum(np.ptp(points, axis=0), layout.tolerance)
    corners = np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]])
    nearest = np.linalg.norm(unit[:, None] - corners[None], axis=2).min(axis=0)
    return bool((nearest > MAX_CORNER_DISTANCE).all())


def _stands_out(layout: Layout, part: int, hung: np.ndarray, axis: int) -> bool:
    """Return whether some of what hangs on a front is before it or in it, on the side away from the shape's middle."""
    middle = (layout.boxes[:, 0, axis].min() + layout.boxes[:, 1, axis].max()) / 2
    sign = 1.0 if layout.boxes[part, :, axis].mean() >= middle else -1.0
    outer, inner = (sign * layout.boxes[:, :, axis]).max(axis=1), float((sign * layout.boxes[part, :, axis]).min())
    return bool((outer[hung] > (outer[part] + inner) / 2).any())


def _flat_share(layout: Layout, part: int, axis: int) -> float:
    """Return the share of a part's surface that lies across an axis."""
    corners = layout.points[part][layout.meshes[part].faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    return float(areas[np.abs(normals[:, axis]) >= MIN_FLAT_COSINE * areas].sum() / max(areas.sum(), 1e-300))


def _cover(layout: Layout, part: int, hung: np.ndarray, axis: int) -> float:
    """Return the share of a face of a part's box that the part and what hangs on it cover, seen along an axis."""
    from stages.shape.views.raster import raster

    across = [other for other in range(3) if other != axis]
    low, high = layout.boxes[part][:, across]
    members = [part, *hung.tolist()]
    corners = np.concatenate([layout.points[member][layout.meshes[member].faces] for member in members])
    screen = np.zeros_like(corners)
    screen[:, :, :2] = (corners[:, :, across] - low) / (high - low) * COVER_PIXELS
    return float((raster(screen, COVER_PIXELS, COVER_PIXELS) >= 0).mean())


def _held_by(layout: Layout, part: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the parts that a part touches in the largest piece of the rest, and the parts that hang on it alone."""
    without = replace(layout, edges=layout.edges[(layout.edges != part).all(axis=1)])
    pieces, near = without.pieces(), layout.neighbours[part]
    numbers = np.unique(pieces[near])
    if not len(numbers):
        return near, near
    areas = np.bincount(pieces, weights=layout.areas)
    largest = numbers[areas[numbers].argmax()]
    hung = np.flatnonzero(np.isin(pieces, numbers[numbers != largest]))
    return near[pieces[near] == largest], hung


def _holders(layout: Layout, part: int, main: np.ndarray, axis: int) -> np.ndarray:
    """Return which of the parts next to a front reach along most of its length, int64 (k,)."""
    low, high = layout.boxes[part, :, axis]
    reach = np.minimum(layout.boxes[main, 1, axis], high) - np.maximum(layout.boxes[main, 0, axis], low)
    holders: np.ndarray = main[reach >= MIN_HELD_SHARE * (high - low)]
    return holders


def _peers(layout: Layout, fronts: Sequence[Front]) -> Iterator[list[Front]]:
    """Yield sets of fronts of one size that are thin along one axis, each with as many parts hung on it."""
    left = list(fronts)
    while left:
        first = left[0]
        sides = layout.boxes[first.part, 1] - layout.boxes[first.part, 0]
        others = layout.boxes[:, 1] - layout.boxes[:, 0]
        is_equal = (np.abs(others - sides) <= MAX_SIZE_DIFFERENCE * sides.max()).all(axis=1)
        peers = [front for front in left if is_equal[front.part] and front.thin == first.thin]
        peers = [front for front in peers if len(front.hung) == len(first.hung)]
        yield peers
        left = [front for front in left if front not in peers]


def _divided(layout: Layout, front: Front, axis: int, count: int) -> Layout:
    """Return a layout with one divided front: its first piece in its place, the others at the end."""
    low, high = layout.boxes[front.part, :, axis]
    pitch = (high - low) / (count - GAP_SHARE)
    length = pitch * (1.0 - GAP_SHARE)
    parts = [front.part, *front.hung.tolist()]
    meshes, poses = list(layout.meshes), layout.poses.copy()
    changed: set[int] = set()
    for part in parts:
        along = layout.points[part][:, axis]
        size = float(np.ptp(along))
        shift = np.zeros(3)
        if part != front.part and size <= END_SHARE * length:
            middle = np.array([(along.min() + along.max()) / 2])
            shift[axis] = float((_mapped(middle, low, high, length) - middle)[0])
            poses[part, :3, 3] += np.round(shift, 12)
            continue
        points = layout.points[part].copy()
        points[:, axis] = _mapped(along, low, high, length)
        mesh = layout.meshes[part]
        meshes[part], poses[part] = posed(mesh, layout.poses[part], points, mesh.faces, np.arange(len(mesh.faces)))
        changed.add(part)
    keys = [(kind, 0) for kind in layout.classes.tolist()]
    for part in changed:
        keys[part] = keys[part][0], count * 3 + axis
    first = with_classes(replace(layout, meshes=tuple(meshes), poses=poses), keys)
    made = with_translates(first, np.array(parts), poses[parts], pitch * np.eye(3)[axis], count - 1)
    return replace(made, edges=_edges(layout, made, front, axis, count))


def _mapped(along: FloatArray, low: float, high: float, length: float) -> FloatArray:
    """Return positions on the first piece: its ends keep their lengths, and what is between them is compressed."""
    end = END_SHARE * length
    mapped: FloatArray = np.interp(along, [low, low + end, high - end, high], [0.0, end, length - end, length]) + low
    return mapped


def _edges(layout: Layout, made: Layout, front: Front, axis: int, count: int) -> np.ndarray:
    """Return the contacts with the pieces of a front. Raises SlabError where a piece is not held, or lets go."""
    from stages.shape.geometry.contact import ContactTest

    parts = [front.part, *front.hung.tolist()]
    place = {part: number for number, part in enumerate(parts)}

    def copy(part: int, number: int) -> int:
        return part if number == 0 else len(layout) + (number - 1) * len(parts) + place[part]

    edges = [(i, j) for i, j in layout.edges.tolist() if i not in place and j not in place]
    inner = [(i, j) for i, j in layout.edges.tolist() if i in place and j in place]
    edges += [(copy(i, number), copy(j, number)) for i, j in inner for number in range(count)]
    main, _ = _held_by(layout, front.part)
    holders = set(_holders(layout, front.part, main, axis).tolist())
    test = ContactTest(made.meshes, made.tolerance)
    pieces = [copy(front.part, number) for number in range(count)]
    pairs = np.array([(piece, other) for piece in pieces for other in main.tolist()], dtype=np.int64)
    poses = relative_poses(made.poses, pairs)
    touching = [(i, j) for (i, j), pose in zip(pairs.tolist(), poses, strict=True) if test.touches(i, j, pose)]
    if {i for i, j in touching if j in holders} != set(pieces):
        raise SlabError("a piece of a front would not be held along its length")
    if {j for _, j in touching} != set(main.tolist()):
        raise SlabError("a part would no longer touch a front")
    return sorted_edges([*edges, *touching])
