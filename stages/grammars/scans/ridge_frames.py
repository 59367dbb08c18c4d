"""Corners of feature lines of a scan, where three of its patches meet (symmetry §4.1)."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from stages.grammars.scans.scanned_grid import ScannedGrid
from stages.shape.arrays import BoolArray, FloatArray
from stages.symmetry.matching.cell_lookup import is_among
from stages.symmetry.surface.corner_frames import MIN_CREASE_RADIANS, CornerFrames, FeatureLines, frames_of_lines
from stages.symmetry.surface.lattice import cell_keys

MAX_PATCHES_PER_CORNER = 6
"""Where more patches meet there is no corner but clutter."""
MIN_CORNER_VOLUME = 0.15
"""Three planes make a corner if their normals span a larger volume."""
MAX_CORNER_CELLS = 1.8
"""Largest distance of a corner from the centre of a cell, in cells and per axis."""
LINE_PROBE_CELLS = 2.5
"""Distance from a corner, in cells, at which both patches of a line must be present."""
PARALLEL_RADIANS = 0.04
"""Patches at a smaller angle are taken for parallel."""
KIND_DECIMALS = 1
"""Decimals to which kinds of frames on scans are compared."""


def ridge_frames(scan: ScannedGrid) -> CornerFrames:
    """Find the frames in corners where three patches meet, along the lines in which two of them do.

    Planes are fitted through every point of a patch, so corners are much more exact than points. Nearly parallel
    patches get the direction of the largest, so that transforms between them do not turn.
    """
    grid, normals = scan.grid, _aligned(scan)
    patches, corners = _meetings(scan)
    if not len(patches):
        nothing = np.empty(0)
        return CornerFrames(nothing.reshape(0, 4, 4), nothing.reshape(0, 4), nothing.reshape(0, 2))
    occupied = _cells_with_patches(scan)
    corner, ways, turns, outwards, lengths = [], [], [], [], []
    for one, other in combinations(range(3), 2):
        first, second = patches[:, one], patches[:, other]
        way = np.cross(normals[first], normals[second])
        way /= np.linalg.norm(way, axis=1)[:, None]
        sides = [
            _near_patch(scan, occupied, corners + sign * LINE_PROBE_CELLS * grid.cell_size * way, first)
            & _near_patch(scan, occupied, corners + sign * LINE_PROBE_CELLS * grid.cell_size * way, second)
            for sign in (1, -1)
        ]
        turn = np.arccos(np.clip((normals[first] * normals[second]).sum(axis=1), -1, 1))
        bent = (turn > MIN_CREASE_RADIANS) & (turn < np.pi - MIN_CREASE_RADIANS)
        chosen = np.flatnonzero((sides[0] != sides[1]) & bent)
        way = np.where(sides[0][:, None], way, -way)[chosen]
        corner.append(chosen)
        ways.append(way)
        lengths.append(_lengths(patches, corners, chosen, way, first[chosen], second[chosen], grid.radius))
        turns.append(turn[chosen])
        outwards.append((normals[first] + normals[second])[chosen])
    number = np.concatenate(corner)
    lines = FeatureLines(
        number,
        corners[number],
        np.concatenate(ways),
        np.concatenate(lengths),
        np.concatenate(turns),
        np.concatenate(outwards),
    )
    return frames_of_lines(lines.select(np.argsort(number, kind="stable")), KIND_DECIMALS)


def _lengths(
    patches: np.ndarray,
    corners: FloatArray,
    chosen: np.ndarray,
    ways: FloatArray,
    first: np.ndarray,
    second: np.ndarray,
    unknown: float,
) -> FloatArray:
    """Return the distance from each of the `chosen` corners to the next along its line, float64 (k,), or `unknown`.

    patches: int64 (c, 3), of the corners
    ways: float64 (k, 3), unit directions of the lines
    first, second: int64 (k,), the two patches that meet in each line
    """
    total = int(patches.max()) + 1
    low, high = np.minimum(first, second), np.maximum(first, second)
    edges = [np.sort(patches[:, pair], axis=1) @ [total, 1] for pair in ([0, 1], [0, 2], [1, 2])]
    ends: dict[int, list[int]] = {}
    for edge in edges:
        for corner, key in enumerate(edge.tolist()):
            ends.setdefault(key, []).append(corner)
    lengths = np.full(len(chosen), unknown)
    for number, key in enumerate((low * total + high).tolist()):
        along = (corners[ends[key]] - corners[chosen[number]]) @ ways[number]
        lengths[number] = min(along[along > 0], default=unknown)
    return lengths


def _aligned(scan: ScannedGrid) -> FloatArray:
    """Return the normals of the patches, float64 (m, 3); nearly parallel ones get the direction of the largest."""
    weights = np.bincount(scan.item_patch, minlength=len(scan.normals)).astype(float)
    aligned, left = scan.normals.copy(), np.ones(len(scan.normals), dtype=bool)
    for patch in np.argsort(-weights, kind="stable").tolist():
        if not left[patch]:
            continue
        cosine = scan.normals @ scan.normals[patch]
        same = left & (np.abs(cosine) > np.cos(PARALLEL_RADIANS))
        signs = np.sign(cosine[same])
        direction = (scan.normals[same] * (signs * weights[same])[:, None]).sum(axis=0)
        aligned[same] = signs[:, None] * direction / np.linalg.norm(direction)
        left &= ~same
    return aligned


def _meetings(scan: ScannedGrid) -> tuple[np.ndarray, FloatArray]:
    """Return triples of patches that meet, int64 (c, 3), and the corners in which they do, float64 (c, 3)."""
    grid = scan.grid
    own = np.arange(len(grid))[:, None]
    around = np.column_stack([own, np.where(grid.neighbours >= 0, grid.neighbours, own)])
    lowest, highest = (reduce.reduceat(scan.item_patch, grid.starts[:-1]) for reduce in (np.minimum, np.maximum))
    busy = np.flatnonzero(lowest[around].min(axis=1) != highest[around].max(axis=1))
    counts = np.diff(grid.starts)
    cell, near = np.repeat(busy, around.shape[1]), around[busy].reshape(-1)
    items = np.repeat(grid.starts[near], counts[near]) + _ranges(counts[near])
    pairs = np.unique(np.column_stack([np.repeat(cell, counts[near]), scan.item_patch[items]]), axis=0)
    first = np.flatnonzero(np.r_[True, np.diff(pairs[:, 0]) > 0])
    count = np.diff(np.r_[first, len(pairs)])
    triples, cells = [], []
    for size in range(3, MAX_PATCHES_PER_CORNER + 1):
        begin = first[count == size]
        for chosen in combinations(range(size), 3):
            triples.append(np.column_stack([pairs[begin + offset, 1] for offset in chosen]))
            cells.append(pairs[begin, 0])
    triple, home = np.concatenate(triples), np.concatenate(cells)
    normals = scan.normals[triple]
    volume = np.abs(np.linalg.det(normals))
    sharp = volume > MIN_CORNER_VOLUME
    triple, home, normals = triple[sharp], home[sharp], normals[sharp]
    offsets = (normals * scan.middles[triple]).sum(axis=2)
    corners = np.linalg.solve(normals, offsets[:, :, None])[:, :, 0]
    close = (np.abs(corners - grid.centres(home)) < MAX_CORNER_CELLS * grid.cell_size).all(axis=1)
    distinct = np.unique(triple[close], axis=0, return_index=True)[1]
    return triple[close][distinct], corners[close][distinct]


def _ranges(counts: np.ndarray) -> np.ndarray:
    """Return 0, 1, ... for each count, one range after another."""
    ranges: np.ndarray = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return ranges


def _cells_with_patches(scan: ScannedGrid) -> np.ndarray:
    """Return all pairs of a cell and one of its patches as one number each, ascending."""
    return np.sort(scan.grid.item_cell.astype(np.int64) * len(scan.normals) + scan.item_patch)


def _near_patch(scan: ScannedGrid, occupied: np.ndarray, points: FloatArray, patches: np.ndarray) -> BoolArray:
    """Return whether each point (c, 3) is in a cell with its patch, int (c,), or next to one, bool (c,)."""
    grid = scan.grid
    cells = np.floor((points - grid.origin) / grid.cell_size).astype(np.int64)
    near = np.zeros(len(points), dtype=bool)
    for shift in np.ndindex(3, 3, 3):
        keys = cell_keys(cells + np.array(shift) - 1)
        index = np.minimum(np.searchsorted(grid.keys, keys), len(grid) - 1)
        near |= (grid.keys[index] == keys) & is_among(occupied, index * len(scan.normals) + patches)
    return near
