"""Other proportions of an exemplar: along each axis a monotone map that is linear between the ends of its parts.

The mapping is one for all of space and taken a vertex at a time (substructures §5.2), so what touches goes on touching,
and what lies apart goes on lying apart. Lengths along an axis that were equal stay equal, and thin ones along all axes:
legs stay alike, boards as thick as each other, gaps even, and what is its own mirror image remains so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.contact import world_boxes
from stages.shape.geometry.pose import transform_points
from stages.shape.kit import Assembly, Kit, PartMesh
from stages.shape.shape import Shape, kit_shape

MERGED_ENDS_SHARE = 2e-3
"""Ends of parts that are nearer to each other than this share of the longest side are one."""
EQUAL_LENGTH_TOLERANCE = 0.02
"""Lengths that differ by less, as a share, are equal."""
MIN_SCALED_LENGTH_SHARE = 0.15
"""A length of more than this share of the longest side follows the size of the whole along its axis; what is thinner
has a thickness of its own."""
MAX_FREE_INTERVALS = 12
"""With more intervals along an axis than this all of them follow the size of the whole; and with more lengths than this
each has the less of its own."""
FACTOR_DECIMALS = 3

Warp = tuple[FloatArray, FloatArray, FloatArray]
"""For each axis the factors of its intervals, float64 (k,)."""


@dataclass(frozen=True, eq=False)
class WarpedMesh(PartMesh):
    """The surface of a part in other proportions. of: the mesh as it is."""

    of: PartMesh

    @property
    def label(self) -> str:
        return self.of.label


@dataclass(frozen=True)
class Lattice:
    """The intervals of an exemplar.

    knots: for each axis float64 (k + 1,), ascending, where parts begin or end, in the coordinates of the exemplar;
    lengths: for each axis int64 (k,), the number of each interval's length: equal lengths have one number, along all
    axes; up: the axis that points up.
    """

    knots: tuple[FloatArray, FloatArray, FloatArray]
    lengths: tuple[np.ndarray, np.ndarray, np.ndarray]
    up: int

    def draw(self, rng: np.random.Generator, spread: float, most: float) -> Warp:
        """Random factors, rounded, at most `most` and at least its inverse."""
        count = 1 + max((int(numbers.max()) for numbers in self.lengths if len(numbers)), default=-1)
        sizes = rng.normal(0.0, spread, 3)
        own = rng.normal(0.0, spread * min(1.0, np.sqrt(MAX_FREE_INTERVALS / max(count, 1))), count)
        found = []
        large = MIN_SCALED_LENGTH_SHARE * max(float(axis_knots[-1] - axis_knots[0]) for axis_knots in self.knots)
        for knots, lengths, size in zip(self.knots, self.lengths, sizes, strict=True):
            gaps = np.diff(knots)
            follows = (gaps > large) | (len(gaps) > MAX_FREE_INTERVALS)
            factors = np.exp(own[lengths] + np.where(follows, size, 0.0))
            found.append(np.round(np.clip(factors, 1 / most, most), FACTOR_DECIMALS))
        x, y, z = found
        return x, y, z

    def images(self, warp: Sequence[FloatArray]) -> list[FloatArray]:
        """Where the knots of each axis come to lie. The lowest stays where it is, and so does the middle along the
        other axes. Raises ValueError for factors that are none of this lattice."""
        found = []
        for axis, (knots, factors) in enumerate(zip(self.knots, warp, strict=True)):
            if len(factors) != len(knots) - 1 or not np.isfinite(factors).all() or (np.asarray(factors) <= 0).any():
                raise ValueError(
                    f"axis {'xyz'[axis]} has {len(knots) - 1} intervals: it needs as many positive factors"
                )
            images = knots[0] + np.concatenate([[0.0], np.cumsum(np.diff(knots) * factors)])
            if axis != self.up:
                images += (knots[0] + knots[-1] - images[0] - images[-1]) / 2
            found.append(images)
        return found

    def signature(self, warp: Sequence[FloatArray]) -> FloatArray:
        """What tells proportions apart, whatever the size: the knots of all axes, float64 (sum of k + 1,), about the
        middle and by the diagonal."""
        images = self.images(warp)
        diagonal = float(np.linalg.norm([image[-1] - image[0] for image in images]))
        return np.concatenate([(image - (image[0] + image[-1]) / 2) / max(diagonal, 1e-12) for image in images])


def lattice_of(kit: Kit, exemplar: Assembly) -> Lattice:
    """The intervals of an exemplar of a kit, hubs among its parts."""
    boxes = world_boxes(kit.types, exemplar.types, exemplar.poses)
    near = max(kit.contact_tolerance, MERGED_ENDS_SHARE * float(np.ptp(boxes, axis=(0, 1)).max()))
    known: list[float] = []
    knots, lengths = [], []
    for axis in range(3):
        ends = np.sort(boxes[:, :, axis].ravel())
        groups = np.split(ends, 1 + np.flatnonzero(np.diff(ends) > near))
        places = np.array([group.mean() for group in groups])
        numbers = []
        for gap in np.diff(places).tolist():
            same = (
                place
                for place, one in enumerate(known)
                if abs(one - gap) <= max(2 * near, EQUAL_LENGTH_TOLERANCE * one)
            )
            place = next(same, len(known))
            known += [gap] if place == len(known) else []
            numbers.append(place)
        knots.append(places)
        lengths.append(np.array(numbers, dtype=np.int64))
    return Lattice((knots[0], knots[1], knots[2]), (lengths[0], lengths[1], lengths[2]), {"y": 1, "z": 2}[kit.up])


def warped(kit: Kit, exemplar: Assembly, lattice: Lattice, warp: Sequence[FloatArray]) -> Shape:
    """An exemplar in other proportions: each part has a mesh of its own, whose origin is the middle of the box around
    it; poses turn nothing, and contacts are those of the exemplar. Raises ValueError for factors that are none of this
    lattice."""
    shape, images = kit_shape(kit, exemplar), lattice.images(warp)
    poses = np.tile(np.eye(4), (len(exemplar), 1, 1))
    meshes = []
    for part, (kind, pose) in enumerate(zip(exemplar.types.tolist(), exemplar.poses, strict=True)):
        mesh = kit.types[kind]
        places = transform_points(pose, mesh.vertices)
        moved = np.column_stack([_mapped(places[:, axis], lattice.knots[axis], images[axis]) for axis in range(3)])
        centre = (moved.min(axis=0) + moved.max(axis=0)) / 2
        poses[part, :3, 3] = centre
        meshes.append(WarpedMesh(shape.part_names[part], moved - centre, mesh.faces, mesh.face_colors, mesh))
    assembly = Assembly(np.arange(len(meshes), dtype=np.int16), poses, exemplar.edges)
    return replace(shape, meshes=tuple(meshes), assembly=assembly, own_names=shape.part_names)


def _mapped(places: FloatArray, knots: FloatArray, images: FloatArray) -> FloatArray:
    """Places along an axis, float64 (v,); a knot is the mean of ends that lie near, so some lie a little outside."""
    inside = np.interp(places, knots, images)
    found: FloatArray = inside + np.minimum(places - knots[0], 0.0) + np.maximum(places - knots[-1], 0.0)
    return found
