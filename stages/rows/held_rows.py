"""Rows that a few large parts hold: drawers in a cabinet, windows in a wall, rungs between two posts."""

from __future__ import annotations

import numpy as np

from stages.rows.layout import Layout, LengthenedMesh
from stages.rows.rows import find_rows
from stages.rows.slabs import SlabError, repeat

MIN_HELD_SHARE = 0.5
"""Share of the parts that become longer with a row, or touch one that does, from which these parts hold the shape."""


def is_held_together(layout: Layout) -> bool:
    """Return whether parts that become longer with a row hold most of the layout.

    An exchange of pieces leaves such parts as they are, so what it finds are the same rows in the same frame, or pieces
    that stick out of it.
    """
    for row in find_rows(layout):
        if not len(row.insertions):
            continue
        try:
            longer = repeat(layout, row.insertion(0, 1))
        except SlabError:
            continue
        is_longer = np.array([isinstance(mesh, LengthenedMesh) for mesh in longer.meshes])
        touching = np.zeros(len(longer), dtype=bool)
        touching[longer.edges[is_longer[longer.edges].any(axis=1)]] = True
        if is_longer.any() and (touching | is_longer).mean() >= MIN_HELD_SHARE:
            return True
    return False
