"""The paper's matching rule: boundary parts by type and pairwise centroid distance (strings §4)."""

from __future__ import annotations

import numpy as np

from stages.shape.geometry.pose import rigid_fit
from stages.variations.kernels.structs import BOUNDARY, UPRIGHT, KitTables, Outcome, ShapeTables, Workspace

STEPS = 2000
"""Partial matches looked at before a boundary counts as not matched."""


def match_centroids(rng: np.random.Generator, kit: KitTables, a: ShapeTables, b: ShapeTables, ws: Workspace) -> int:
    """Find parts of B with the types and the pairwise centroid distances of the boundary in `ws`.

    The first match in random order counts; its images go to `ws.images` and the docking motion, fitted to the
    centroids without reflection, to `ws.motion`. One boundary part, or several in a row, leave a rotation
    undecided that nothing but luck settles: this is the rule's known weakness. Mirrored matches are refused by the
    fit's residual.
    """
    count, tolerance = int(ws.counts[BOUNDARY]), kit.limits[0]
    boundary = ws.boundary[:count]
    centroids = a.translations[boundary]
    gaps = np.linalg.norm(centroids[:, None] - centroids[None], axis=2)
    candidates = [
        rng.permutation(b.by_type[b.type_starts[part_type] : b.type_starts[part_type + 1]])
        for part_type in a.types[boundary]
    ]
    images: list[int] = []
    tried = [0]
    steps = 0
    while True:
        level = len(images)
        advanced = False
        while tried[level] < len(candidates[level]):
            image = int(candidates[level][tried[level]])
            tried[level] += 1
            steps += 1
            if steps > STEPS:
                return Outcome.NO_MATCH
            distances = np.linalg.norm(b.translations[images] - b.translations[image], axis=1)
            if image not in images and np.all(np.abs(distances - gaps[level, :level]) <= tolerance):
                images.append(image)
                advanced = True
                break
        if not advanced:
            if not images:
                return Outcome.NO_MATCH
            images.pop()
            tried.pop()
        elif len(images) == count:
            break
        else:
            tried.append(0)
    motion = rigid_fit(centroids, b.translations[images])
    moved = centroids @ motion[:3, :3].T + motion[:3, 3]
    if np.linalg.norm(moved - b.translations[images], axis=1).max() > tolerance:
        return Outcome.NO_MATCH
    if kit.up >= 0 and motion[kit.up, kit.up] < UPRIGHT:
        return Outcome.NO_MATCH
    ws.images[:count] = images
    ws.motion[:3] = motion[:3, :3]
    ws.motion[3] = motion[:3, 3]
    return Outcome.OK
