"""Looks of the parts of variants: those of the exemplars' parts that they stand for.

A variant consists of pieces of exemplars, each moved by one rotation and translation. The piece that lays most parts on
parts of their types comes first, then the one that lays most of the rest, and so on. Only counts and indices decide
between pieces, so a turned or rounded assembly has the same looks.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple
from zlib import crc32

import numpy as np

from stages.shape.arrays import FloatArray, IntArray, TypeArray
from stages.shape.kit import Assembly, Kit, PartType

MAX_ROTATIONS = 24
"""Rotations of pieces that are looked at, the most frequent ones."""
MAX_ROTATION_DIFFERENCE = 0.02
"""Largest difference of two entries of rotations that count as equal."""
POSE_TOLERANCES = 4.0
"""Parts that a piece misses by up to this many pose tolerances belong to it."""
MAX_PAIRS = 20_000
"""Pairs of parts with a symmetry from which rotations and translations are taken; of more, parts are left out."""
MAX_PIECES = 300
"""Pieces of an exemplar that are looked at, those with most pairs."""


def with_looks(kit: Kit, assembly: Assembly) -> tuple[tuple[PartType, ...], Assembly]:
    """Return meshes, the kit's types first, and the assembly of them in which each part has its look."""
    if not any(kind.other_looks for kind in kit.types):
        return kit.types, assembly
    looks = exemplar_looks(kit, assembly) if assembly.looks is None else assembly.looks
    others = [len(kind.other_looks) for kind in kit.types]
    first = len(kit.types) + np.cumsum(others) - others
    types = np.where(looks > 0, first[assembly.types] + looks - 1, assembly.types).astype(np.int16)
    meshes = (*kit.types, *(mesh for kind in kit.types for mesh in kind.looked[1:]))
    return meshes, replace(assembly, types=types, looks=None)


def exemplar_looks(kit: Kit, assembly: Assembly) -> TypeArray:
    """Return the look of each part of an assembly, int16 (n,).

    A part outside of all pieces takes a look of its type, which depends on its index and on the types of all parts.
    """
    counts = np.array([len(kind.looked) for kind in kit.types])[assembly.types]
    looks = np.zeros(len(assembly), dtype=np.int16)
    seed = crc32(assembly.types.tobytes())
    left, has_looks = np.ones(len(assembly), dtype=bool), counts > 1
    pieces = [
        _Piece(number, rotation, image)
        for number, exemplar in enumerate(kit.exemplars)
        for rotation, image in _pieces(kit, assembly, exemplar.whole)
    ]
    # Of equally large pieces the exemplar is drawn; then comes the piece that keeps the order of its parts.
    pieces.sort(key=lambda piece: (crc32(piece.exemplar.to_bytes(4, "little"), seed), piece.image.tolist()))
    images = np.array([piece.image for piece in pieces]).reshape(len(pieces), len(assembly))
    sizes, is_turned = (images >= 0).sum(axis=1), np.ones(len(pieces), dtype=bool)
    while pieces and (left & has_looks).any():
        covers = (images >= 0) & left
        gains = np.where((covers & has_looks).any(axis=1), covers.sum(axis=1), 0)
        best = int(np.lexsort((-sizes, is_turned, -gains))[0])
        source = kit.exemplars[pieces[best].exemplar].whole.looks
        if not gains[best] or source is None:
            break
        parts = np.flatnonzero(covers[best])
        looks[parts] = source[images[best, parts]]
        left[parts] = False
        is_turned &= [piece[:2] != pieces[best][:2] for piece in pieces]
    for part in np.flatnonzero(left & has_looks).tolist():
        looks[part] = crc32(part.to_bytes(4, "little"), seed) % counts[part]
    return looks


class _Piece(NamedTuple):
    """Parts that one rotation and translation lays on an exemplar.

    exemplar: its number
    rotation: number of the rotation
    image: part of the exemplar that each part lies on, or -1, int32 (n,)
    """

    exemplar: int
    rotation: int
    image: IntArray


class _Pairs(NamedTuple):
    """Ways to lay a part on one of its type: the parts, int64 (k,), and the rotation, float64 (k, 3, 3)."""

    parts: np.ndarray
    images: np.ndarray
    rotations: FloatArray


def _pieces(kit: Kit, assembly: Assembly, whole: Assembly) -> Iterator[tuple[int, IntArray]]:
    """Yield rotation and image of each piece of two parts and more."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    pairs = _pairs(kit, assembly, whole)
    if whole.looks is None or not len(pairs.parts):
        return
    chosen, rotation_of = _frequent_rotations(pairs)
    kept = np.flatnonzero(rotation_of >= 0)
    parts, images = pairs.parts[kept], pairs.images[kept]
    turned = np.einsum("kij,kj->ki", chosen[rotation_of[kept]], whole.poses[images, :3, 3])
    shifts = assembly.poses[parts, :3, 3] - turned
    reach = POSE_TOLERANCES * max(kit.contact_tolerance, kit.pose_tolerance)
    keyed = np.column_stack([shifts, rotation_of[kept] * (4.0 * reach)])
    near = cKDTree(keyed).query_pairs(reach, output_type="ndarray")
    graph = coo_matrix((np.ones(len(near), np.int8), (near[:, 0], near[:, 1])), shape=(len(kept), len(kept)))
    piece_of = connected_components(graph, directed=False)[1]
    # Types are far apart in a fourth coordinate.
    spread = 4.0 * (reach + float(np.abs(shifts).max()))
    tree = cKDTree(np.column_stack([assembly.poses[:, :3, 3], assembly.types * spread]))
    firsts, counts = np.unique(piece_of, return_index=True, return_counts=True)[1:]
    for first in firsts[np.argsort(-counts, kind="stable")][:MAX_PIECES].tolist():
        rotation = int(rotation_of[kept[first]])
        places = np.einsum("ij,qj->qi", chosen[rotation], whole.poses[:, :3, 3]) + shifts[first]
        gaps, found = tree.query(np.column_stack([places, whole.types * spread]), distance_upper_bound=reach)
        image = np.full(len(assembly), -1, dtype=np.int32)
        image[found[np.isfinite(gaps)][::-1]] = np.flatnonzero(np.isfinite(gaps))[::-1]
        if (image >= 0).sum() > 1:
            yield rotation, image


def _pairs(kit: Kit, assembly: Assembly, whole: Assembly) -> _Pairs:
    """Return ways to lay parts on parts of an exemplar without reflection."""
    handed, theirs = (_handed(poses[:, :3, :3]) for poses in (assembly.poses, whole.poses))
    found: list[_Pairs] = []
    kinds = np.intersect1d(assembly.types, whole.types).tolist()
    for kind in kinds:
        symmetries = kit.types[kind].symmetries[:, :3, :3]
        mine, its = np.flatnonzero(assembly.types == kind), np.flatnonzero(whole.types == kind)
        room = max(MAX_PAIRS // (len(kinds) * len(its) * len(symmetries)), 1)
        mine = mine[np.unique(np.linspace(0, len(mine) - 1, min(room, len(mine))).astype(np.int64))]
        p, q, s = (grid.ravel() for grid in np.meshgrid(mine, its, np.arange(len(symmetries)), indexing="ij"))
        proper = handed[p] * theirs[q] * _handed(symmetries)[s] > 0
        p, q, s = p[proper], q[proper], s[proper]
        turned = np.einsum("kij,kjl->kil", assembly.poses[p, :3, :3], symmetries[s])
        found.append(_Pairs(p, q, np.einsum("kij,klj->kil", turned, whole.poses[q, :3, :3])))
    if not found:
        return _Pairs(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 3, 3)))
    return _Pairs(*(np.concatenate(columns) for columns in zip(*found, strict=True)))


def _handed(rotations: FloatArray) -> np.ndarray:
    """Return -1 for reflections (n, 3, 3), else 1."""
    return np.where(np.linalg.det(rotations) < 0.0, -1, 1)


def _frequent_rotations(pairs: _Pairs) -> tuple[FloatArray, np.ndarray]:
    """Return the most frequent rotations (r, 3, 3), and the number of each pair's rotation, or -1."""
    known: list[FloatArray] = []
    votes: list[int] = []
    left = np.arange(len(pairs.parts))
    rotation_of = np.full(len(pairs.parts), -1)
    flat = pairs.rotations.reshape(-1, 9)
    while len(left):
        same = np.abs(flat[left] - flat[left[0]]).max(axis=1) <= MAX_ROTATION_DIFFERENCE
        rotation_of[left[same]] = len(known)
        votes.append(len(np.unique(pairs.parts[left[same]])))
        known.append(pairs.rotations[left[0]])
        left = left[~same]
    order = np.argsort(-np.array(votes), kind="stable")[:MAX_ROTATIONS]
    number = np.full(len(known), -1)
    number[order] = np.arange(len(order))
    return np.array(known)[order], number[rotation_of]
