"""A point cloud on a sparse voxel grid: the planes of its patches in each cell (symmetry §4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.errors import ConfigError
from stages.grammars.scans.planar_patches import planar_patches
from stages.grammars.scans.point_neighbourhoods import estimate_noise, point_neighbourhoods
from stages.shape.arrays import ByteArray, FloatArray, IntArray
from stages.shape.kit import LengthUnit
from stages.symmetry.surface.grid import CELLS_PER_RADIUS, LATTICE_OFFSET_CELLS, SurfaceGrid
from stages.symmetry.surface.lattice import neighbours_of, pack_cells, unpack_cells

MIN_POINTS = 500
MAX_COORDINATE = 1e30
"""The squares of larger numbers leave the range of floats."""
MIN_SPREAD_SHARE = 1e-6
"""The second widest spread of points on a line or a dot is below this share of the widest."""
MIN_POINTS_PER_CELL = 2.0
"""With fewer points per cell, in the mean, cells of a surface are missing everywhere."""
MIN_PLANE_CELLS = 0.1
"""Distance, in cells, up to which a point lies on a plane, however little noise there is."""
SAME_PLANE_CELLS = 0.2
"""Distance, in cells, up to which planes are the same; the noise is added."""
MAX_NOISE_CELLS = 0.5
"""With more noise, in cells, planes that are cells apart cannot be told apart."""
SAME_ANGLE_RADIANS = 0.25
"""Planes at a smaller angle are the same: the facets of curved surfaces differ from copy to copy."""
MIN_AGREEMENT = 0.75
"""Share of planes that must match under a transform; others are missing in holes, or noise."""
WEAK_COUNT_SHARE = 0.4
"""Planes in a cell with fewer points than this share of the median may be missing."""
SPLAT_OVERLAP = 4.0
"""Area of a splat, relative to its point's share of the surface, so that splats cover the surface."""


@dataclass(frozen=True, eq=False)
class ScannedCloud:
    """A point cloud.

    points: float64 (n, 3), in `unit`
    colors: uint8 (n, 3), sRGB
    normals: float64 (n, 3), outward; None if unknown
    """

    points: FloatArray
    colors: ByteArray
    normals: FloatArray | None = None
    unit: LengthUnit = "unknown"


@dataclass(frozen=True, eq=False)
class ScannedGrid:
    """A grid of splats, one for each point on a patch, with what feature lines are found by.

    item_patch: int32 (i,), the patch of each item of the grid
    middles, normals: float64 (m, 3), planes of the patches
    noise: standard deviation, in the units of the points
    """

    grid: SurfaceGrid
    item_patch: IntArray
    middles: FloatArray
    normals: FloatArray
    noise: float


def scanned_grid(cloud: ScannedCloud, share: float) -> ScannedGrid:
    """Build the grid of a point cloud for a radius of `share` of the longest side of its box without outliers.

    Points are projected onto the planes of their patches, so that points in the wrong cell because of noise return.
    Outliers and points on no patch are left out.

    Raises ConfigError for a cloud with too few points, or with points that are not finite or lie on a line. Also for a
    cloud too thin for the radius, or so noisy that cells cannot tell planes apart.
    """
    points = cloud.points
    _check(points)
    around = point_neighbourhoods(points)
    if not np.median(around.reach) > 0:
        raise ConfigError("most points are at the position of another one; remove repeated points")
    held = points[~around.outlier]
    size = share * float(np.ptp(held, axis=0).max()) / CELLS_PER_RADIUS
    if around.noise > MAX_NOISE_CELLS * size:
        raise ConfigError(
            f"points lie {around.noise:.3g} off the surface in the mean, cells are {size:.3g} wide; set radius to at "
            f"least {share * around.noise / (MAX_NOISE_CELLS * size):.3f}, or take the noise out"
        )
    patches = planar_patches(points, around, MIN_PLANE_CELLS * size, cloud.normals)
    faces = np.flatnonzero(patches.of >= 0)
    if not len(faces):
        raise ConfigError("no points lie on a surface; symmetry is looked for on scans of surfaces")
    patch, projected = patches.of[faces], patches.projected(points)[faces]
    low = projected.min(axis=0)
    radius = share * float((projected.max(axis=0) - low).max())
    size = radius / CELLS_PER_RADIUS
    origin = low - size * (np.array(LATTICE_OFFSET_CELLS) + 2)
    packed = pack_cells(np.floor((projected - origin) / size).astype(np.int64))
    order = np.lexsort((patch, packed))
    faces, patch, projected, packed = faces[order], patch[order], projected[order], packed[order]
    areas = np.pi * around.reach[faces] ** 2 / around.near.shape[1]
    per_cell = len(faces) * size**2 / float(areas.sum())
    if per_cell < MIN_POINTS_PER_CELL:
        raise ConfigError(
            f"{len(faces):,} points are too few for a radius of {share:g}: {per_cell:.1f} in a cell of the surface; "
            f"set radius to at least {share * (MIN_POINTS_PER_CELL / per_cell) ** 0.5:.3f}, or scan more densely"
        )
    keys, first = np.unique(packed, return_index=True)
    cells = unpack_cells(keys)
    begin = np.flatnonzero(np.r_[True, (packed[1:] != packed[:-1]) | (patch[1:] != patch[:-1])])
    count = np.diff(np.r_[begin, len(faces)])
    item_cell = np.searchsorted(keys, packed[begin]).astype(np.int32)
    grid = SurfaceGrid(
        corners=_splats(projected, patches.normals[patch], SPLAT_OVERLAP * areas),
        faces=faces.astype(np.int32),
        origin=origin,
        cell_size=size,
        radius=radius,
        keys=keys,
        cells=cells,
        neighbours=neighbours_of(cells, keys),
        area=SPLAT_OVERLAP * np.add.reduceat(areas, first),
        item_cell=item_cell,
        points=np.add.reduceat(projected, begin) / count[:, None],
        directions=patches.normals[patch[begin]],
        is_line=np.zeros(len(begin), dtype=bool),
        starts=np.searchsorted(item_cell, np.arange(len(keys) + 1)),
        tolerance=SAME_PLANE_CELLS * size + around.noise,
        same_angle=SAME_ANGLE_RADIANS,
        agreement=MIN_AGREEMENT,
        weak=count < WEAK_COUNT_SHARE * np.median(count),
        splats=True,
    )
    return ScannedGrid(grid, patch[begin], patches.middles, patches.normals, around.noise)


def suitable_radius(cloud: ScannedCloud, least: float) -> float:
    """Return a radius of similarity that suits a cloud, at least `least`, as a share of the longest side.

    Cells then hold twice the points that they must, and the noise is half of what it may be. Raises ConfigError for
    points that are no surface.
    """
    return max(least, float(np.ceil(1000 * max(_suitable_radii(cloud))) / 1000))


def required_points(cloud: ScannedCloud, share: float) -> int | None:
    """Return about how many points such a scan needs for a radius of `share` of the longest side.

    None if it is too noisy for the radius. Raises ConfigError for points that are no surface.
    """
    by_points, by_noise = _suitable_radii(cloud)
    points = len(cloud.points) * (by_points / share) ** 2
    return None if by_noise > share else int(round(points, 1 - int(np.log10(points))))


def _suitable_radii(cloud: ScannedCloud) -> tuple[float, float]:
    """Return the radii that suit the density of the points and their noise, as shares of the longest side."""
    _check(cloud.points)
    noise, reach, count = estimate_noise(cloud.points)
    low, high = np.quantile(cloud.points, [0.001, 0.999], axis=0)
    cells = CELLS_PER_RADIUS / float((high - low).max())
    return (2 * MIN_POINTS_PER_CELL * np.pi / count) ** 0.5 * reach * cells, 2 * noise / MAX_NOISE_CELLS * cells


def _check(points: FloatArray) -> None:
    """Raise ConfigError for points (n, 3) that are no surface."""
    if len(points) < MIN_POINTS:
        raise ConfigError(f"{len(points):,} points are no scan of a surface; it takes at least {MIN_POINTS:,}")
    wrong = int((~(np.abs(points) <= MAX_COORDINATE)).any(axis=1).sum())
    if wrong:
        raise ConfigError(f"{wrong:,} of {len(points):,} points are not finite (NaN or infinity); take them out")
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False, full_matrices=False)
    if spread[1] <= MIN_SPREAD_SHARE * spread[0]:
        raise ConfigError(f"all {len(points):,} points lie on one line; symmetry is looked for on scans of surfaces")


def _splats(points: FloatArray, normals: FloatArray, areas: FloatArray) -> FloatArray:
    """Return an equilateral triangle around each point (n, 3), of its normal (n, 3) and area (n,): (n, 3, 3)."""
    least = np.abs(normals).argmin(axis=1)
    one = np.cross(normals, np.eye(3)[least])
    one /= np.linalg.norm(one, axis=1)[:, None]
    other = np.cross(normals, one)
    reach = np.sqrt(areas * 4 / (3 * np.sqrt(3)))[:, None]
    turns = np.array([0, 2, 4]) * np.pi / 3
    corners = [points + reach * (np.cos(turn) * one + np.sin(turn) * other) for turn in turns]
    splats: FloatArray = np.stack(corners, axis=1)
    return splats
