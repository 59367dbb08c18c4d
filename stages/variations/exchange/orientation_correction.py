"""Local correction of parts that are at the right place but oriented wrongly (strings §7)."""

from __future__ import annotations

import numpy as np

from stages.shape.geometry.docking import DockingTable
from stages.shape.geometry.pose import invert
from stages.variations.kernels.structs import N_EDGES, N_PARTS, Workspace


def correct_orientations(dockings: DockingTable, ws: Workspace) -> bool:
    """Turn parts of the variant in `ws` so that each of its edges is an observed docking; return False where that
    fails.

    A part is wrong if its pose relative to a neighbour was not observed. The poses that its neighbours' observed
    dockings would give it at its place are tried in turn until one suits all neighbours. Labels of the edges are set.
    """
    parts, count = int(ws.counts[N_PARTS]), int(ws.counts[N_EDGES])
    edges = ws.edges[:count].astype(np.int32)
    types = ws.types[:parts]
    poses = np.tile(np.eye(4), (parts, 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = ws.rotations[:parts], ws.translations[:parts]
    labels = dockings.label_edges(types, poses, edges)
    wrong = np.unique(edges[(labels < 0).any(axis=1)])
    # The parts with most wrong edges are the likeliest culprits.
    faults = np.bincount(edges[(labels < 0).any(axis=1)].ravel(), minlength=parts)
    for part in sorted(wrong.tolist(), key=lambda culprit: (-faults[culprit], culprit)):
        around = [int(j if i == part else i) for i, j in edges.tolist() if part in (i, j)]
        for pose in _proposals(dockings, types, poses, part, around):
            relative = invert(poses[around]) @ pose
            if all(
                dockings.label(int(types[near]), int(types[part]), seen[None])[0] >= 0
                for near, seen in zip(around, relative, strict=True)
            ):
                poses[part] = pose
                ws.rotations[part], ws.translations[part] = pose[:3, :3], pose[:3, 3]
                break
    labels = dockings.label_edges(types, poses, edges)
    if (labels < 0).any():
        return False
    ws.label[edges[:, 0], edges[:, 1]] = labels[:, 0]
    ws.label[edges[:, 1], edges[:, 0]] = labels[:, 1]
    return True


def _proposals(
    dockings: DockingTable, types: np.ndarray, poses: np.ndarray, part: int, around: list[int]
) -> list[np.ndarray]:
    """Return the poses that one neighbour's observed dockings give `part`, within tolerance of its place."""
    proposals = []
    for near in around:
        pair = (int(types[near]), int(types[part]))
        if pair in dockings.images:
            candidates = poses[near] @ dockings.images[pair][0]
            gaps = np.linalg.norm(candidates[:, :3, 3] - poses[part, :3, 3], axis=1)
            proposals.extend(candidates[gaps <= dockings.tolerance])
    return proposals
