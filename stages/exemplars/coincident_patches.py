"""Find flat pieces of a surface that coincide although their triangles differ, as in two-sided exports."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.components import connected_components
from stages.shape.geometry.distinct_rows import distinct_rows

MIN_NORMAL_COSINE = 1.0 - 1e-9
"""Cosine between the normals of neighbours from which they are one flat patch."""
_FACTORS = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F], dtype=np.uint64)


def flat_patches(vertices: FloatArray, faces: IntArray, solid: IntArray) -> tuple[IntArray, IntArray]:
    """Return the flat patch of each face, and a number that patches with the same outline share, both int32 (f,).

    A patch is a connected piece of one solid whose faces have one normal; where two surfaces coincide, their
    faces are joined only within each. Quads that are split along different diagonals have the same outline.
    """
    corners = distinct_rows(vertices).numbers[faces]
    spans = vertices[faces]
    normals = np.cross(spans[:, 1] - spans[:, 0], spans[:, 2] - spans[:, 0])
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    start, end = corners.ravel(), corners[:, [1, 2, 0]].ravel()
    owner = np.repeat(np.arange(len(faces)), 3)
    ends = np.stack([np.minimum(start, end), np.maximum(start, end)], axis=1)
    edge = distinct_rows(ends).numbers
    patch = connected_components(len(faces), _flat_neighbours(edge, start < end, owner, solid, normals))
    # sides that a patch has once are its outline, whose sum of hashes tells it from others in any order
    first, numbers = distinct_rows(np.column_stack([patch[owner], edge]))
    outline = first[np.bincount(numbers) == 1]
    mixed = (edge[outline, None].astype(np.uint64) + np.uint64(1)) * _FACTORS
    mixed ^= mixed >> np.uint64(29)
    mixed *= _FACTORS[::-1]
    mixed ^= mixed >> np.uint64(32)
    sums = np.zeros((int(patch.max(initial=-1)) + 1, 3), dtype=np.uint64)
    np.add.at(sums, patch[owner[outline]], np.column_stack([mixed, np.ones(len(outline), np.uint64)]))
    return patch, distinct_rows(sums).numbers[patch].astype(np.int32)


def _flat_neighbours(
    edge: np.ndarray, forward: np.ndarray, owner: np.ndarray, solid: IntArray, normals: FloatArray
) -> np.ndarray:
    """Return pairs of faces of one solid with one normal that pass an edge in opposite directions, int64 (p, 2).

    Where several could be paired, none are.
    """
    order = np.lexsort([edge, solid[owner]])
    key = np.column_stack([solid[owner[order]], edge[order]])
    begins = np.flatnonzero(np.r_[True, (key[1:] != key[:-1]).any(axis=1)][: len(key)])
    sizes = np.diff(np.r_[begins, len(key)])
    two = begins[sizes == 2]
    first, second = order[two], order[two + 1]
    same = np.einsum("ij,ij->i", normals[owner[first]], normals[owner[second]]) >= MIN_NORMAL_COSINE
    same &= forward[first] != forward[second]
    pairs = [np.column_stack([owner[first[same]], owner[second[same]]])]
    for begin, size in zip(begins[sizes > 2].tolist(), sizes[sizes > 2].tolist(), strict=True):
        sides = order[begin : begin + size]
        ahead, back = owner[sides[forward[sides]]], owner[sides[~forward[sides]]]
        is_flat = normals[ahead] @ normals[back].T >= MIN_NORMAL_COSINE
        is_flat &= (is_flat.sum(axis=1, keepdims=True) == 1) & (is_flat.sum(axis=0, keepdims=True) == 1)
        row, column = np.nonzero(is_flat)
        pairs.append(np.column_stack([ahead[row], back[column]]))
    return np.concatenate(pairs)
