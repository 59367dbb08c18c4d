"""The paper's matching rule: boundary parts by type and pairwise centroid distance (strings §4)."""

from __future__ import annotations

import numpy as np

from stages.shape.geometry.pose import rigid_fit
from stages.variations.kernels.outcomes import Outcome
from stages.variations.kernels.structs import MIN_UPRIGHT_COSINE, N_BOUNDARY, KitTables, ShapeTables, Workspace

MAX_STEPS = 2000
"""Partial matches after which a boundary counts as not matched."""


def match_centroids(rng: np.random.Generator, kit: KitTables, a: ShapeTables, b: ShapeTables, ws: Workspace) -> int:
    """Find parts of B with the types and the pairwise centroid distances of the boundary in `ws`.

    The first match in random order counts. Its images go to `ws.images`; the docking transform, fitted to the centroids
    without reflection, goes to `ws.transform`. One boundary part, or several in a row, leave a rotation undecided: the
    known weakness of this rule. The fit's residual rejects mirrored matches.
    """
    count, tolerance = int(ws.counts[N_BOUNDARY]), kit.limits[0]
    boundary = ws.boundary[:count]
    centroids = a.translations[boundary]
    gaps = np.linalg.norm(centroids[:, None] - centroids[None], axis=2)
    candidates = [
        rng.permutation(b.by_type[b.type_starts[part_type] : b.type_starts[part_type + 1]])
        for part_type in a.types[boundary]
    ]
    images: list[int] = []
    next_candidate = [0]
    steps = 0
    while True:
        level = len(images)
        advanced = False
        while next_candidate[level] < len(candidates[level]):
            image = int(candidates[level][next_candidate[level]])
            next_candidate[level] += 1
            steps += 1
            if steps > MAX_STEPS:
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
            next_candidate.pop()
        elif len(images) == count:
            break
        else:
            next_candidate.append(0)
    transform = rigid_fit(centroids, b.translations[images])
    moved = centroids @ transform[:3, :3].T + transform[:3, 3]
    if np.linalg.norm(moved - b.translations[images], axis=1).max() > tolerance:
        return Outcome.NO_MATCH
    if kit.up >= 0 and transform[kit.up, kit.up] < MIN_UPRIGHT_COSINE:
        return Outcome.NO_MATCH
    ws.images[:count] = images
    ws.transform[:3] = transform[:3, :3]
    ws.transform[3] = transform[:3, 3]
    return Outcome.OK
