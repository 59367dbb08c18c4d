"""Orient the faces of a surface outward."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.components import connected_components


def face_outward(vertices: FloatArray, faces: IntArray, original: IntArray) -> IntArray:
    """Return `faces` int32 (f, 3), which have one orientation in each sheet, with some sheets reversed.

    original: int32 (f, 3), the same faces as in the file.

    An open sheet shows the side that most of its faces showed. A closed shell faces outward. A shell inside another
    keeps its relation to the outermost one, so that a cavity still faces into the cavity.
    """
    if not len(faces):
        return faces
    sheet, closed = _sheets(faces)
    flip = np.bincount(sheet, np.where(flipped_faces(faces, original), 1.0, -1.0)) > 0
    corners = vertices[faces] - (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    parts = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    volume = np.bincount(sheet, parts) * np.where(flip, -1.0, 1.0)
    solid = closed & (volume != 0)
    around = _outermost(vertices, faces, sheet, solid)
    flip ^= solid & (volume[around] < 0)
    return np.where(flip[sheet][:, None], faces[:, ::-1], faces)


def flipped_faces(faces: IntArray, original: IntArray) -> BoolArray:
    """Return whether each face has the opposite orientation in `original`; both int32 (f, 3)."""
    first = (original == faces[:, :1]).argmax(axis=1)
    following = np.take_along_axis(original, (first[:, None] + 1) % 3, axis=1)[:, 0]
    flipped: BoolArray = following != faces[:, 1]
    return flipped


def _sheets(faces: IntArray) -> tuple[IntArray, BoolArray]:
    """Return the sheet of each face, connected across edges of two faces, and whether each sheet has no border."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(len(faces)), 3)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    edges, owner = edges[order], owner[order]
    first = np.flatnonzero(np.r_[True, (edges[1:] != edges[:-1]).any(axis=1)])
    size = np.diff(np.r_[first, len(edges)])
    inner = first[size == 2]
    sheet = connected_components(len(faces), np.column_stack([owner[inner], owner[inner + 1]]))
    closed = np.ones(sheet.max(initial=-1) + 1, dtype=bool)
    closed[sheet[owner[first[size != 2]]]] = False
    return sheet, closed


def _outermost(vertices: FloatArray, faces: IntArray, sheet: IntArray, solid: BoolArray) -> IntArray:
    """Return for each sheet the outermost `solid` one that encloses it, else itself."""
    around = np.arange(len(solid), dtype=np.int32)
    shells = np.flatnonzero(solid)
    if len(shells) < 2:
        return around
    order = np.argsort(sheet, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(sheet[order])) + 1)
    corners = [vertices[faces[groups[index]]] for index in shells]
    low = np.array([triangles.min(axis=(0, 1)) for triangles in corners])
    high = np.array([triangles.max(axis=(0, 1)) for triangles in corners])
    size = np.prod(high - low, axis=1)
    for inner in range(len(shells)):
        boxes = np.flatnonzero((low < low[inner]).all(axis=1) & (high > high[inner]).all(axis=1))
        probes = corners[inner][[0, len(corners[inner]) // 2, -1], 0]
        for outer in boxes[np.argsort(-size[boxes], kind="stable")].tolist():
            if all(abs(_winding(corners[outer], probe)) > 0.5 for probe in probes):
                around[shells[inner]] = shells[outer]
                break
    return around


def _winding(corners: FloatArray, point: FloatArray) -> float:
    """Return the winding number of a closed surface of triangles (f, 3, 3) around a point: solid angles over 4 pi."""
    a, b, c = np.moveaxis(corners - point, 1, 0)
    la, lb, lc = (np.linalg.norm(corner, axis=1) for corner in (a, b, c))
    dot = np.einsum
    under = la * lb * lc + dot("ij,ij->i", a, b) * lc + dot("ij,ij->i", b, c) * la + dot("ij,ij->i", c, a) * lb
    return float(np.arctan2(dot("ij,ij->i", a, np.cross(b, c)), under).sum() / (2 * np.pi))
