"""Other proportions of an exemplar: along each axis a monotone map that is linear between the ends of its parts.

One map moves all vertices (substructures §5.2), so parts that touch keep touching, and separate parts stay separate.
Lengths along an axis that were equal stay equal, and so do thin ones along all axes. So legs stay alike, boards equally
thick, gaps even, and symmetric shapes symmetric. What is round stays round: along both of its axes all lengths have one
factor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stages.shape.appearance import unit_vectors
from stages.shape.arrays import FloatArray
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
    round_axes: the two axes across which an exemplar is round, such as x and z of a barrel; empty for any other
    """

    knots: tuple[FloatArray, FloatArray, FloatArray]
    lengths: tuple[np.ndarray, np.ndarray, np.ndarray]
    up: int
    round_axes: tuple[int, ...] = ()

    def draw(self, rng: np.random.Generator, log_std: float, max_factor: float) -> Warp:
        """Return random rounded factors, at most `max_factor` and at least its inverse; one for both round axes."""
        count = 1 + max((int(numbers.max()) for numbers in self.lengths if len(numbers)), default=-1)
        sizes = rng.normal(0.0, log_std, 3)
        own = rng.normal(0.0, log_std * min(1.0, np.sqrt(MAX_FREE_INTERVALS / max(count, 1))), count)
        warp = []
        large = MIN_SCALED_LENGTH_SHARE * max(float(axis_knots[-1] - axis_knots[0]) for axis_knots in self.knots)
        for axis, (knots, lengths, size) in enumerate(zip(self.knots, self.lengths, sizes, strict=True)):
            gaps = np.diff(knots)
            follows = (gaps > large) | (len(gaps) > MAX_FREE_INTERVALS)
            factors = np.exp(own[lengths] + np.where(follows, size, 0.0))
            if axis in self.round_axes:
                factors = np.full(len(gaps), np.exp(sizes[self.round_axes[0]]))
            warp.append(np.round(np.clip(factors, 1 / max_factor, max_factor), FACTOR_DECIMALS))
        x, y, z = warp
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
    lattice = Lattice((knots[0], knots[1], knots[2]), (lengths[0], lengths[1], lengths[2]), up)
    return replace(lattice, round_axes=_round_axes(shape, up))


def _round_axes(shape: Shape, up: int) -> tuple[int, ...]:
    """Return the two axes along which the silhouette of a shape is round, seen from above if it is round there."""
    assembly = shape.assembly
    points = np.concatenate(
        [
            transform_points(pose, shape.meshes[kind].vertices)
            for kind, pose in zip(assembly.types.tolist(), assembly.poses, strict=True)
        ]
    )
    points -= (points.min(axis=0) + points.max(axis=0)) / 2
    angles = 2.0 * np.pi * np.arange(SILHOUETTE_DIRECTIONS) / SILHOUETTE_DIRECTIONS
    directions = np.stack([np.cos(angles), np.sin(angles)])
    for axis in sorted(range(3), key=lambda axis: axis != up):
        across = tuple(other for other in range(3) if other != axis)
        reach = (points[:, across] @ directions).max(axis=0)
        if reach.min() >= MIN_ROUND_SHARE * reach.max():
            return across
    return ()


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
