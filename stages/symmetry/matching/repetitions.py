"""What a surface has several times: periods of a row that a transform continues, and separate pieces that dock
(symmetry §3.4.1, §3.4.3)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.pose import invert, rotation_angle, transform_points
from stages.symmetry.matching.candidate_transforms import candidate_transforms
from stages.symmetry.matching.cell_lookup import is_among, items_in, items_moved_into, keys_at
from stages.symmetry.matching.docking_sites import FREE_SLIPS, connected_regions, find_docking_sites
from stages.symmetry.matching.r_symmetry import matched_items, r_symmetric_cells
from stages.symmetry.surface.grid import SurfaceGrid
from stages.symmetry.surface.soup import PlanePair

MAX_TRANSFORMS = 40
MAX_CELL_TESTS = 16_000_000
"""Cells tested in all, once per transform: large grids are searched with fewer transforms."""
MAX_SEEDS = 32
"""Regions whose copies are searched, the most promising first."""
MAX_COPIES = 400
"""Copies searched per region."""
SAMPLE_ITEMS = 48
"""Items of a region that are tested before all of them."""
PART_COST = 2e-3
"""Cost of a part, as a share of the surface: copies of less are never worth a cut."""
MAX_REGION_SHARE = 0.5
"""Largest share of the surface in a region: more of it occurs nowhere else."""
MIN_EIGENVALUE_SHARE = 1e-4
"""Smallest eigenvalue of the normals of a region, as a share of the largest; a straight bar has less."""
NO_TURN_RADIANS = 1e-2
"""A transform that turns less is a translation."""
SURE_COPY_SHARE = 0.9
"""A copy counts before a full test if more of the sample is found."""
MIN_COPY_SHARE = 0.5
"""Smallest share of the region in a copy; all copies lose what one lacks."""
MAX_OVERLAP_SHARE = 0.05
"""Share of the inside of a copy that may lie inside another: cells do not move with copies."""
KNOWN_SHARE = 0.8
"""A region is already known if more of it lies in copies of a known one."""
BAND_CELLS = 3
"""Cells by which a region reaches beyond its far border, so that the next copy sets that border."""


@dataclass(frozen=True)
class Repetition:
    """A region of the surface and its copies.

    A copy is the part of its band between two planes. Without planes, it is the part that is not in the band of the
    copy ahead. So all copies have the same border.

    cells: int32, of the region, ascending
    area: of the region
    poses: float64 (4, 4) each, of the copies, the identity first
    ahead: float64 (4, 4), from one copy of a row to the next; None for separate copies
    band: int32, the cells and, in a row, some beyond the far border
    planes: around the first copy, across a straight row; None for separate copies and where no plane fits all copies
    """

    cells: IntArray
    area: float
    poses: tuple[FloatArray, ...]
    ahead: FloatArray | None
    band: IntArray
    planes: PlanePair | None

    @property
    def saved_area(self) -> float:
        """Area of all copies but one."""
        return (len(self.poses) - 1) * self.area


def find_repetitions(grid: SurfaceGrid) -> list[Repetition]:
    """Find regions that the surface has at least twice, the one that saves most surface first.

    A transform takes r-symmetric cells onto the surface; those to which it takes no others begin a row. A piece that is
    not r-symmetric under one transform may have copies under others. All transforms and their products are tried on
    each such region.
    """
    transforms = candidate_transforms(grid, min(MAX_TRANSFORMS, max(1, MAX_CELL_TESTS // len(grid))))
    both = np.concatenate([transforms, invert(transforms)])
    seeds = [seed for transform in transforms for seed in _seeds(grid, transform)]
    promise = [_promised_area(grid, cells, ahead, both) for cells, ahead in seeds]
    order = np.argsort([-area for area in promise], kind="stable")[:MAX_SEEDS]
    known: list[Repetition] = []
    for cells, ahead in (seeds[number] for number in order.tolist() if promise[number] > 0):
        if not any(_is_known(grid, cells, ahead, repetition) for repetition in known):
            repetition = _repetition(grid, cells, ahead, both)
            known += [] if repetition is None else [repetition]
    return sorted(known, key=lambda repetition: -repetition.saved_area)


def _seeds(grid: SurfaceGrid, transform: FloatArray) -> Iterator[tuple[IntArray, FloatArray | None]]:
    """Yield the regions that a transform distinguishes, each with the transform ahead if it begins a row."""
    kept, kept_back = r_symmetric_cells(grid, transform)
    for chosen, ahead in ((kept & ~kept_back, transform), (kept_back & ~kept, invert(transform))):
        for cells in connected_regions(grid, chosen):
            if _is_part_sized(grid, cells):
                yield cells, ahead
    for site in find_docking_sites(grid, transform, kept, kept_back):
        if site.kind == "replace" and site.slips < FREE_SLIPS and _is_part_sized(grid, site.primary):
            yield site.primary, None


def _is_known(grid: SurfaceGrid, cells: IntArray, ahead: FloatArray | None, known: Repetition) -> bool:
    """Return whether a region lies in copies of a known one, and the transform ahead takes a copy to a copy."""
    corners = grid.points[_sample(grid, items_in(grid, known.cells))[[0, -1]]]
    if ahead is not None:
        copies = np.array([transform_points(pose, corners) for pose in known.poses])
        moved = np.array([transform_points(ahead, corners) for corners in copies])
        if np.abs(copies[:, None] - moved).max(axis=(2, 3)).min() > grid.cell_size:
            return False
    points = grid.points[items_in(grid, known.cells)]
    keys = np.sort(np.concatenate([keys_at(grid, pose, points) for pose in known.poses]))
    return bool(is_among(keys, grid.keys[cells]).mean() > KNOWN_SHARE)


def _is_part_sized(grid: SurfaceGrid, cells: IntArray) -> bool:
    """Return whether a region is large enough for a part, at most half of the surface, and no straight bar."""
    if not PART_COST < grid.area[cells].sum() / grid.area.sum() < MAX_REGION_SHARE:
        return False
    items = items_in(grid, cells)
    normals = grid.directions[items[~grid.is_line[items]]]
    values = np.linalg.eigvalsh(normals.T @ normals)
    return bool(values[0] > MIN_EIGENVALUE_SHARE * values[-1])


def _promised_area(grid: SurfaceGrid, cells: IntArray, ahead: FloatArray | None, transforms: FloatArray) -> float:
    """Estimate the surface that copies of a region would save, by a sample of the region."""
    items = _sample(grid, items_in(grid, cells))
    inside = _inside(grid, cells)
    points, keys = grid.points[_evenly(items_in(grid, inside))], grid.keys[inside]
    inverses: list[FloatArray] = [np.eye(4)]
    for pose in [*_row(grid, grid.points[items], ahead), *transforms]:
        if _share(matched_items(grid, pose, items)) > SURE_COPY_SHARE and not _overlaps(
            grid, keys, points, pose, inverses
        ):
            inverses.append(invert(pose))
    return float((len(inverses) - 1) * grid.area[cells].sum())


def _continues(grid: SurfaceGrid, cells: IntArray, copy_poses: Sequence[FloatArray], ahead: FloatArray | None) -> bool:
    """Return whether a copy of a region is translated without a turn, or a row has two steps.

    The corners of a box are equal under turns alone; nothing could be put between such copies.
    """
    others = np.array(copy_poses)
    if (rotation_angle(others) < NO_TURN_RADIANS).any():
        return True
    if ahead is None:
        return False
    back = invert(ahead)
    middle = grid.points[items_in(grid, cells)].mean(axis=0)
    middles = others[:, :3, :3] @ middle + others[:, :3, 3]

    def has_copy(pose: FloatArray) -> bool:
        return bool((np.linalg.norm(middles - transform_points(pose, middle), axis=1) < grid.cell_size).any())

    steps = [has_copy(step) for step in (back @ back, back, ahead, ahead @ ahead)]
    return any(one and two for one, two in pairwise(steps))


def _sample(grid: SurfaceGrid, items: np.ndarray) -> np.ndarray:
    """Return some of `items`, evenly: lines if there are any, since planes of plain walls match almost everywhere."""
    lines = items[grid.is_line[items]]
    return _evenly(lines if len(lines) else items)


def _evenly(items: np.ndarray) -> np.ndarray:
    return items[np.linspace(0, len(items) - 1, min(SAMPLE_ITEMS, len(items))).astype(np.int64)]


def _repetition(
    grid: SurfaceGrid, cells: IntArray, ahead: FloatArray | None, transforms: FloatArray
) -> Repetition | None:
    """Return the copies of a region, without what some of them lack; a copy counts if that saves surface.

    None for a region without copies, and for copies between which nothing could be put.
    """
    kept, poses, inverses = np.ones(len(cells), dtype=bool), [np.eye(4)], [np.eye(4)]
    inside = _inside(grid, cells)
    points, keys = grid.points[_evenly(items_in(grid, inside))], grid.keys[inside]
    copies = sorted(_copies(grid, cells, ahead, transforms), key=lambda copy: -grid.area[cells[copy[1]]].sum())
    for pose, same in copies:
        with_copy = grid.area[cells[kept & same]].sum() * len(poses)
        if with_copy <= grid.area[cells[kept]].sum() * (len(poses) - 1):
            continue
        if _overlaps(grid, keys, points, pose, inverses):
            continue
        kept &= same
        poses.append(pose)
        inverses.append(invert(pose))
    regions = [cells[kept][region] for region in _regions_among(grid, cells[kept])]
    whole = [region for region in regions if _is_part_sized(grid, region)]
    if len(poses) < 2 or not whole:
        return None
    cells = np.sort(np.concatenate(whole)).astype(np.int32)
    if not _continues(grid, cells, poses[1:], ahead):
        return None
    band, planes = _planes(grid, cells, poses, ahead) or (_band(grid, cells, ahead), None)
    return Repetition(cells, float(grid.area[cells].sum()), tuple(poses), ahead, band, planes)


def _copies(
    grid: SurfaceGrid, cells: IntArray, ahead: FloatArray | None, transforms: FloatArray
) -> list[tuple[FloatArray, BoolArray]]:
    """Return poses (4, 4) at which the surface has much of a region, and which of its cells, bool (n,).

    In a row, all multiples of the transform ahead are tried within the box of the model. Then the transforms are
    applied to each known copy.
    """
    items = items_in(grid, cells)
    sample = _sample(grid, items)
    corners = grid.points[sample[[0, len(sample) // 3, 2 * len(sample) // 3, -1]]]
    waiting = [np.eye(4), *_row(grid, corners, ahead)]
    tried = np.empty((0, corners.size))
    copies: list[tuple[FloatArray, BoolArray]] = []
    next_pose = 0
    while next_pose < len(waiting):
        pose = waiting[next_pose]
        next_pose += 1
        at = transform_points(pose, corners).reshape(1, -1)
        if len(tried) and np.abs(tried - at).max(axis=1).min() < grid.cell_size:
            continue
        tried = np.concatenate([tried, at])
        if _share(matched_items(grid, pose, sample)) <= MIN_COPY_SHARE:
            continue
        same = _same_cells(grid, cells, items, pose, MIN_COPY_SHARE)
        if same is None:
            continue
        if len(tried) > 1:
            copies.append((pose, same))
        if len(waiting) < MAX_COPIES:
            waiting += [transform @ pose for transform in transforms]
    return copies


def _row(grid: SurfaceGrid, points: FloatArray, ahead: FloatArray | None) -> Iterator[FloatArray]:
    """Yield the powers (4, 4) of a transform and of its inverse that keep points (n, 3) in the model's box."""
    low, high = grid.bounds[0] - grid.cell_size, grid.bounds[1] + grid.cell_size
    for step in () if ahead is None else (ahead, invert(ahead)):
        pose = step
        for _ in range(MAX_COPIES // 2):
            moved = transform_points(pose, points)
            if (moved < low).any() or (moved > high).any():
                break
            yield pose
            pose = step @ pose


def _overlaps(
    grid: SurfaceGrid, keys: np.ndarray, points: FloatArray, pose: FloatArray, inverses: list[FloatArray]
) -> bool:
    """Return whether points (n, 3) of a region at `pose` lie in its cells, with these keys, at another pose.

    inverses: float64 (4, 4) each, of the other poses
    """
    inside = (is_among(keys, keys_at(grid, back @ pose, points)) for back in inverses)
    return any(_share(among) > MAX_OVERLAP_SHARE for among in inside)


def _share(chosen: BoolArray) -> float:
    return np.count_nonzero(chosen) / len(chosen)


def _same_cells(
    grid: SurfaceGrid, cells: IntArray, items: np.ndarray, pose: FloatArray, min_share: float
) -> BoolArray | None:
    """Return which of ascending `cells` with these `items` the surface has at a pose (4, 4) exactly, bool (n,).

    None if they are at most `min_share` of the region.
    """
    area = grid.area[cells]
    same = np.ones(len(cells), dtype=bool)
    missed = items[~matched_items(grid, pose, items)]
    same[np.searchsorted(cells, grid.item_cell[missed])] = False
    if area[same].sum() <= min_share * area.sum():
        return None  # before the slower half: what else lies there
    back = invert(pose)
    present = items_moved_into(grid, cells, pose)
    more = present[~matched_items(grid, back, present)]
    same[np.searchsorted(grid.keys[cells], keys_at(grid, back, grid.points[more]))] = False
    return same if area[same].sum() > min_share * area.sum() else None


def _inside(grid: SurfaceGrid, cells: IntArray) -> IntArray:
    """Return the cells whose neighbours are all among `cells`; or all of `cells` where no cell has."""
    chosen = np.zeros(len(grid) + 1, dtype=bool)
    chosen[cells] = chosen[-1] = True  # the last entry stands for empty neighbours
    inside = cells[chosen[grid.neighbours[cells]].all(axis=1)]
    return inside if len(inside) else cells


def _regions_among(grid: SurfaceGrid, cells: IntArray) -> list[np.ndarray]:
    """Return the connected regions of ascending `cells`, as indices into `cells`."""
    chosen = np.zeros(len(grid), dtype=bool)
    chosen[cells] = True
    return [np.searchsorted(cells, region) for region in connected_regions(grid, chosen)]


def _band(grid: SurfaceGrid, cells: IntArray, ahead: FloatArray | None) -> IntArray:
    """Return a region and, in a row, the cells beyond it that the copy ahead takes.

    Cells at the side of the row are left out, because there cells of one copy lie across the border of the other.
    """
    if ahead is None:
        return cells
    row = np.zeros(len(grid) + 1, dtype=bool)
    row[cells] = row[-1] = True  # the last entry stands for empty neighbours
    for step in (ahead, invert(ahead)):
        row[grid.item_cell[items_moved_into(grid, cells, step)]] = True
    inner = cells[row[grid.neighbours[cells]].all(axis=1)]
    taken, band = np.zeros((2, len(row)), dtype=bool)
    taken[grid.item_cell[items_moved_into(grid, inner, ahead)]] = True
    taken[cells] = band[cells] = True
    for _ in range(BAND_CELLS):
        band[grid.neighbours[np.flatnonzero(band)]] = True
        band &= taken  # which has no empty neighbour
    return np.flatnonzero(band).astype(np.int32)


def _planes(
    grid: SurfaceGrid, cells: IntArray, poses: Sequence[FloatArray], ahead: FloatArray | None
) -> tuple[IntArray, PlanePair] | None:
    """Return the band and the planes of the first copy in a straight row.

    None for other copies, and if no plane across the row fits all of them.

    The border of a region follows, cell by cell, what differs at the end of the row. Cells do not move with the copies
    of a row that crosses it, so that each of those copies gets another border. A plane cuts all of them in the same
    way. It may be anywhere the surface up to one step ahead is the same for every pose; the middle is taken.
    """
    if ahead is None or rotation_angle(ahead) > NO_TURN_RADIANS:
        return None
    step = float(np.linalg.norm(ahead[:3, 3]))
    direction = ahead[:3, 3] / step
    behind, beyond = (_next_copy(grid, cells, way) for way in (invert(ahead), ahead))
    row = np.unique(np.concatenate([behind, cells, beyond]))
    items = items_in(grid, row)
    differs = np.zeros(len(grid), dtype=bool)
    for pose in poses[1:]:
        same = _same_cells(grid, row, items, pose, 0.0)
        differs[row] |= True if same is None else ~same
    height = grid.centres() @ direction
    reach = grid.cell_size * float(np.abs(direction).sum()) / 2
    low, high = height[cells].min() - step / 2, height[cells].max() - step / 2
    low = max(low, float(height[behind[differs[behind]]].max(initial=-np.inf)) + reach)
    high = min(high, float(height[beyond[differs[beyond]]].min(initial=np.inf)) - reach - step)
    if low > high:
        return None
    planes = PlanePair(direction, (low + high) / 2, (low + high) / 2 + step)
    return row[(height[row] > planes.low - reach) & (height[row] < planes.high + reach)], planes


def _next_copy(grid: SurfaceGrid, cells: IntArray, step: FloatArray) -> IntArray:
    """Return the cells of a region moved by `step` (4, 4), without the region, with the joint between both: int32."""
    region, moved = np.zeros((2, len(grid) + 1), dtype=bool)  # the last entry stands for empty neighbours
    region[cells] = moved[grid.item_cell[items_moved_into(grid, cells, step)]] = True
    moved[:-1] |= region[grid.neighbours].any(axis=1) & moved[grid.neighbours].any(axis=1)
    return np.flatnonzero(moved & ~region).astype(np.int32)
