"""Joining a piece with what its boundary leaves of another shape (strings §4)."""

from __future__ import annotations

import numba
import numpy as np

from stages.variations.exchange.matches import looks_same, move, turn_by
from stages.variations.kernels.layout import BOUNDARY, CHOICES, EDGES, PARTS, TRY, UNKNOWNS, Outcome
from stages.variations.kernels.lookup import random_below
from stages.variations.kernels.membership import admitted

__all__ = ["join", "place_boxes", "set_edge"]


@numba.njit(cache=True)
def set_edge(stamp, label, edges, counts, i, j, label_ij, label_ji):
    """Add an edge of the variant, or only its labels where it is there."""
    if stamp[i, j] != counts[TRY]:
        stamp[i, j] = counts[TRY]
        stamp[j, i] = counts[TRY]
        edges[counts[EDGES], 0] = i
        edges[counts[EDGES], 1] = j
        counts[EDGES] += 1
    label[i, j] = label_ij
    label[j, i] = label_ji


@numba.njit(cache=True)
def place_boxes(type_boxes, types, turns, places, count, boxes):
    """The axis-aligned boxes around the parts as centre and half extents."""
    for v in range(count):
        for i in range(3):
            centre, half = places[v, i], 0.0
            for j in range(3):
                centre += turns[v, i, j] * type_boxes[types[v], 0, j]
                half += abs(turns[v, i, j]) * type_boxes[types[v], 1, j]
            boxes[v, 0, i] = centre
            boxes[v, 1, i] = half


@numba.njit(cache=True)
def _choose_components(rng, kit, a, b, ws, components):
    """Choose which components of B without the boundary stay, in `ws.keep`: the first choice in random order with
    which the neighbourhoods of all boundary parts are in the grammar. False where there is none."""
    count = ws.counts[BOUNDARY]
    limit = kit.limits[0] ** 2
    place = np.empty(3)
    starts = np.zeros(count + 1, dtype=np.int64)
    for k in range(count):
        part, image = ws.boundary[k], ws.images[k]
        most = a.starts[part + 1] - a.starts[part] + b.starts[image + 1] - b.starts[image]
        starts[k + 1] = starts[k] + most
    # What each boundary part may have around it: types of neighbours, and the components that these come with.
    near = np.empty(starts[count], dtype=np.int64)
    owner = np.empty(starts[count], dtype=np.int64)
    held = np.empty(starts[count], dtype=np.int64)
    ends = starts[:count].copy()
    touched = np.zeros(components, dtype=np.bool_)
    for k in range(count):
        part, image = ws.boundary[k], ws.images[k]
        for f in range(a.starts[part], a.starts[part + 1]):
            if ws.inside[a.ends[f]]:
                near[ends[k]], owner[ends[k]] = a.types[a.ends[f]], -1
                ends[k] += 1
        for e in range(b.starts[image], b.starts[image + 1]):
            end = b.ends[e]
            if ws.image_of[end] >= 0:
                continue
            touched[ws.component[end]] = True
            brought = False
            for f in range(a.starts[part], a.starts[part + 1]):
                other = a.ends[f]
                if ws.inside[other] and a.types[other] == b.types[end]:
                    move(ws.motion, a.places[other], place)
                    gap = 0.0
                    for j in range(3):
                        d = place[j] - b.places[end, j]
                        gap += d * d
                    if gap <= limit:
                        brought = True
                        break
            if not brought:
                near[ends[k]], owner[ends[k]] = b.types[end], ws.component[end]
                ends[k] += 1
    free = np.flatnonzero(touched)
    choices = CHOICES if len(free) > 6 else (1 << len(free)) - 1
    offset = random_below(rng, choices) if choices > 0 else 0
    for step in range(choices):
        chosen = 1 + (offset + step) % choices
        for c in range(components):
            ws.keep[c] = False
        for c in range(len(free)):
            if len(free) > 6:
                ws.keep[free[c]] = rng.random() < 0.7
            else:
                ws.keep[free[c]] = (chosen >> c) & 1 == 1
        fits = True
        for k in range(count):
            neighbours = 0
            for n in range(starts[k], ends[k]):
                if owner[n] < 0 or ws.keep[owner[n]]:
                    held[neighbours] = near[n]
                    neighbours += 1
            if not admitted(kit, a.types[ws.boundary[k]], held, neighbours):
                fits = False
                break
        if fits:
            return True
    return False


@numba.njit(cache=True)
def join(rng, kit, a, b, ws, smallest, largest):
    """Put the piece of A, moved, in place of a part of B that its boundary cuts off.

    The boundary parts stand for their images. Of B without the images, components stay so that the neighbourhood of
    each boundary part is in the grammar; parts of them that coincide with parts of the piece are one with these.
    Fills the variant's parts and the edges it inherits.
    """
    na, nb = len(a.types), len(b.types)
    count = ws.counts[BOUNDARY]
    motion = ws.motion
    ws.counts[TRY] += 1
    ws.counts[EDGES] = 0
    ws.counts[UNKNOWNS] = 0
    ws.image_of[:nb] = -1
    for k in range(count):
        ws.image_of[ws.images[k]] = ws.boundary[k]
    ws.component[:nb] = -1
    components = 0
    for seed in range(nb):
        if ws.component[seed] >= 0 or ws.image_of[seed] >= 0:
            continue
        ws.component[seed] = components
        ws.stack[0] = seed
        depth = 1
        while depth > 0:
            depth -= 1
            part = ws.stack[depth]
            for e in range(b.starts[part], b.starts[part + 1]):
                end = b.ends[e]
                if ws.component[end] < 0 and ws.image_of[end] < 0:
                    ws.component[end] = components
                    ws.stack[depth] = end
                    depth += 1
        components += 1
    if not _choose_components(rng, kit, a, b, ws, components):
        return Outcome.GRAMMAR
    limit = kit.limits[0] ** 2
    size = 0
    for part in range(na):
        if ws.inside[part]:
            size += 1
    kept = 0
    for part in range(nb):
        if ws.component[part] >= 0 and ws.keep[ws.component[part]]:
            kept += 1
    if size + kept < smallest:
        return Outcome.TOO_SMALL
    if max(size, kept + count) > largest or size + kept > len(ws.types):
        return Outcome.TOO_LARGE
    v = 0
    ws.from_a[:na] = -1
    ws.from_b[:nb] = -1
    for part in range(na):
        if ws.inside[part]:
            ws.from_a[part] = v
            ws.types[v] = a.types[part]
            move(motion, a.places[part], ws.places[v])
            turn_by(motion, a.turns[part], ws.turns[v])
            ws.origin[v] = 0
            v += 1
    from_piece = v
    for k in range(count):
        ws.from_b[ws.images[k]] = ws.from_a[ws.boundary[k]]
        ws.origin[ws.from_a[ws.boundary[k]]] = 2
    for part in range(nb):
        if ws.component[part] < 0 or not ws.keep[ws.component[part]]:
            continue
        same = -1
        for k in range(a.type_starts[b.types[part]], a.type_starts[b.types[part] + 1]):
            u = ws.from_a[a.by_type[k]]
            if u >= 0:
                gap = 0.0
                for j in range(3):
                    d = ws.places[u, j] - b.places[part, j]
                    gap += d * d
                    if gap > limit:
                        break
                if gap <= limit:
                    same = u
                    break
        if same >= 0:
            if ws.origin[same] != 0 or looks_same(kit, ws.types[same], ws.turns[same], b.turns[part]) < 0:
                return Outcome.CLASH
            ws.origin[same] = 2
            ws.from_b[part] = same
            continue
        ws.from_b[part] = v
        ws.types[v] = b.types[part]
        for i in range(3):
            ws.places[v, i] = b.places[part, i]
            for j in range(3):
                ws.turns[v, i, j] = b.turns[part, i, j]
        ws.origin[v] = 1
        v += 1
    ws.counts[PARTS] = v
    if v < smallest:
        return Outcome.TOO_SMALL
    if v > largest:
        return Outcome.TOO_LARGE
    if v == from_piece:
        return Outcome.NOTHING_ATTACHED
    for side in range(2):
        shape = a if side == 0 else b
        index = ws.from_a if side == 0 else ws.from_b
        for part in range(len(shape.types)):
            i = index[part]
            if i < 0:
                continue
            for e in range(shape.starts[part], shape.starts[part + 1]):
                end = shape.ends[e]
                j = index[end]
                if j >= 0 and part < end:
                    back = -1
                    for f in range(shape.starts[end], shape.starts[end + 1]):
                        if shape.ends[f] == part:
                            back = shape.labels[f]
                            break
                    set_edge(ws.stamp, ws.label, ws.edges, ws.counts, i, j, shape.labels[e], back)
    place_boxes(kit.boxes, ws.types, ws.turns, ws.places, v, ws.boxes)
    return Outcome.OK
