"""Rows about an axis: spokes, columns of a round temple, legs of a round table. Their number changes, and so does the
angle between them; where the new number divides the old one, parts stay where they were.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stages.rows.layout import MAX_ROTATION_DIFFERENCE, Layout, sorted_edges, with_classes
from stages.rows.likeness import have_like_sizes, principal_axes
from stages.rows.slabs import SlabError
from stages.rows.steps import ROUNDING_DECIMALS
from stages.shape.arrays import FloatArray
from stages.shape.kit import PartType

MIN_SECTORS = 3
MAX_LIKE_GAP = 0.25
"""Largest distance of the middle of a part from where the like part of another sector leads to, as a share of the
diagonal of its box.
"""
MIN_RADIUS_TOLERANCES = 10.0
"""Smallest radius of a circle, in tolerances of mates."""


@dataclass(frozen=True)
class Turn:
    """Another number of equal sectors about an axis.

    axis: index of the axis that the circle is around
    centre: point on it, float64 (3,)
    sectors: number of sectors before
    count: number of sectors after
    """

    axis: int
    centre: FloatArray
    sectors: int
    count: int


@dataclass(frozen=True)
class Circle:
    """Parts at equal angles about an axis.

    axis, centre: as for `Turn`
    orbits: part of each orbit in each sector, int64 (orbits, sectors); an orbit is a part and what it turns into, or
        like parts that hang on such an orbit, such as the shades of a chandelier
    """

    axis: int
    centre: FloatArray
    orbits: np.ndarray

    @property
    def sectors(self) -> int:
        """Number of sectors."""
        return int(self.orbits.shape[1])

    def turn(self, count: int) -> Turn:
        """Return the change to another number of sectors."""
        return Turn(self.axis, self.centre, self.sectors, count)


def find_circles(layout: Layout) -> list[Circle]:
    """Return the circles of a layout whose sectors do not touch each other and touch the same other parts."""
    found: dict[tuple[int, int, tuple[int, ...]], list[tuple[FloatArray, np.ndarray]]] = {}
    for axis in range(3):
        for centre, orbit in _orbits_about(layout, axis):
            place = np.rint(np.delete(centre, axis) / (4.0 * layout.mate_tolerance)).astype(np.int64)
            found.setdefault((axis, len(orbit), tuple(place.tolist())), []).append((centre, orbit))
    circles = []
    for (axis, _, _), orbits in found.items():
        centre = orbits[0][0]
        aligned = np.stack([_aligned(layout, axis, centre, orbits[0][1], orbit) for _, orbit in orbits])
        circle = Circle(axis, np.round(centre, ROUNDING_DECIMALS), aligned)
        if not _is_free(layout, circle):
            circle = _with_like_parts(layout, circle)
        if _is_free(layout, circle):
            circles.append(circle)
    return circles


def turned(layout: Layout, turn: Turn) -> Layout:
    """Return a layout with another number of sectors. Raises SlabError where it has no such circle."""
    circle = next((circle for circle in find_circles(layout) if _is_same(layout, circle, turn)), None)
    if circle is None or turn.count < 1:
        raise SlabError(f"there are no {turn.sectors} equal sectors about axis {'xyz'[turn.axis]}")
    kept = np.setdiff1d(np.arange(len(layout)), circle.orbits.ravel())
    index_of = {part: number for number, part in enumerate(kept.tolist())}
    sources = circle.orbits[:, 0].tolist()
    orbit_of = {part: number for number, part in enumerate(sources)}
    in_orbits = set(circle.orbits.ravel().tolist())

    def copy(orbit: int, sector: int) -> int:
        return len(kept) + sector * len(sources) + orbit

    edges: list[tuple[int, int]] = []
    for i, j in layout.edges.tolist():
        if i not in in_orbits and j not in in_orbits:
            edges.append((index_of[i], index_of[j]))
        elif i in orbit_of and j in orbit_of:
            edges += [(copy(orbit_of[i], sector), copy(orbit_of[j], sector)) for sector in range(turn.count)]
        elif (i in orbit_of and j not in in_orbits) or (j in orbit_of and i not in in_orbits):
            part, other = (i, j) if i in orbit_of else (j, i)
            edges += [(copy(orbit_of[part], sector), index_of[other]) for sector in range(turn.count)]
    rotations = [
        rotation_about(turn.axis, circle.centre, 2 * np.pi * sector / turn.count) for sector in range(turn.count)
    ]
    poses = [layout.poses[kept], *(rotation @ layout.poses[sources] for rotation in rotations)]
    chosen = np.concatenate([kept, np.tile(np.array(sources, dtype=np.int64), turn.count)])
    changed = replace(
        layout,
        meshes=tuple(layout.meshes[part] for part in chosen.tolist()),
        poses=np.concatenate(poses),
        types=layout.types[chosen],
        origins=layout.origins[chosen],
        edges=sorted_edges(edges),
    )
    own = layout.classes.tolist()
    keys = [(own[part], -1) for part in kept.tolist()]
    keys += [(own[part], sector) for sector in range(turn.count) for part in sources]
    return with_classes(changed, keys)


def _orbits_about(layout: Layout, axis: int) -> Iterator[tuple[FloatArray, np.ndarray]]:
    """Yield centre and parts, by angle, of each set of congruent parts at equal angles about a line along an axis.

    Parts that are at equal angles in groups alone, such as two screws of each blade of a fan, make a set for each place
    in the group.
    """
    across = [other for other in range(3) if other != axis]
    for kind in np.flatnonzero(np.bincount(layout.types) >= MIN_SECTORS).tolist():
        parts = np.flatnonzero(layout.types == kind)
        heights = layout.anchors[parts, axis]
        order = np.argsort(heights, kind="stable")
        levels = np.split(order, 1 + np.flatnonzero(np.diff(heights[order]) > layout.mate_tolerance))
        for level in levels:
            members = np.sort(parts[level])
            if len(members) < MIN_SECTORS:
                continue
            centre = layout.anchors[members].mean(axis=0)
            arms = layout.anchors[members][:, across] - centre[across]
            radii = np.linalg.norm(arms, axis=1)
            tolerance = layout.mate_tolerance
            if radii.min() < MIN_RADIUS_TOLERANCES * tolerance or np.ptp(radii) > tolerance:
                continue
            angles = np.arctan2(arms[:, 1], arms[:, 0])
            by_angle = np.argsort(angles, kind="stable")
            for sectors in (len(members) // size for size in range(1, len(members)) if len(members) % size == 0):
                places = by_angle.reshape(sectors, -1).T
                gaps = np.diff(angles[places], axis=1) - 2 * np.pi / sectors
                if sectors < MIN_SECTORS or (np.abs(gaps) * radii.max() > tolerance).any():
                    continue
                if all(_are_turned_copies(layout, axis, members[orbit]) for orbit in places):
                    yield from ((centre, members[orbit]) for orbit in places)
                    break


def _are_turned_copies(layout: Layout, axis: int, orbit: np.ndarray) -> bool:
    """Return whether each part of an orbit is the first one turned by its angle, up to symmetries of the part."""
    mesh = layout.meshes[int(orbit[0])]
    if not isinstance(mesh, PartType) or any(layout.meshes[part] is not mesh for part in orbit.tolist()):
        return False
    symmetries, first = mesh.symmetries[:, :3, :3], layout.poses[orbit[0], :3, :3]
    for sector, part in enumerate(orbit.tolist()):
        rotation = rotation_about(axis, np.zeros(3), 2 * np.pi * sector / len(orbit))[:3, :3]
        gaps = np.abs(rotation @ first @ symmetries - layout.poses[part, :3, :3]).max(axis=(1, 2))
        if gaps.min() > MAX_ROTATION_DIFFERENCE:
            return False
    return True


def _aligned(layout: Layout, axis: int, centre: FloatArray, first: np.ndarray, orbit: np.ndarray) -> np.ndarray:
    """Return an orbit such that its parts are in the same sectors as those of the first orbit."""
    start = _angle(layout, axis, centre, int(first[0]))
    pitch = 2 * np.pi / len(orbit)
    angles = [_angle(layout, axis, centre, part) for part in orbit.tolist()]
    sectors = [int(np.floor((angle - start) / pitch + 0.5 + 1e-6)) % len(orbit) for angle in angles]
    return orbit[np.argsort(sectors, kind="stable")]


def _angle(layout: Layout, axis: int, centre: FloatArray, part: int) -> float:
    across = [other for other in range(3) if other != axis]
    arm = layout.anchors[part, across] - centre[across]
    return float(np.arctan2(arm[1], arm[0]))


def _with_like_parts(layout: Layout, circle: Circle) -> Circle:
    """Return a circle with orbits of like parts too, each in contact with the same orbits and with one sector alone."""
    sizes = {part: principal_axes(layout.points[part])[0] for part in range(len(layout))}
    while (orbit := _like_orbit(layout, circle, sizes)) is not None:
        circle = replace(circle, orbits=np.vstack([circle.orbits, orbit]))
    return circle


def _like_orbit(layout: Layout, circle: Circle, sizes: Mapping[int, FloatArray]) -> np.ndarray | None:
    """Return like parts that touch a circle, one for each sector, int64 (sectors,), or None if there are no more."""
    place_of = {part: place for place, part in np.ndenumerate(circle.orbits)}
    touching: dict[tuple[int, ...], list[list[int]]] = {}
    for part, touched in enumerate(layout.neighbours):
        places = [place_of[other] for other in touched.tolist() if other in place_of]
        if part not in place_of and len({sector for _, sector in places}) == 1:
            orbits = tuple(sorted(orbit for orbit, _ in places))
            touching.setdefault(orbits, [[] for _ in range(circle.sectors)])[places[0][1]].append(part)
    middles = layout.boxes.mean(axis=1)
    reach = MAX_LIKE_GAP * np.linalg.norm(layout.boxes[:, 1] - layout.boxes[:, 0], axis=1)
    for sectors in touching.values():
        for first in sectors[0]:
            orbit = [first]
            for sector in range(1, circle.sectors):
                rotation = rotation_about(circle.axis, circle.centre, 2 * np.pi * sector / circle.sectors)
                gaps = np.linalg.norm(
                    middles[sectors[sector]] - (rotation[:3, :3] @ middles[first] + rotation[:3, 3]), axis=1
                )
                orbit += [
                    part
                    for part, gap in zip(sectors[sector], gaps.tolist(), strict=True)
                    if gap == gaps.min() and gap <= reach[part] and have_like_sizes(sizes[first], sizes[part])
                ][:1]
            if len(orbit) == circle.sectors:
                return np.array(orbit)
    return None


def _is_free(layout: Layout, circle: Circle) -> bool:
    """Return whether sectors do not touch each other, and each touches the same parts of no sector."""
    sector_of = np.full(len(layout), -1, dtype=np.int64)
    sector_of[circle.orbits] = np.arange(circle.sectors)
    i, j = layout.edges[:, 0], layout.edges[:, 1]
    if ((sector_of[i] >= 0) & (sector_of[j] >= 0) & (sector_of[i] != sector_of[j])).any():
        return False
    neighbours = layout.assembly().neighbours()
    orbit_of = {part: number for number, orbit in enumerate(circle.orbits.tolist()) for part in orbit}
    for orbit in circle.orbits.tolist():
        seen = {tuple(sorted(_seen(neighbours[part], orbit_of))) for part in orbit}
        if len(seen) > 1:
            return False
    return True


def _seen(neighbours: Sequence[int], orbit_of: dict[int, int]) -> list[tuple[bool, int]]:
    """Return the neighbours of a part: parts of no sector, and the orbits of the others."""
    return [(part in orbit_of, orbit_of.get(part, part)) for part in neighbours]


def _is_same(layout: Layout, circle: Circle, turn: Turn) -> bool:
    near = np.abs(np.delete(circle.centre - turn.centre, turn.axis)).max() <= layout.mate_tolerance
    return bool(circle.axis == turn.axis and circle.sectors == turn.sectors and near)


def rotation_about(axis: int, centre: FloatArray, angle: float) -> FloatArray:
    """Return the rotation by an angle, in radians, about a line along an axis, float64 (4, 4)."""
    one, other = [index for index in range(3) if index != axis]
    rotation = np.eye(4)
    cosine, sine = np.cos(angle), np.sin(angle)
    rotation[one, one] = rotation[other, other] = cosine
    rotation[one, other], rotation[other, one] = -sine, sine
    rotation[:3, 3] = centre - rotation[:3, :3] @ centre
    return rotation
