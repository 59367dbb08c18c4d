"""Corners of feature lines of a scan: where three of its patches meet (symmetry §4.1)."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from stages.grammars.scans.scanned_grid import ScannedGrid
from stages.shape.arrays import BoolArray, FloatArray
from stages.symmetry.matching.cell_lookup import is_among
from stages.symmetry.surface.corner_frames import CREASE, CornerFrames, frames_of_lines
from stages.symmetry.surface.lattice import cell_keys

MOST_PATCHES = 6
"""Where more patches meet there is no corner but clutter."""
FLATTEST = 0.15
"""Three planes make a corner if the volume that their normals span is larger."""
NEAR = 1.8
"""Cells from the middle of a cell up to which a corner is looked for."""
ALONG = 2.5
"""So many cells from a corner both patches of a line must be beside it."""
PARALLEL = 0.04
"""Radians between patches that are taken for parallel."""
DECIMALS = 1


def ridge_frames(scan: ScannedGrid) -> CornerFrames:
    """The frames in corners where three patches meet, along the lines in which two of them do.

    Planes are fitted to all points of a patch, so that corners are much more exact than points are. Of patches that are
    nearly parallel all have the direction of the largest: motions between them do not turn.
    """
    grid, normals = scan.grid, _aligned(scan)
    patches, corners = _meetings(scan)
    if not len(patches):
        nothing = np.empty(0)
        return CornerFrames(nothing.reshape(0, 4, 4), nothing.reshape(0, 4), nothing.reshape(0, 2))
    occupied = _by_patch(scan)
    corner, ways, turns, outwards, lengths = [], [], [], [], []
    for one, other in combinations(range(3), 2):
        first, second = patches[:, one], patches[:, other]
        way = np.cross(normals[first], normals[second])
        way /= np.linalg.norm(way, axis=1)[:, None]
        sides = [
            _beside(scan, occupied, corners + turn * ALONG * grid.cell_size * way, first)
            & _beside(scan, occupied, corners + turn * ALONG * grid.cell_size * way, second)
            for turn in (1, -1)
        ]
        turn = np.arccos(np.clip((normals[first] * normals[second]).sum(axis=1), -1, 1))
        chosen = np.flatnonzero((sides[0] != sides[1]) & (turn > CREASE) & (turn < np.pi - CREASE))
        way = np.where(sides[0][:, None], way, -way)[chosen]
        corner.append(chosen)
        ways.append(way)
        lengths.append(_lengths(patches, corners, chosen, way, first[chosen], second[chosen], grid.radius))
        turns.append(turn[chosen])
        outwards.append((normals[first] + normals[second])[chosen])
    number = np.concatenate(corner)
    order = np.argsort(number, kind="stable")
    number = number[order]
    return frames_of_lines(
        number,
        corners[number],
        np.concatenate(ways)[order],
        np.concatenate(lengths)[order],
        np.concatenate(turns)[order],
        np.concatenate(outwards)[order],
        DECIMALS,
    )


def _lengths(
    patches: np.ndarray,
    corners: FloatArray,
    chosen: np.ndarray,
    ways: FloatArray,
    first: np.ndarray,
    second: np.ndarray,
    unknown: float,
) -> FloatArray:
    """How far from each of the `chosen` corners the next is along a line in which two patches meet, float64 (k,), or
    `unknown`."""
    total = int(patches.max()) + 1
    low, high = np.minimum(first, second), np.maximum(first, second)
    edges = [np.sort(patches[:, pair], axis=1) @ [total, 1] for pair in ([0, 1], [0, 2], [1, 2])]
    ends: dict[int, list[int]] = {}
    for edge in edges:
        for place, key in enumerate(edge.tolist()):
            ends.setdefault(key, []).append(place)
    found = np.full(len(chosen), unknown)
    for number, key in enumerate((low * total + high).tolist()):
        along = (corners[ends[key]] - corners[chosen[number]]) @ ways[number]
        found[number] = min(along[along > 0], default=unknown)
    return found


def _aligned(scan: ScannedGrid) -> FloatArray:
    """The normals of the patches, float64 (m, 3); those of nearly parallel ones along that of the largest of them."""
    weights = np.bincount(scan.item_patch, minlength=len(scan.normals)).astype(float)
    found, left = scan.normals.copy(), np.ones(len(scan.normals), dtype=bool)
    for patch in np.argsort(-weights, kind="stable").tolist():
        if not left[patch]:
            continue
        cosine = scan.normals @ scan.normals[patch]
        same = left & (np.abs(cosine) > np.cos(PARALLEL))
        signs = np.sign(cosine[same])
        way = (scan.normals[same] * (signs * weights[same])[:, None]).sum(axis=0)
        found[same] = signs[:, None] * way / np.linalg.norm(way)
        left &= ~same
    return found


def _meetings(scan: ScannedGrid) -> tuple[np.ndarray, FloatArray]:
    """Triples of patches that meet, int64 (c, 3), and the corners in which they do, float64 (c, 3)."""
    grid = scan.grid
    here = np.arange(len(grid))[:, None]
    around = np.column_stack([here, np.where(grid.neighbours >= 0, grid.neighbours, here)])
    lowest, highest = (each.reduceat(scan.item_patch, grid.starts[:-1]) for each in (np.minimum, np.maximum))
    busy = np.flatnonzero(lowest[around].min(axis=1) != highest[around].max(axis=1))
    counts = np.diff(grid.starts)
    cell, there = np.repeat(busy, around.shape[1]), around[busy].reshape(-1)
    items = np.repeat(grid.starts[there], counts[there]) + _running(counts[there])
    pairs = np.unique(np.column_stack([np.repeat(cell, counts[there]), scan.item_patch[items]]), axis=0)
    first = np.flatnonzero(np.r_[True, np.diff(pairs[:, 0]) > 0])
    count = np.diff(np.r_[first, len(pairs)])
    triples, cells = [], []
    for size in range(3, MOST_PATCHES + 1):
        begin = first[count == size]
        for chosen in combinations(range(size), 3):
            triples.append(np.column_stack([pairs[begin + each, 1] for each in chosen]))
            cells.append(pairs[begin, 0])
    triple, home = np.concatenate(triples), np.concatenate(cells)
    normals = scan.normals[triple]
    volume = np.abs(np.linalg.det(normals))
    triple, home, normals = triple[volume > FLATTEST], home[volume > FLATTEST], normals[volume > FLATTEST]
    offsets = (normals * scan.middles[triple]).sum(axis=2)
    corners = np.linalg.solve(normals, offsets[:, :, None])[:, :, 0]
    middle = grid.origin + (grid.cells[home] + 0.5) * grid.cell_size
    close = (np.abs(corners - middle) < NEAR * grid.cell_size).all(axis=1)
    found = np.unique(triple[close], axis=0, return_index=True)[1]
    return triple[close][found], corners[close][found]


def _running(counts: np.ndarray) -> np.ndarray:
    """0, 1, ... up to each of some counts, one after another."""
    found: np.ndarray = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return found


def _by_patch(scan: ScannedGrid) -> np.ndarray:
    """Cells with each of their patches as one number, ascending."""
    return np.sort(scan.grid.item_cell.astype(np.int64) * len(scan.normals) + scan.item_patch)


def _beside(scan: ScannedGrid, occupied: np.ndarray, points: FloatArray, patches: np.ndarray) -> BoolArray:
    """Whether each point (c, 3) is in a cell with a patch, int (c,), or beside one, bool (c,)."""
    grid = scan.grid
    cells = np.floor((points - grid.origin) / grid.cell_size).astype(np.int64)
    found = np.zeros(len(points), dtype=bool)
    for shift in np.ndindex(3, 3, 3):
        keys = cell_keys(cells + np.array(shift) - 1)
        place = np.minimum(np.searchsorted(grid.keys, keys), len(grid) - 1)
        found |= (grid.keys[place] == keys) & is_among(occupied, place * len(scan.normals) + patches)
    return found
