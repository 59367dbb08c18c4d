"""Other proportions of an exemplar: along each axis a monotone map that is linear between the ends of its parts.

One map moves all vertices (substructures §5.2), so parts that touch keep touching, and separate parts stay separate.
Lengths along an axis that were equal stay equal, and so do thin ones along all axes. So legs stay alike, boards equally
thick, gaps even, and symmetric shapes symmetric. What is round stays round, the whole or a part such as a wheel: along
both of its axes all lengths have one factor.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stages.shape.appearance import unit_vectors
from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.contact import world_boxes
from stages.shape.geometry.pose import transform_points
from stages.shape.kit import Assembly, PartMesh
from stages.shape.shape import Shape

MERGED_ENDS_SHARE = 2e-3
"""Ends of parts nearer to each other than this share of the longest side are one."""
EQUAL_LENGTH_TOLERANCE = 0.02
"""Lengths that differ by less, as a share, are equal."""
MIN_SCALED_LENGTH_SHARE = 0.15
"""Lengths above this share of the longest side follow the size along their axis; thinner ones have their own factors.
"""
MAX_FREE_INTERVALS = 12
"""Along an axis with more intervals all follow the size of the whole. With more lengths, own factors vary less."""
FACTOR_DECIMALS = 3
SILHOUETTE_DIRECTIONS = 16
MIN_ROUND_SHARE = 0.91
"""Shortest reach of a round silhouette from its middle, as a share of its longest: that of an octagon is .92, of a
square .71."""
MIN_ROUND_AREA_SHARE = 0.005
"""Share of the surface from which round parts of a type stay round."""
MAX_TIED_SHARE = 0.9
"""Share of the sides of a shape, along all three axes, that one factor may have: more would leave one shape."""
SLOPE_STEP_SHARE = 1e-3
"""How far from a corner to the middle of its face the map is looked at, since a corner may lie on a knot."""

Warp = tuple[FloatArray, FloatArray, FloatArray]
"""For each axis the factors of its intervals, float64 (k,)."""


@dataclass(frozen=True, eq=False)
class WarpedMesh(PartMesh):
    """The surface of a part in other proportions.

    of: mesh in the kit's proportions
    """

    of: PartMesh

    @property
    def label(self) -> str:
        return self.of.label


@dataclass(frozen=True)
class Lattice:
    """The intervals of an exemplar.

    knots: for each axis where parts begin or end, ascending, in the coordinates of the exemplar, float64 (k + 1,)
    lengths: for each axis the number of each interval's length, int64 (k,); equal lengths share a number along all axes
    up: axis that points up
    sources: for each interval, of x, then y, then z, the one whose factor it has: the longest of those that keep a part
        round, or itself; int64 (number of intervals,)
    """

    knots: tuple[FloatArray, FloatArray, FloatArray]
    lengths: tuple[np.ndarray, np.ndarray, np.ndarray]
    up: int
    sources: np.ndarray

    def draw(self, rng: np.random.Generator, log_std: float, max_factor: float) -> Warp:
        """Return random rounded factors, at most `max_factor` and at least its inverse."""
        count = 1 + max((int(numbers.max()) for numbers in self.lengths if len(numbers)), default=-1)
        sizes = rng.normal(0.0, log_std, 3)
        own = rng.normal(0.0, log_std * min(1.0, np.sqrt(MAX_FREE_INTERVALS / max(count, 1))), count)
        follows = _follows(self.knots)
        exponents = [
            own[lengths] + np.where(follow, size, 0.0)
            for lengths, follow, size in zip(self.lengths, follows, sizes, strict=True)
        ]
        factors = np.exp(np.concatenate(exponents)[self.sources])
        factors = np.round(np.clip(factors, 1 / max_factor, max_factor), FACTOR_DECIMALS)
        x, y, z = np.split(factors, np.cumsum([len(lengths) for lengths in self.lengths])[:2])
        return x, y, z

    @property
    def sides(self) -> FloatArray:
        """Sides of the box around the exemplar, float64 (3,)."""
        return np.array([knots[-1] - knots[0] for knots in self.knots])

    def images(self, warp: Sequence[FloatArray]) -> list[FloatArray]:
        """Return the moved knots of each axis.

        The lowest keeps its height, and the middle along the other axes is kept. Raises ValueError for factors that do
        not fit this lattice.
        """
        moved = []
        for axis, (knots, factors) in enumerate(zip(self.knots, warp, strict=True)):
            if len(factors) != len(knots) - 1 or not np.isfinite(factors).all() or (np.asarray(factors) <= 0).any():
                raise ValueError(
                    f"axis {'xyz'[axis]} has {len(knots) - 1} intervals and needs one positive factor for each"
                )
            images = knots[0] + np.concatenate([[0.0], np.cumsum(np.diff(knots) * factors)])
            if axis != self.up:
                images += (knots[0] + knots[-1] - images[0] - images[-1]) / 2
            moved.append(images)
        return moved

    def signature(self, warp: Sequence[FloatArray]) -> FloatArray:
        """Return the scale-free knots of all axes, float64 (sum of k + 1,), centred and divided by the diagonal."""
        images = self.images(warp)
        diagonal = float(np.linalg.norm([image[-1] - image[0] for image in images]))
        return np.concatenate([(image - (image[0] + image[-1]) / 2) / max(diagonal, 1e-12) for image in images])


def lattice_of(shape: Shape, contact_tolerance: float) -> Lattice:
    """Return the intervals of a shape. contact_tolerance: nearer ends are one, in units."""
    boxes = world_boxes(shape.meshes, shape.assembly.types, shape.assembly.poses)
    near = max(contact_tolerance, MERGED_ENDS_SHARE * float(np.ptp(boxes, axis=(0, 1)).max()))
    known: list[float] = []
    knots, lengths = [], []
    for axis in range(3):
        ends = np.sort(boxes[:, :, axis].ravel())
        groups = np.split(ends, 1 + np.flatnonzero(np.diff(ends) > near))
        knot_positions = np.array([group.mean() for group in groups])
        numbers = []
        for gap in np.diff(knot_positions).tolist():
            tolerances = [max(2 * near, EQUAL_LENGTH_TOLERANCE * length) for length in known]
            equal = (number for number, length in enumerate(known) if abs(length - gap) <= tolerances[number])
            number = next(equal, len(known))
            known += [gap] if number == len(known) else []
            numbers.append(number)
        knots.append(knot_positions)
        lengths.append(np.array(numbers, dtype=np.int64))
    up = {"y": 1, "z": 2}[shape.up]
    sources = _sources(shape, boxes, knots, lengths, up)
    return Lattice((knots[0], knots[1], knots[2]), (lengths[0], lengths[1], lengths[2]), up, sources)


def _follows(knots: Sequence[FloatArray]) -> list[BoolArray]:
    """Return for each axis which intervals follow the size along it, bool (k,)."""
    large = MIN_SCALED_LENGTH_SHARE * max(float(np.ptp(axis_knots)) for axis_knots in knots)
    return [(np.diff(axis_knots) > large) | (len(axis_knots) > MAX_FREE_INTERVALS + 1) for axis_knots in knots]


def _sources(
    shape: Shape, boxes: FloatArray, knots: Sequence[FloatArray], lengths: Sequence[np.ndarray], up: int
) -> np.ndarray:
    """Return `Lattice.sources`.

    Intervals that keep something round are tied, and with them all that have their factors. The whole comes first, then
    large parts.
    """
    gaps = [np.diff(axis_knots) for axis_knots in knots]
    axes = np.repeat(np.arange(3), [len(of_axis) for of_axis in gaps])
    middles = np.concatenate([axis_knots[:-1] + of_axis / 2 for axis_knots, of_axis in zip(knots, gaps, strict=True)])
    all_gaps = np.concatenate(gaps)
    keys = np.stack([np.concatenate(lengths), np.where(np.concatenate(_follows(knots)), axes, -1)])
    groups = np.unique(keys, axis=1, return_inverse=True)[1].reshape(-1)
    sides = np.array([of_axis.sum() for of_axis in gaps])
    is_tied = np.zeros(len(groups), dtype=bool)
    for low, high, across in _round_boxes(shape, boxes, up):
        within = (middles > low[axes]) & (middles < high[axes]) & np.isin(axes, across)
        joined = np.isin(groups, groups[within])
        shares = np.bincount(axes[joined], all_gaps[joined], minlength=3) / np.maximum(sides, 1e-12)
        if joined.any() and (shares[sides > 0] < MAX_TIED_SHARE).any():  # no interval is as short as some round parts
            groups[joined] = groups[joined].min()
            is_tied |= joined
    sources = np.arange(len(groups))
    for group in np.unique(groups[is_tied]).tolist():
        members = np.flatnonzero(groups == group)
        sources[members] = members[np.argmax(np.round(all_gaps[members] / all_gaps[members].max(), FACTOR_DECIMALS))]
    return sources


def _round_boxes(shape: Shape, boxes: FloatArray, up: int) -> Iterator[tuple[FloatArray, FloatArray, tuple[int, int]]]:
    """Yield the ends of the box around each thing that is round, float64 (3,), and the two axes across which it is.

    The whole comes first, then parts by the surface of their type.
    """
    assembly = shape.assembly
    types = assembly.types.tolist()
    points = [
        transform_points(pose, shape.meshes[kind].vertices) for kind, pose in zip(types, assembly.poses, strict=True)
    ]
    whole = np.concatenate(points)
    for across in _round_across(whole, up):
        yield whole.min(axis=0), whole.max(axis=0), across
    counts = np.bincount(types, minlength=len(shape.meshes))
    areas = counts * np.array([mesh.area for mesh in shape.meshes])
    for part in np.argsort(-areas[types], kind="stable").tolist():
        if areas[types[part]] >= MIN_ROUND_AREA_SHARE * areas.sum():
            for across in _round_across(points[part], up):
                yield boxes[part, 0], boxes[part, 1], across


def _round_across(points: FloatArray, up: int) -> Iterator[tuple[int, int]]:
    """Yield the pairs of axes across which a silhouette is round, that seen from above first."""
    points = points - (points.min(axis=0) + points.max(axis=0)) / 2
    angles = 2.0 * np.pi * np.arange(SILHOUETTE_DIRECTIONS) / SILHOUETTE_DIRECTIONS
    directions = np.stack([np.cos(angles), np.sin(angles)])
    for axis in sorted(range(3), key=lambda axis: axis != up):
        first, second = (other for other in range(3) if other != axis)
        reach = (points[:, [first, second]] @ directions).max(axis=0)
        if reach.min() >= MIN_ROUND_SHARE * reach.max() > 0:
            yield first, second


def warped(shape: Shape, lattice: Lattice, warp: Sequence[FloatArray]) -> Shape:
    """Return a shape in other proportions.

    Each part has a mesh of its own whose origin is the middle of its box. Poses do not rotate, and contacts are those
    of the shape. Raises ValueError for factors that do not fit this lattice.
    """
    original, images = shape.assembly, lattice.images(warp)
    poses = np.tile(np.eye(4), (len(original), 1, 1))
    meshes = []
    for part, (kind, pose) in enumerate(zip(original.types.tolist(), original.poses, strict=True)):
        mesh = shape.meshes[kind]
        positions = transform_points(pose, mesh.vertices)
        moved = _mapped_points(positions, lattice.knots, images)
        centre = (moved.min(axis=0) + moved.max(axis=0)) / 2
        poses[part, :3, 3] = centre
        look = None if mesh.appearance is None else mesh.appearance.turned(pose[:3, :3])
        if look is not None and look.normals is not None:
            normals = unit_vectors(look.normals / _slopes(positions[mesh.faces], lattice.knots, images))
            look = replace(look, normals=normals)
        name = shape.part_names[part]
        meshes.append(WarpedMesh(name, moved - centre, mesh.faces, mesh.face_colors, mesh, appearance=look))
    assembly = Assembly(np.arange(len(meshes), dtype=np.int16), poses, original.edges)
    return replace(shape, meshes=tuple(meshes), assembly=assembly, own_names=shape.part_names)


def _mapped_points(points: FloatArray, knots: Sequence[FloatArray], images: Sequence[FloatArray]) -> FloatArray:
    """Return moved points, float64 (v, 3)."""
    moved: FloatArray = np.column_stack([_mapped(points[:, axis], knots[axis], images[axis]) for axis in range(3)])
    return moved


def _slopes(corners: FloatArray, knots: Sequence[FloatArray], images: Sequence[FloatArray]) -> FloatArray:
    """Return by how much a map stretches each axis at the corners of faces (f, 3, 3), on the side of the face."""
    inner = corners + SLOPE_STEP_SHARE * (corners.mean(axis=1, keepdims=True) - corners)
    slopes: FloatArray = np.empty_like(inner)
    for axis, (ends, moved) in enumerate(zip(knots, images, strict=True)):
        factors = np.concatenate([[1.0], np.diff(moved) / np.diff(ends), [1.0]])
        slopes[:, :, axis] = factors[np.searchsorted(ends, inner[:, :, axis])]
    return slopes


def _mapped(positions: FloatArray, knots: FloatArray, images: FloatArray) -> FloatArray:
    """Return moved positions along an axis, float64 (v,). A knot is the mean of near ends, so some lie a little
    outside.
    """
    inside = np.interp(positions, knots, images)
    mapped: FloatArray = inside + np.minimum(positions - knots[0], 0.0) + np.maximum(positions - knots[-1], 0.0)
    return mapped
