"""Contacts where a shape was cut and bays were inserted or removed: those that stay, and those across the seams."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from stages.rows.layout import Layout, sorted_edges
from stages.rows.slabs import Slab, SlabError
from stages.shape.geometry.pose import relative_poses
from stages.shape.stretch import STRETCHED_DEPTH

CLASH = "parts of two bays clash"


def kept_contacts(slab: Slab, copied: np.ndarray, times: int) -> Iterator[tuple[int, int]]:
    """Yield the contacts that copies and other parts keep: the first copy those before it, the last those beyond it."""
    count = len(slab.layout)
    index_of = np.full(count, -1, dtype=np.int64)
    index_of[copied] = np.arange(len(copied))

    def copy(part: int, number: int) -> int:
        return part if number == 0 else count + (number - 1) * len(copied) + int(index_of[part])

    for i, j in slab.layout.edges.tolist():
        part, other = (i, j) if slab.within[i] else (j, i)
        if not slab.within[part] or slab.before[other]:
            yield part, other
        elif slab.within[other]:
            yield from ((copy(part, number), copy(other, number)) for number in range(times + 1))
        elif slab.beyond[other]:
            yield copy(part, times), other
        else:  # it spans the bay
            yield from ((copy(part, number), other) for number in range(times + 1))


def with_seams(made: Layout, number: np.ndarray, overlap: Callable[[int, int], float] = lambda _i, _j: 0.0) -> Layout:
    """Return a layout with the contacts between bays. Raises SlabError where parts of two bays clash.

    number: the bay of each part, 0 for the first, or -1 for parts of none, int64 (n,)
    overlap: how deep two parts may overlap, in units, where that is more than resized parts may
    """
    from stages.shape.geometry.contact import ContactTest, overlapping_boxes
    from stages.shape.geometry.penetration import PenetrationTest, depth_bound

    pairs = overlapping_boxes(made.boxes, made.tolerance)
    pairs = pairs[(number[pairs[:, 0]] != number[pairs[:, 1]]) & (number[pairs] >= 1).any(axis=1)]
    known = made.edges[:, 0].astype(np.int64) * len(made) + made.edges[:, 1]
    pairs = pairs[~np.isin(pairs[:, 0].astype(np.int64) * len(made) + pairs[:, 1], known)]
    contact, penetration = ContactTest(made.meshes, made.tolerance), PenetrationTest(made.meshes)
    seams: list[tuple[int, int]] = []
    for (i, j), pose in zip(pairs.tolist(), relative_poses(made.poses, pairs), strict=True):
        if not contact.touches(i, j, pose):
            continue
        allowed = made.tolerance + STRETCHED_DEPTH * min(made.meshes[i].diagonal, made.meshes[j].diagonal)
        if depth_bound(made.boxes[i], made.boxes[j]) > allowed:
            depth = penetration.depth(i, j, pose)
            if depth > allowed and depth > made.tolerance + overlap(i, j):
                raise SlabError(CLASH)
        seams.append((i, j))
    return replace(made, edges=sorted_edges([*map(tuple, made.edges.tolist()), *seams]))
