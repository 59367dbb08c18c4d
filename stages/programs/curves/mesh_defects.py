"""Defects of a mesh, for tests and authors: open or shared edges, orientation, faces without area."""

from __future__ import annotations

import numpy as np

from stages.programs.curves.mesh import QuadMesh
from stages.programs.curves.vectors import cross, dots
from stages.shape.arrays import IntArray
from stages.shape.geometry.components import connected_components


def mesh_defects(mesh: QuadMesh) -> list[str]:
    """List the reasons why a mesh is not closed, oriented outwards and two-manifold; empty for a good mesh.

    Checks finite numbers, indices, unused vertices, faces without area, folded quads, open edges, edges of more than
    two faces, faces of opposite orientation, surfaces that touch in a vertex alone, and surfaces inside out. Does not
    check for intersections.
    """
    if not len(mesh.quads):
        return ["the mesh has no faces"]
    if not np.isfinite(mesh.vertices).all():
        return ["a vertex is not finite"]
    if mesh.quads.min() < 0 or mesh.quads.max() >= len(mesh.vertices):
        return [f"a face names a vertex outside 0 to {len(mesh.vertices) - 1}"]
    faces = mesh.triangles
    defects = []
    unused = len(mesh.vertices) - len(np.unique(faces))
    if unused:
        defects.append(f"{unused} vertices belong to no face")
    corners = mesh.vertices[faces]
    normals = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sides = corners - np.roll(corners, 1, axis=1)
    longest = (sides * sides).sum(axis=2).max(axis=1)
    thin = int((dots(normals, normals) <= 1e-18 * longest * longest).sum())
    if thin:
        defects.append(f"{thin} triangles have no area")
    folded = _folded(mesh)
    if folded:
        defects.append(f"{folded} quads are folded over themselves")
    starts, ends = faces.ravel().astype(np.int64), np.roll(faces, -1, axis=1).ravel().astype(np.int64)
    count = len(mesh.vertices)
    _, edge, uses = np.unique(
        np.minimum(starts, ends) * count + np.maximum(starts, ends), return_inverse=True, return_counts=True
    )
    net = np.bincount(edge, weights=np.where(starts < ends, 1.0, -1.0))
    for wrong, sentence in (
        (uses == 1, "edges are open"),
        (uses > 2, "edges belong to more than two faces"),
        ((uses == 2) & (net != 0.0), "edges lie between faces turned against each other"),
    ):
        if wrong.any():
            defects.append(f"{int(wrong.sum())} {sentence}")
    if (uses == 2).all() and not net.any():
        defects += _surface_defects(mesh, faces, edge)
    return defects


def _folded(mesh: QuadMesh) -> int:
    """The number of quads whose halves have opposite orientations, along either diagonal."""
    quads = mesh.quads[mesh.quads[:, 2] != mesh.quads[:, 3]]
    a, b, c, d = (mesh.vertices[quads[:, k]] for k in range(4))
    first = dots(cross(b - a, c - a), cross(c - a, d - a))
    other = dots(cross(b - a, d - a), cross(c - b, d - b))
    return int(((first < 0.0) & (other < 0.0)).sum())


def _surface_defects(mesh: QuadMesh, faces: IntArray, edge: np.ndarray) -> list[str]:
    """Vertices where surfaces only touch, and surfaces inside out, where every edge has two faces."""
    corner = np.arange(faces.size)
    pairs = np.argsort(edge, kind="stable").reshape(-1, 2)
    # Across an edge the start of one side is the end of the other.
    after = corner - corner % 3 + (corner + 1) % 3
    one = np.concatenate([pairs[:, 0], after[pairs[:, 0]]])
    two = np.concatenate([after[pairs[:, 1]], pairs[:, 1]])
    umbrellas = int(connected_components(faces.size, np.column_stack([one, two])).max(initial=-1)) + 1
    defects = []
    if umbrellas > len(mesh.vertices):
        defects.append(f"surfaces touch in a vertex alone at {umbrellas - len(mesh.vertices)} places")
    owner = connected_components(len(faces), pairs // 3)
    surfaces = int(owner.max(initial=-1)) + 1
    a, b, c = (mesh.vertices[faces[:, k]] - mesh.vertices.mean(axis=0) for k in range(3))
    volumes = np.bincount(owner, weights=dots(a, cross(b, c)), minlength=surfaces)
    if (volumes <= 0.0).any():
        defects.append(f"{int((volumes <= 0.0).sum())} of {surfaces} surfaces are inside out or enclose nothing")
    return defects
