"""A point cloud on a sparse voxel grid: in each cell the planes of its patches (symmetry §4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.errors import ConfigError
from stages.grammars.scans.planar_patches import planar_patches
from stages.grammars.scans.point_neighbourhoods import estimate_noise, point_neighbourhoods
from stages.shape.arrays import ByteArray, FloatArray, IntArray
from stages.symmetry.surface.grid import CELLS_PER_RADIUS, SHIFT, SurfaceGrid
from stages.symmetry.surface.lattice import neighbours_of, pack, unpack

FEWEST_POINTS = 500
FARTHEST = 1e30
"""Numbers beyond this are as good as infinite: their squares leave the range of floats."""
LEAST_SPREAD = 1e-6
"""Of the points of a line or a dot the second widest spread is below this share of the widest."""
A_CELL = 2.0
"""Points in a cell, in the mean, with fewer of which cells of a surface are missing everywhere."""
LEAST = 0.1
"""Share of a cell up to which a point lies on a plane, however little noise there is."""
SAME_PLACE = 0.2
"""Planes closer than this share of a cell and a standard deviation of the noise are one."""
MOST_NOISE = 0.5
"""Share of a cell that the noise may be at most: with more, planes that are cells apart are one."""
SAME_ANGLE = 0.25
"""Radians between planes that are one: curved surfaces have facets that differ from copy to copy."""
AGREEMENT = 0.75
"""Share of planes that must lie where a motion takes them: others are missing in holes, or noise."""
WEAK = 0.4
"""Planes in a cell with fewer points than this share of what is usual are no proof that a surface is not there."""
COVER = 4.0
"""A splat is so many times as large as a point's share of the surface: splats are to cover it."""


@dataclass(frozen=True, eq=False)
class ScannedCloud:
    """A point cloud: points float64 (n, 3), their colours uint8 (n, 3) sRGB, and outward normals float64 (n, 3); None
    where nobody knows these."""

    points: FloatArray
    colors: ByteArray
    normals: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class ScannedGrid:
    """A grid of splats, one for each point that lies on a patch, and what feature lines are found by.

    item_patch: int32 (i,), the patch of each item of the grid; middles, normals: float64 (m, 3), planes of the patches.
    noise: a standard deviation, in the units of the points.
    """

    grid: SurfaceGrid
    item_patch: IntArray
    middles: FloatArray
    normals: FloatArray
    noise: float


def scanned_grid(cloud: ScannedCloud, share: float) -> ScannedGrid:
    """The grid of a point cloud for a radius of `share` of the longest side of the box around all but outliers.

    Points are moved onto the planes of their patches: what noise has put into the next cell goes back. Outliers, and
    what lies on no patch, is left out.
    Raises ConfigError for a cloud of too few points, of points that are no numbers or lie on a line, for one too thin
    for the radius, and for one of so much noise that cells cannot tell planes apart.
    """
    points = cloud.points
    _check(points)
    around = point_neighbourhoods(points)
    if not np.median(around.reach) > 0:
        raise ConfigError("most points are at the place of another; take those out that are there more than once")
    held = points[~around.lonely]
    size = share * float(np.ptp(held, axis=0).max()) / CELLS_PER_RADIUS
    if around.noise > MOST_NOISE * size:
        raise ConfigError(
            f"points lie {around.noise:.3g} off the surface in the mean, cells are {size:.3g} wide; set radius to at "
            f"least {share * around.noise / (MOST_NOISE * size):.3f}, or take the noise out"
        )
    patches = planar_patches(points, around, LEAST * size, cloud.normals)
    faces = np.flatnonzero(patches.of >= 0)
    if not len(faces):
        raise ConfigError("no points lie on a surface; symmetry is looked for on scans of surfaces")
    patch, places = patches.of[faces], patches.projected(points)[faces]
    low = places.min(axis=0)
    radius = share * float((places.max(axis=0) - low).max())
    size = radius / CELLS_PER_RADIUS
    origin = low - size * (np.array(SHIFT) + 2)
    packed = pack(np.floor((places - origin) / size).astype(np.int64))
    order = np.lexsort((patch, packed))
    faces, patch, places, packed = faces[order], patch[order], places[order], packed[order]
    areas = np.pi * around.reach[faces] ** 2 / around.near.shape[1]
    dense = len(faces) * size**2 / float(areas.sum())
    if dense < A_CELL:
        raise ConfigError(
            f"{len(faces):,} points are too few for a radius of {share:g}: {dense:.1f} in a cell of the surface; set "
            f"radius to at least {share * (A_CELL / dense) ** 0.5:.3f}, or scan more densely"
        )
    keys, first = np.unique(packed, return_index=True)
    cells = unpack(keys)
    begin = np.flatnonzero(np.r_[True, (packed[1:] != packed[:-1]) | (patch[1:] != patch[:-1])])
    count = np.diff(np.r_[begin, len(faces)])
    item_cell = np.searchsorted(keys, packed[begin]).astype(np.int32)
    grid = SurfaceGrid(
        corners=_splats(places, patches.normals[patch], COVER * areas),
        faces=faces.astype(np.int32),
        origin=origin,
        cell_size=size,
        radius=radius,
        keys=keys,
        cells=cells,
        neighbours=neighbours_of(cells, keys),
        area=COVER * np.add.reduceat(areas, first),
        item_cell=item_cell,
        points=np.add.reduceat(places, begin) / count[:, None],
        directions=patches.normals[patch[begin]],
        is_line=np.zeros(len(begin), dtype=bool),
        starts=np.searchsorted(item_cell, np.arange(len(keys) + 1)),
        tolerance=SAME_PLACE * size + around.noise,
        same_angle=SAME_ANGLE,
        agreement=AGREEMENT,
        weak=count < WEAK * np.median(count),
        splats=True,
    )
    return ScannedGrid(grid, patch[begin], patches.middles, patches.normals, around.noise)


def suitable_radius(cloud: ScannedCloud, least: float) -> float:
    """The radius of similarity that suits a cloud, at least `least`, as a share of the longest side: with it cells hold
    twice the points that they must, and noise is half as much as it may be. Raises ConfigError for
    points that are no surface."""
    return max(least, float(np.ceil(1000 * max(_shares_that_suit(cloud))) / 1000))


def required_points(cloud: ScannedCloud, share: float) -> int | None:
    """About how many points a scan like `cloud` must have for a radius of `share` of the longest side; None where it
    would drown in noise. Raises ConfigError as `suitable_radius`."""
    by_points, by_noise = _shares_that_suit(cloud)
    points = len(cloud.points) * (by_points / share) ** 2
    return None if by_noise > share else int(round(points, 1 - int(np.log10(points))))


def _shares_that_suit(cloud: ScannedCloud) -> tuple[float, float]:
    """The radius that suits how dense the points are, and that which suits their noise, shares of the longest side."""
    _check(cloud.points)
    noise, reach, count = estimate_noise(cloud.points)
    low, high = np.quantile(cloud.points, [0.001, 0.999], axis=0)
    a_cell = CELLS_PER_RADIUS / float((high - low).max())
    return (2 * A_CELL * np.pi / count) ** 0.5 * reach * a_cell, 2 * noise / MOST_NOISE * a_cell


def _check(points: FloatArray) -> None:
    """Raises ConfigError for points (n, 3) that are no surface."""
    if len(points) < FEWEST_POINTS:
        raise ConfigError(f"{len(points):,} points are no scan of a surface; it takes at least {FEWEST_POINTS:,}")
    wrong = int((~(np.abs(points) <= FARTHEST)).any(axis=1).sum())
    if wrong:
        raise ConfigError(f"{wrong:,} of {len(points):,} points are not finite (NaN or infinity); take them out")
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False, full_matrices=False)
    if spread[1] <= LEAST_SPREAD * spread[0]:
        raise ConfigError(f"all {len(points):,} points lie on one line; symmetry is looked for on scans of surfaces")


def _splats(points: FloatArray, normals: FloatArray, areas: FloatArray) -> FloatArray:
    """An equilateral triangle around each of points (n, 3), with its normal (n, 3) and area (n,), float64 (n, 3, 3)."""
    least = np.abs(normals).argmin(axis=1)
    one = np.cross(normals, np.eye(3)[least])
    one /= np.linalg.norm(one, axis=1)[:, None]
    other = np.cross(normals, one)
    reach = np.sqrt(areas * 4 / (3 * np.sqrt(3)))[:, None]
    turns = np.array([0, 2, 4]) * np.pi / 3
    found: FloatArray = np.stack([points + reach * (np.cos(t) * one + np.sin(t) * other) for t in turns], axis=1)
    return found
