"""Inserting or removing a repeated unit: a shape docked into itself, shifted along a row."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.geometry.pose_kernels import apply_transform, looks_same, part_at
from stages.variations.exchange.cuts import connected, put_boundary
from stages.variations.kernels.outcomes import Outcome
from stages.variations.kernels.random_choice import random_below
from stages.variations.kernels.structs import N_PIECE_PARTS


@numba.njit(cache=True)
def insert_or_remove_unit(rng, kit, a, ws):
    """Cut A behind a part of a row and find the place of what is before it after a shift along the row.

    A row are parts of one type that look the same way, along an axis of one of them. The piece moves from one part of
    the row
    to the other: away from the rest of A, which inserts the parts between, or into it, which removes them. The boundary
        has images only where the whole cross-section repeats.
    """
    seed = random_below(rng, len(a.types))
    image = _another_of_its_row(rng, kit, a, seed, ws.stack)
    if image < 0:
        return Outcome.NO_MATCH
    ws.transform[:] = 0.0
    along = np.empty(3)
    for i in range(3):
        ws.transform[i, i] = 1.0
        along[i] = a.translations[image, i] - a.translations[seed, i]
        ws.transform[3, i] = along[i]
    if rng.random() < 0.5:
        along[:] = -along
    most = _dot(along, a.translations[seed]) + kit.limits[0] * _dot(along, along) ** 0.5
    for part in range(len(a.types)):
        ws.component[part] = 1 if _dot(along, a.translations[part]) <= most else 0
    ws.inside[: len(a.types)] = False
    size = connected(a.starts, a.ends, ws.component, ws.inside, ws.stack, seed)
    count = put_boundary(a, ws)
    ws.counts[N_PIECE_PARTS] = size
    if count == 0 or size == len(a.types):
        return Outcome.WHOLE
    point = np.empty(3)
    for k in range(count):
        part = ws.boundary[k]
        part_type = a.types[part]
        apply_transform(ws.transform, a.translations[part], point)
        low, high = a.type_starts[part_type], a.type_starts[part_type + 1]
        at = part_at(a.translations, a.by_type, low, high, point, kit.limits[0])
        if at < 0 or looks_same(kit, part_type, a.rotations[part], a.rotations[at]) < 0:
            return Outcome.NO_MATCH
        ws.images[k] = at
    return Outcome.OK


@numba.njit(cache=True)
def _another_of_its_row(rng, kit, a, seed, row):
    """Return a part of the type of `seed` that looks the same way and lies along one of its axes, or -1.

    row: scratch
    """
    part_type = a.types[seed]
    axis = random_below(rng, 3)
    count = 0
    for k in range(a.type_starts[part_type], a.type_starts[part_type + 1]):
        part = a.by_type[k]
        along, distance = 0.0, 0.0
        for i in range(3):
            gap = a.translations[part, i] - a.translations[seed, i]
            along += gap * a.rotations[seed, i, axis]
            distance += gap * gap
        if part == seed or distance - along * along > kit.limits[0] ** 2:
            continue
        if looks_same(kit, part_type, a.rotations[seed], a.rotations[part]) >= 0:
            row[count] = part
            count += 1
    return row[random_below(rng, count)] if count > 0 else -1


@numba.njit(cache=True)
def _dot(p, q):
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]
