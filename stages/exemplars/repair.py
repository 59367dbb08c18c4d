"""Repair part meshes with PyMeshLab; the surface does not move, and every change is counted."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from stages.exemplars.coincident_patches import flat_patches
from stages.exemplars.orientation import face_outward, flipped_faces
from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.connected_faces import connected_corners, connected_faces
from stages.shape.geometry.distinct_rows import distinct_rows

MIN_FACE_HEIGHT = 1e-7
"""Height of a face, as a share of the mesh's diagonal, below which 32-bit coordinates give it no area."""


@dataclass(frozen=True)
class Repair:
    """The number of changes by kind: `merged_vertices`, `unreferenced_vertices`, `duplicate_faces`, `zero_area_faces`,
    `nonmanifold_edges`, `flipped_faces`. Kinds without changes are left out.
    """

    changes: dict[str, int] = field(default_factory=dict)


def repair_mesh(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray, np.ndarray, Repair]:
    """Return the mesh without duplicates, faces without area and non-manifold edges, oriented outward.

    Vertices at equal positions are merged within each solid; solids that only touch stay apart, and a surface that
    meets itself in an edge is cut there. A face and its reverse are duplicates, unless two solids share a wall.
    Neighbouring faces get one orientation: closed shells face outward (a cavity that the file orients the other way
    faces inward), open sheets keep the side that most of their faces showed. No vertex moves, and the surface changes
    by less than 1e-7 of its diagonal.

    vertices: float64 (v, 3).
    faces: int32 (f, 3).

    Returns vertices, faces, which of the given faces each is, int64 (k,), and the changes; empty arrays for a mesh
    whose faces have no area.
    """
    used = np.unique(faces)
    whole = _distinct_corners(vertices, faces)
    solid = connected_faces(vertices, faces[whole], np.zeros(len(whole), np.int32))
    patch, outline = flat_patches(vertices, faces[whole], solid)
    alone = _without_repeated_solids(vertices, faces[whole], solid, outline)
    distinct = alone[_without_duplicates(*_weld(vertices, faces[whole[alone]], solid[alone]))]
    unique = whole[distinct[_without_repeated_patches(patch, outline, solid, distinct)]]
    solid_of = np.full(len(faces), -1, dtype=np.int32)
    solid_of[whole] = solid
    points, manifold = _cut_apart(vertices, faces[unique], solid_of[unique])
    oriented = face_outward(points, _coherent(points, manifold), manifold)
    high = _heights(points, oriented) > MIN_FACE_HEIGHT * np.linalg.norm(np.ptp(vertices[used], axis=0))
    kept, renumbered = np.unique(oriented[high], return_inverse=True)
    changes = {
        "merged_vertices": _count_rows(np.column_stack([manifold.ravel(), faces[unique].ravel()])) - len(points),
        "unreferenced_vertices": len(vertices) - len(used),
        "duplicate_faces": len(whole) - len(unique),
        "zero_area_faces": len(faces) - len(whole) + int(np.count_nonzero(~high)),
        "nonmanifold_edges": _crowded_edges(faces[unique]),
        "flipped_faces": int(np.count_nonzero(flipped_faces(oriented, manifold)[high])),
    }
    return (
        points[kept],
        renumbered.reshape(-1, 3).astype(np.int32),
        unique[high],
        Repair({kind: count for kind, count in changes.items() if count}),
    )


def _without_duplicates(vertices: FloatArray, faces: IntArray) -> np.ndarray:
    """Return the indices of one face of each set of faces with the same corners, ascending."""
    import pymeshlab

    if not len(faces):
        return np.empty(0, dtype=np.int64)
    meshes = pymeshlab.MeshSet(verbose=False)
    # each face carries its number through the filter
    meshes.add_mesh(pymeshlab.Mesh(vertices, faces, f_scalar_array=np.arange(len(faces), dtype=np.float64)))
    meshes.meshing_remove_duplicate_faces()
    return np.sort(np.rint(meshes.current_mesh().face_scalar_array()).astype(np.int64))


def _coherent(vertices: FloatArray, faces: IntArray) -> IntArray:
    """Return the faces of a manifold, in their order, with one orientation among neighbours."""
    import pymeshlab

    if not len(faces):
        return faces
    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(vertices, faces))
    meshes.meshing_re_orient_faces_coherently()
    oriented: IntArray = meshes.current_mesh().face_matrix().astype(np.int32)
    return oriented


def _distinct_corners(vertices: FloatArray, faces: IntArray) -> np.ndarray:
    """Return the indices of the faces with corners at three different positions."""
    corners = vertices[faces]
    same = [(corners[:, i] == corners[:, j]).all(axis=1) for i, j in ((0, 1), (1, 2), (2, 0))]
    return np.flatnonzero(~np.any(same, axis=0))


def _weld(vertices: FloatArray, faces: IntArray, solid: IntArray) -> tuple[FloatArray, IntArray]:
    """Merge the vertices at each position of each solid.

    PyMeshLab's own filter merges by position alone, and makes one surface of solids that only touch.
    """
    keys = np.column_stack([np.repeat(solid, 3), vertices[faces.ravel()]])
    welded, inverse = np.unique(keys, axis=0, return_inverse=True)
    return np.ascontiguousarray(welded[:, 1:]), inverse.reshape(-1, 3).astype(np.int32)


def _cut_apart(vertices: FloatArray, faces: IntArray, solid: IntArray) -> tuple[FloatArray, IntArray]:
    """Return the same faces with separate vertices wherever more than two would meet in an edge.

    PyMeshLab's own filter opens shells that touch, and confuses the faces.
    """
    corners = connected_corners(vertices, faces, solid)
    sides = np.sort(corners[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    numbers = distinct_rows(sides).numbers
    crowded = (np.bincount(numbers)[numbers] > 2).reshape(-1, 3).any(axis=1)
    if crowded.any():  # a surface that touches itself in both ends of an edge: those faces stand alone
        corners[crowded] = corners.max() + 1 + np.arange(3 * np.count_nonzero(crowded)).reshape(-1, 3)
    _, first, inverse = np.unique(corners, return_index=True, return_inverse=True)
    order = np.argsort(faces.ravel()[first], kind="stable")  # vertices keep the order of the file
    rank = np.empty(len(order), dtype=np.int32)
    rank[order] = np.arange(len(order), dtype=np.int32)
    return vertices[faces.ravel()[first[order]]], rank[inverse].reshape(-1, 3)


def _without_repeated_solids(vertices: FloatArray, faces: IntArray, solid: IntArray, outline: IntArray) -> np.ndarray:
    """Return the indices of the faces without solids that repeat others: two-sided exports of shells.

    outline: the number of each face's flat patch, which patches with equal outlines share. A face is repeated if an
    earlier solid has a face with the same corners, or a patch with the same outline.
    """
    same = distinct_rows(np.sort(distinct_rows(vertices).numbers[faces], axis=1)).numbers
    repeats = np.ones(solid.max(initial=-1) + 1, dtype=bool)
    is_first = np.ones(len(faces), dtype=bool)
    for group in (same, outline):
        earliest = np.full(group.max(initial=-1) + 1, len(faces))
        np.minimum.at(earliest, group, solid)
        is_first &= earliest[group] == solid
    repeats[solid[is_first]] = False
    return np.flatnonzero(~repeats[solid])


def _without_repeated_patches(patch: IntArray, outline: IntArray, solid: IntArray, kept: np.ndarray) -> np.ndarray:
    """Return the indices into `kept` without flat patches whose outline an earlier whole patch of their solid has.

    kept: the faces that are left of those with the numbers `patch`, `outline` and `solid`.
    """
    is_whole = np.bincount(patch[kept], minlength=len(patch)) == np.bincount(patch, minlength=len(patch))
    group = distinct_rows(np.column_stack([solid, outline])).numbers
    first = np.full(group.max(initial=-1) + 1, len(patch))
    whole = kept[is_whole[patch[kept]]]
    np.minimum.at(first, group[whole], patch[whole])
    return np.flatnonzero(first[group[kept]] >= patch[kept])


def _crowded_edges(faces: IntArray) -> int:
    """Count the edges of a mesh at which more than two faces meet."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return int(np.count_nonzero(np.bincount(distinct_rows(edges).numbers) > 2))


def _count_rows(rows: np.ndarray) -> int:
    return len(distinct_rows(rows).first)


def _heights(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return the height of each face over its longest side."""
    corners = vertices[faces]
    sides = np.roll(corners, -1, axis=1) - corners
    heights: FloatArray = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / (
        np.linalg.norm(sides, axis=2).max(axis=1, initial=1e-300)
    )
    return heights
