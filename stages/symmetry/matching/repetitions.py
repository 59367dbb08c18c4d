"""What a surface has several times: stretches of a row that a motion goes on with, and dockers that stand apart
(symmetry §3.4.1, §3.4.3)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.pose import invert, rotation_angle, transform_points
from stages.symmetry.matching.candidate_transforms import candidate_transforms
from stages.symmetry.matching.cell_lookup import is_among, items_in, items_moved_into, keys_at
from stages.symmetry.matching.docking_sites import connected_regions, find_docking_sites
from stages.symmetry.matching.r_symmetry import matched_items, r_symmetric_cells
from stages.symmetry.surface.grid import SurfaceGrid

MOTIONS = 40
"""So many motions are looked at, of a grid of many cells fewer."""
WORK = 16_000_000
"""Cells that are looked at in all, each once for a motion."""
SEEDS = 16
"""Of so many regions the copies are looked for, those that promise most."""
COPIES = 400
"""More copies of a region are not looked for."""
SAMPLE = 48
"""Items of a region that are looked at before all of them."""
PART = 2e-3
"""A part costs so much of the whole surface: copies of less are never worth a cut."""
LARGEST = 0.5
"""Share of the surface that a region has at most: more of it is nowhere else."""
SLIPPERY = 3
"""A site that slips in so many ways lies on a plane or a sphere, where a docker could stand anywhere."""
STRAIGHT = 1e-4
"""Least eigenvalue of the normals of a region, as a share of the largest, that is no prism: a bar has no copies."""
TURNED = 1e-2
"""A pose that turns by more radians is no shift."""
WHOLE = 0.9
"""A copy of which more than this share of a sample is found counts before all of it is looked at."""
ALIKE = 0.5
"""A copy has at least this share of the region; what it lacks is left out of all."""
OVERLAP = 0.05
"""Share of the inside of a copy that may lie inside another: cells do not move with copies."""
KNOWN = 0.8
"""Share of a region that must lie in copies that are known for it to be nothing new."""
BAND = 3
"""Cells by which a region reaches beyond its far border, so that the copy after it sets that border."""


@dataclass(frozen=True)
class Repetition:
    """A region of the surface and where else the surface has it.

    cells: int32, ascending; area: theirs. poses: rigid (4, 4), the identity first. ahead: in a row the motion (4, 4)
    from one copy to the next, None for copies that stand apart. band: int32, the cells and, in a row, some beyond its
    far border: a copy is what lies in its band and not in the band of the copy ahead, so that all have one border.
    """

    cells: IntArray
    area: float
    poses: tuple[FloatArray, ...]
    ahead: FloatArray | None
    band: IntArray

    @property
    def saves(self) -> float:
        """Area of all copies but one."""
        return (len(self.poses) - 1) * self.area


def find_repetitions(grid: SurfaceGrid) -> list[Repetition]:
    """What the surface has at least twice, that which saves most surface first.

    A motion takes r-symmetric cells onto the surface; those that it does not take others onto begin a row. What is not
    r-symmetric under one motion, a docker, may have copies under others. For each such region all motions and their
    products are tried.
    """
    motions = candidate_transforms(grid, min(MOTIONS, max(1, WORK // len(grid))))
    both = np.concatenate([motions, invert(motions)])
    seeds = [each for motion in motions for each in _seeds(grid, motion)]
    promise = [_promise(grid, cells, ahead, both) for cells, ahead in seeds]
    order = np.argsort([-each for each in promise], kind="stable")[:SEEDS]
    found: list[Repetition] = []
    for cells, ahead in (seeds[each] for each in order.tolist() if promise[each] > 0):
        if not any(_known(grid, cells, ahead, each) for each in found):
            repetition = _repetition(grid, cells, ahead, both)
            found += [repetition] if repetition is not None and _goes_on(grid, repetition) else []
    return sorted(found, key=lambda each: -each.saves)


def _seeds(grid: SurfaceGrid, motion: FloatArray) -> Iterator[tuple[IntArray, FloatArray | None]]:
    """Regions that a motion tells apart, each with the motion ahead if it begins a row."""
    kept, kept_back = r_symmetric_cells(grid, motion)
    for chosen, ahead in ((kept & ~kept_back, motion), (kept_back & ~kept, invert(motion))):
        for cells in connected_regions(grid, chosen):
            if _fits(grid, cells):
                yield cells, ahead
    for site in find_docking_sites(grid, motion, kept, kept_back):
        if site.kind == "replace" and site.slips < SLIPPERY and _fits(grid, site.primary):
            yield site.primary, None


def _known(grid: SurfaceGrid, cells: IntArray, ahead: FloatArray | None, known: Repetition) -> bool:
    """Whether a region is about part of the copies of a repetition, and the motion ahead takes copies to copies."""
    corners = grid.points[_sample(grid, items_in(grid, known.cells))[[0, -1]]]
    if ahead is not None:
        moved = transform_points(ahead, corners)
        if min(float(np.abs(transform_points(pose, corners) - moved).max()) for pose in known.poses) > grid.cell_size:
            return False
    points = grid.points[items_in(grid, known.cells)]
    there = np.unique(np.concatenate([keys_at(grid, pose, points) for pose in known.poses]))
    return bool(is_among(there, grid.keys[cells]).mean() > KNOWN)


def _fits(grid: SurfaceGrid, cells: IntArray) -> bool:
    """Whether a region is large enough to be a part, no more than half of the surface, and no straight bar."""
    if not PART < grid.area[cells].sum() / grid.area.sum() < LARGEST:
        return False
    items = items_in(grid, cells)
    normals = grid.directions[items[~grid.is_line[items]]]
    values = np.linalg.eigvalsh(normals.T @ normals)
    return bool(values[0] > STRAIGHT * values[-1])


def _promise(grid: SurfaceGrid, cells: IntArray, ahead: FloatArray | None, motions: FloatArray) -> float:
    """About how much surface whole copies of a region would save, by a sample of it."""
    items = _sample(grid, items_in(grid, cells))
    inside = _inside(grid, cells)
    points, keys = grid.points[_evenly(items_in(grid, inside))], grid.keys[inside]
    poses: list[FloatArray] = [np.eye(4)]
    for pose in [*_row(grid, grid.points[items], ahead), *motions]:
        if matched_items(grid, pose, items).mean() > WHOLE and not _overlaps(grid, keys, points, pose, poses):
            poses.append(pose)
    return float((len(poses) - 1) * grid.area[cells].sum())


def _goes_on(grid: SurfaceGrid, repetition: Repetition) -> bool:
    """Whether a copy is shifted and not turned, or a row goes on for two steps: the corners of a box, which are equal
    under turns alone, are no copies that something could be put between."""
    others = np.array(repetition.poses[1:])
    if (rotation_angle(others) < TURNED).any():
        return True
    if repetition.ahead is None:
        return False
    ahead, back = repetition.ahead, invert(repetition.ahead)
    middle = grid.points[items_in(grid, repetition.cells)].mean(axis=0)
    there = others[:, :3, :3] @ middle + others[:, :3, 3]

    def stands(pose: FloatArray) -> bool:
        return bool((np.linalg.norm(there - transform_points(pose, middle), axis=1) < grid.cell_size).any())

    steps = [stands(each) for each in (back @ back, back, ahead, ahead @ ahead)]
    return any(one and two for one, two in pairwise(steps))


def _sample(grid: SurfaceGrid, items: np.ndarray) -> np.ndarray:
    """Some of `items`, evenly: lines if there are any, of which planes of plain walls say nothing."""
    lines = items[grid.is_line[items]]
    return _evenly(lines if len(lines) else items)


def _evenly(items: np.ndarray) -> np.ndarray:
    return items[np.linspace(0, len(items) - 1, min(SAMPLE, len(items))).astype(np.int64)]


def _repetition(grid: SurfaceGrid, cells: IntArray, ahead: FloatArray | None, motions: FloatArray) -> Repetition | None:
    """The copies of a region, and the region without what some of them lack: a copy counts if that saves surface."""
    kept, poses = np.ones(len(cells), dtype=bool), [np.eye(4)]
    inside = _inside(grid, cells)
    points, keys = grid.points[_evenly(items_in(grid, inside))], grid.keys[inside]
    found = sorted(_copies(grid, cells, ahead, motions), key=lambda each: -grid.area[cells[each[1]]].sum())
    for pose, same in found:
        with_it = grid.area[cells[kept & same]].sum() * len(poses)
        if with_it <= grid.area[cells[kept]].sum() * (len(poses) - 1):
            continue
        if _overlaps(grid, keys, points, pose, poses):
            continue
        kept &= same
        poses.append(pose)
    whole = [cells[kept][each] for each in _pieces(grid, cells[kept]) if _fits(grid, cells[kept][each])]
    if len(poses) < 2 or not whole:
        return None
    cells = np.sort(np.concatenate(whole)).astype(np.int32)
    return Repetition(cells, float(grid.area[cells].sum()), tuple(poses), ahead, _band(grid, cells, ahead))


def _copies(
    grid: SurfaceGrid, cells: IntArray, ahead: FloatArray | None, motions: FloatArray
) -> list[tuple[FloatArray, BoolArray]]:
    """Poses (4, 4) at which the surface has much of a region, and which of its cells, bool (n,).

    Along a row all multiples of the motion ahead are tried as far as the model reaches, then what the motions make of
    each copy that is known.
    """
    items = items_in(grid, cells)
    sample = _sample(grid, items)
    corners = grid.points[sample[[0, len(sample) // 3, 2 * len(sample) // 3, -1]]]
    waiting = [np.eye(4), *_row(grid, corners, ahead)]
    tried = np.empty((0, corners.size))
    found: list[tuple[FloatArray, BoolArray]] = []
    place = 0
    while place < len(waiting):
        pose = waiting[place]
        place += 1
        at = transform_points(pose, corners).reshape(1, -1)
        if len(tried) and np.abs(tried - at).max(axis=1).min() < grid.cell_size:
            continue
        tried = np.concatenate([tried, at])
        if matched_items(grid, pose, sample).mean() <= ALIKE:
            continue
        same = _same_cells(grid, cells, items, pose)
        if grid.area[cells[same]].sum() <= ALIKE * grid.area[cells].sum():
            continue
        if len(tried) > 1:
            found.append((pose, same))
        if len(waiting) < COPIES:
            waiting += [each @ pose for each in motions]
    return found


def _row(grid: SurfaceGrid, points: FloatArray, ahead: FloatArray | None) -> Iterator[FloatArray]:
    """The multiples (4, 4) of a motion, and of its inverse, that keep points (n, 3) in the model's box."""
    low, high = grid.points.min(axis=0) - grid.cell_size, grid.points.max(axis=0) + grid.cell_size
    for step in () if ahead is None else (ahead, invert(ahead)):
        pose = step
        for _ in range(COPIES // 2):
            moved = transform_points(pose, points)
            if (moved < low).any() or (moved > high).any():
                break
            yield pose
            pose = step @ pose


def _overlaps(
    grid: SurfaceGrid, keys: np.ndarray, points: FloatArray, pose: FloatArray, poses: list[FloatArray]
) -> bool:
    """Whether points (n, 3) of a region at a pose lie in cells of it, with these keys, at one of `poses`."""
    return any(is_among(keys, keys_at(grid, invert(other) @ pose, points)).mean() > OVERLAP for other in poses)


def _same_cells(grid: SurfaceGrid, cells: IntArray, items: np.ndarray, pose: FloatArray) -> BoolArray:
    """Which of ascending `cells` with their `items` the surface has at a pose (4, 4), and nothing beside, bool (n,)."""
    same = np.ones(len(cells), dtype=bool)
    missed = items[~matched_items(grid, pose, items)]
    same[np.searchsorted(cells, grid.item_cell[missed])] = False
    back = invert(pose)
    there = items_moved_into(grid, cells, pose)
    more = there[~matched_items(grid, back, there)]
    same[np.searchsorted(grid.keys[cells], keys_at(grid, back, grid.points[more]))] = False
    return same


def _inside(grid: SurfaceGrid, cells: IntArray) -> IntArray:
    """Those of `cells` with all their neighbours, all of them where there are none such."""
    chosen = np.zeros(len(grid) + 1, dtype=bool)
    chosen[cells] = chosen[-1] = True  # the last is the neighbour that an empty cell is
    inside = cells[chosen[grid.neighbours[cells]].all(axis=1)]
    return inside if len(inside) else cells


def _pieces(grid: SurfaceGrid, cells: IntArray) -> list[np.ndarray]:
    """The connected regions of ascending `cells`, as places among them."""
    chosen = np.zeros(len(grid), dtype=bool)
    chosen[cells] = True
    return [np.searchsorted(cells, each) for each in connected_regions(grid, chosen)]


def _band(grid: SurfaceGrid, cells: IntArray, ahead: FloatArray | None) -> IntArray:
    """A region and, in a row, the cells beyond it that the copy ahead takes.

    None of those at the side of the row: there cells of the one lie across the border of the other.
    """
    if ahead is None:
        return cells
    row = np.zeros(len(grid) + 1, dtype=bool)
    row[cells] = row[-1] = True  # the last is the neighbour that an empty cell is
    for way in (ahead, invert(ahead)):
        row[grid.item_cell[items_moved_into(grid, cells, way)]] = True
    inner = cells[row[grid.neighbours[cells]].all(axis=1)]
    there = np.union1d(cells, grid.item_cell[items_moved_into(grid, inner, ahead)])
    band = cells
    for _ in range(BAND):
        band = np.intersect1d(np.r_[band, grid.neighbours[band].ravel()], there).astype(np.int32)
    return band
