"""Choice of what stays of the shape that a piece is docked into (strings §4).

B without the images of the boundary falls into components. Those stay with which every boundary part has a
neighbourhood that the grammar admits.
"""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.geometry.pose_kernels import apply_transform, squared_distance
from stages.variations.kernels.membership import admitted
from stages.variations.kernels.random_choice import random_below
from stages.variations.kernels.structs import MAX_COMPONENT_CHOICES, N_BOUNDARY

MAX_COMPONENTS_ENUMERATED = 6
"""For this many components next to the boundary every choice is tried; for more, random ones."""
KEEP_PROBABILITY = 0.7
"""Probability that a component stays in a random choice."""


@numba.njit(cache=True)
def find_components(starts, ends, image_of, component, stack):
    """Number the components of B without the images of the boundary in `component`, -1 for an image; return their
    number.

    Images are parts whose `image_of` is not -1; `stack` is scratch.
    """
    n = len(starts) - 1
    component[:n] = -1
    components = 0
    for seed in range(n):
        if component[seed] >= 0 or image_of[seed] >= 0:
            continue
        component[seed] = components
        stack[0] = seed
        depth = 1
        while depth > 0:
            depth -= 1
            part = stack[depth]
            for e in range(starts[part], starts[part + 1]):
                end = ends[e]
                if component[end] < 0 and image_of[end] < 0:
                    component[end] = components
                    stack[depth] = end
                    depth += 1
        components += 1
    return components


@numba.njit(cache=True)
def choose_components(rng, kit, a, b, ws, components):
    """Choose which components stay, in `ws.keep`; return False where no choice is admitted.

    The first choice in random order is taken with which the neighbourhoods of all boundary parts are in the grammar.
    """
    count = ws.counts[N_BOUNDARY]
    firsts, lasts, near, owner, touched = _possible_neighbours(kit.limits[0], a, b, ws, components)
    free = np.flatnonzero(touched)
    around = np.empty(len(near), dtype=np.int64)
    choices = MAX_COMPONENT_CHOICES if len(free) > MAX_COMPONENTS_ENUMERATED else (1 << len(free)) - 1
    offset = random_below(rng, choices) if choices > 0 else 0
    ws.keep[:components] = False
    for step in range(choices):
        chosen = 1 + (offset + step) % choices
        for c in range(len(free)):
            ws.keep[free[c]] = (
                rng.random() < KEEP_PROBABILITY if len(free) > MAX_COMPONENTS_ENUMERATED else (chosen >> c) & 1 == 1
            )
        fits = True
        for k in range(count):
            neighbours = 0
            for n in range(firsts[k], lasts[k]):
                if owner[n] < 0 or ws.keep[owner[n]]:
                    around[neighbours] = near[n]
                    neighbours += 1
            if not admitted(kit, a.types[ws.boundary[k]], around, neighbours):
                fits = False
                break
        if fits:
            return True
    return False


@numba.njit(cache=True)
def _possible_neighbours(tolerance, a, b, ws, components):
    """Return what each boundary part may have around it: `(firsts, lasts, near, owner, touched)`.

    The k-th may have neighbours of the types near[firsts[k]:lasts[k]], each if the component `owner` stays, always
    where that is -1; all int64.
    touched: bool (components,), whether a component is next to a boundary part
    """
    count = ws.counts[N_BOUNDARY]
    firsts = np.zeros(count + 1, dtype=np.int64)
    for k in range(count):
        part, image = ws.boundary[k], ws.images[k]
        firsts[k + 1] = firsts[k] + a.starts[part + 1] - a.starts[part] + b.starts[image + 1] - b.starts[image]
    lasts = firsts[:count].copy()
    near = np.empty(firsts[count], dtype=np.int64)
    owner = np.empty(firsts[count], dtype=np.int64)
    touched = np.zeros(components, dtype=np.bool_)
    point = np.empty(3)
    for k in range(count):
        part, image = ws.boundary[k], ws.images[k]
        for e in range(a.starts[part], a.starts[part + 1]):
            if ws.inside[a.ends[e]]:
                near[lasts[k]], owner[lasts[k]] = a.types[a.ends[e]], -1
                lasts[k] += 1
        for e in range(b.starts[image], b.starts[image + 1]):
            end = b.ends[e]
            if ws.image_of[end] >= 0:
                continue
            touched[ws.component[end]] = True
            # The piece may bring this neighbour to the same place.
            brought = False
            for f in range(a.starts[part], a.starts[part + 1]):
                other = a.ends[f]
                if ws.inside[other] and a.types[other] == b.types[end]:
                    apply_transform(ws.transform, a.translations[other], point)
                    if squared_distance(point, b.translations[end]) <= tolerance**2:
                        brought = True
                        break
            if not brought:
                near[lasts[k]], owner[lasts[k]] = b.types[end], ws.component[end]
                lasts[k] += 1
    return firsts, lasts, near, owner, touched
