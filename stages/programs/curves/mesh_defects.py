"""Defects of a mesh, for tests and authors: open or shared edges, orientation, faces without area."""

from __future__ import annotations

import numpy as np

from stages.programs.curves.mesh import QuadMesh
from stages.programs.curves.vectors import cross, dots
from stages.shape.arrays import IntArray


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
    unused = int((np.bincount(faces.ravel(), minlength=len(mesh.vertices)) == 0).sum())
    if unused:
        defects.append(f"{unused} vertices belong to no face")
    a, b, c = (mesh.vertices[faces[:, k]] for k in range(3))
    normals = cross(b - a, c - a)
    longest = np.maximum(np.maximum(dots(b - a, b - a), dots(c - b, c - b)), dots(a - c, a - c))
    thin = int((dots(normals, normals) <= 1e-18 * longest * longest).sum())
    if thin:
        defects.append(f"{thin} triangles have no area")
    folded = _folded(mesh)
    if folded:
        defects.append(f"{folded} quads are folded over themselves")
    starts, ends = faces.ravel().astype(np.int64), np.roll(faces, -1, axis=1).ravel().astype(np.int64)
    edges = np.minimum(starts, ends) * len(mesh.vertices) + np.maximum(starts, ends)
    order = np.argsort(edges)
    first = np.flatnonzero(np.r_[True, np.diff(edges[order]) > 0])
    uses = np.diff(np.r_[first, len(edges)])
    net = np.add.reduceat(np.where(starts < ends, 1, -1)[order], first)
    for wrong, sentence in (
        (uses == 1, "edges are open"),
        (uses > 2, "edges belong to more than two faces"),
        ((uses == 2) & (net != 0), "edges lie between faces turned against each other"),
    ):
        if wrong.any():
            defects.append(f"{int(wrong.sum())} {sentence}")
    if (uses == 2).all() and not net.any():
        defects += _surface_defects(mesh, faces, order.reshape(-1, 2))
    return defects


def _folded(mesh: QuadMesh) -> int:
    """The number of quads whose halves have opposite orientations, along either diagonal."""
    quads = mesh.quads[mesh.quads[:, 2] != mesh.quads[:, 3]]
    a, b, c, d = (mesh.vertices[quads[:, k]] for k in range(4))
    first = dots(cross(b - a, c - a), cross(c - a, d - a))
    other = dots(cross(b - a, d - a), cross(c - b, d - b))
    return int(((first < 0.0) & (other < 0.0)).sum())


def _surface_defects(mesh: QuadMesh, faces: IntArray, pairs: np.ndarray) -> list[str]:
    """Vertices where surfaces only touch, and surfaces inside out, where every edge has two faces.

    pairs: int (m, 2), the corners at the starts of the two sides of an edge
    """
    opposite = np.empty(faces.size, dtype=np.int64)
    opposite[pairs], corner = pairs[:, ::-1], np.arange(faces.size)
    # Across an edge the start of one side is the end of the other.
    around = (corner - corner % 3 + (corner + 1) % 3)[opposite]
    umbrellas = _components(around[:, None])[0]
    defects = []
    if umbrellas > len(mesh.vertices):
        defects.append(f"surfaces touch in a vertex alone at {umbrellas - len(mesh.vertices)} places")
    surfaces, owner = _components(opposite.reshape(-1, 3) // 3)
    a, b, c = (mesh.vertices[faces[:, k]] - mesh.vertices.mean(axis=0) for k in range(3))
    volumes = np.bincount(owner, weights=dots(a, cross(b, c)), minlength=surfaces)
    if (volumes <= 0.0).any():
        defects.append(f"{int((volumes <= 0.0).sum())} of {surfaces} surfaces are inside out or enclose nothing")
    return defects


def _components(neighbours: np.ndarray) -> tuple[int, np.ndarray]:
    """Return the number of components of a graph, and the component of each node; as many edges lead in as out.

    neighbours: int (n, k), the nodes to which each has an edge
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    count, degree = neighbours.shape
    starts = np.arange(0, neighbours.size + 1, degree)
    graph = csr_array((np.ones(neighbours.size, dtype=bool), neighbours.ravel(), starts), shape=(count, count))
    # such components are strongly connected, and these need no reversed edges
    components: tuple[int, np.ndarray] = connected_components(graph, connection="strong")
    return components
