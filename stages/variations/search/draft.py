"""The draft in a workspace: the variant that is being made, read as poses, assembly and lineage."""

from __future__ import annotations

from typing import Any

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.kit import Assembly
from stages.variations.kernels.structs import N_BOUNDARY, N_EDGES, N_PARTS, TRY_NUMBER, KitTables, Workspace
from stages.variations.kernels.variant_graph import place_boxes, set_edge
from stages.variations.search.parents import Parent


def draft_poses(ws: Workspace) -> FloatArray:
    """Return the poses of the parts, float64 (n, 4, 4)."""
    parts = ws.counts[N_PARTS]
    poses = np.tile(np.eye(4), (parts, 1, 1))
    poses[:, :3, :3] = ws.rotations[:parts]
    poses[:, :3, 3] = ws.translations[:parts]
    return poses


def draft_assembly(ws: Workspace, stretches: FloatArray | None) -> Assembly:
    """Return the draft as an assembly. stretches: float64 (n, 3, 3) of its parts, or None."""
    parts, count = int(ws.counts[N_PARTS]), int(ws.counts[N_EDGES])
    edges = np.sort(ws.edges[:count], axis=1)
    edges = edges[np.lexsort((edges[:, 1], edges[:, 0]))].astype(np.int32)
    return Assembly(ws.types[:parts].astype(np.int16), draft_poses(ws), edges, stretches)


def is_connected(ws: Workspace) -> bool:
    """Return whether the draft is in one piece."""
    near: list[list[int]] = [[] for _ in range(ws.counts[N_PARTS])]
    for i, j in ws.edges[: ws.counts[N_EDGES]].tolist():
        near[i].append(j)
        near[j].append(i)
    reached, waiting = {0}, [0]
    while waiting:
        new = [part for part in near[waiting.pop()] if part not in reached]
        reached.update(new)
        waiting += new
    return len(reached) == len(near)


def load_shape(ws: Workspace, shape: Parent) -> None:
    """Put a shape's graph into the workspace as if it were the draft."""
    assembly = shape.assembly
    ws.types[: len(assembly)] = assembly.types
    ws.edges[: len(assembly.edges)] = assembly.edges
    i, j = assembly.edges[:, 0], assembly.edges[:, 1]
    ws.label[i, j] = shape.labels[:, 0]
    ws.label[j, i] = shape.labels[:, 1]
    ws.counts[N_PARTS], ws.counts[N_EDGES] = len(assembly), len(assembly.edges)


def start_draft(ws: Workspace, tables: KitTables, assembly: Assembly, labels: IntArray) -> None:
    """Make an assembly the draft, with all of its contacts.

    labels: int32 (m, 2), directed docking labels of its edges
    """
    parts = len(assembly)
    ws.counts[TRY_NUMBER] += 1
    ws.counts[N_PARTS], ws.counts[N_EDGES] = parts, 0
    ws.types[:parts] = assembly.types
    ws.rotations[:parts], ws.translations[:parts] = assembly.poses[:, :3, :3], assembly.poses[:, :3, 3]
    ws.origin[:parts] = 2  # no contact between two shapes is left to be found
    for (i, j), (there, back) in zip(assembly.edges.tolist(), labels.tolist(), strict=True):
        set_edge(ws.stamp, ws.label, ws.edges, ws.counts, i, j, there, back)
    place_boxes(tables.boxes, ws.types, ws.rotations, ws.translations, parts, ws.boxes)


def draft_descent(ws: Workspace, method: str, a: Parent, b: Parent) -> tuple[np.ndarray, dict[str, Any]]:
    """Return the exemplar that each part came from, int8 (n,), and the lineage, where one piece of A was put into B."""
    from_b = int((ws.origin[: ws.counts[N_PARTS]] == 1).sum())
    lineage = {
        "method": method,
        "parents": [a.name, b.name],
        "parts_from": [int(ws.counts[N_PARTS]) - from_b, from_b],
        "boundary": ws.boundary[: ws.counts[N_BOUNDARY]].tolist(),
        "images": ws.images[: ws.counts[N_BOUNDARY]].tolist(),
        "transform": np.round(ws.transform, 9).tolist(),
        "repeats": 1,
        "deformed": False,
    }
    origins = np.empty(int(ws.counts[N_PARTS]), dtype=np.int8)
    for parent, part_of in ((b, ws.from_b), (a, ws.from_a)):
        parts = part_of[: len(parent.assembly)]
        origins[parts[parts >= 0]] = parent.origins[parts >= 0]
    return origins, lineage
