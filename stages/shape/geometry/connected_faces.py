"""Connected components of triangles that were written as one mesh although they are several solids."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.components import connected_components
from stages.shape.geometry.distinct_rows import distinct_rows


def joined_corners(vertices: FloatArray, faces: IntArray, kinds: np.ndarray) -> np.ndarray:
    """Return pairs of face corners that are one vertex of one surface, int64 (p, 2); corner `3 * face + k`.

    Vertices at equal positions count as one, whatever the file's indices. Two faces of one kind (`kinds`, int (f,))
    that are alone at an edge are joined along it. If more than two meet in an edge, several solids touch there: two
    opposed faces that are connected elsewhere belong together, and of the others, going around the edge, two with the
    inside between them. A face that repeats another belongs to it.
    """
    positions, inverse = np.unique(vertices, axis=0, return_inverse=True)
    vertex_of = inverse.reshape(-1)[faces]
    turn = (vertex_of.argmin(axis=1)[:, None] + np.arange(3)) % 3
    turned = np.take_along_axis(vertex_of, turn, axis=1)
    original, copy_of = distinct_rows(np.column_stack([turned, kinds]))
    numbers = 3 * np.arange(len(faces))[:, None] + turn
    pairs = [np.column_stack([numbers[original[copy_of]].ravel(), numbers.ravel()])]

    first_of = np.sort(original)
    from_corner = (3 * first_of[:, None] + np.arange(3)).ravel()
    to_corner = (3 * first_of[:, None] + (1, 2, 0)).ravel()
    start, end = vertex_of.ravel()[from_corner], vertex_of.ravel()[to_corner]
    forward = start < end
    # each side of a face as (kind, lower place, higher place, corner at the lower, corner at the higher)
    sides = np.column_stack(
        [
            np.repeat(kinds[first_of], 3),
            np.minimum(start, end),
            np.maximum(start, end),
            np.where(forward, from_corner, to_corner),
            np.where(forward, to_corner, from_corner),
        ]
    )[start != end]
    forward = forward[start != end]
    order = np.lexsort(sides.T[::-1])
    sides, forward = sides[order], forward[order]
    first = np.flatnonzero(np.r_[True, (sides[1:, :3] != sides[:-1, :3]).any(axis=1)][: len(sides)])
    size = np.diff(np.r_[first, len(sides)])
    simple = np.column_stack([first[size == 2], first[size == 2] + 1])
    owner = sides[:, 3] // 3
    region = connected_components(len(faces), np.concatenate([owner[simple], pairs[0] // 3]))
    matched = [simple]
    for begin, count in zip(first[size > 2].tolist(), size[size > 2].tolist(), strict=True):
        there = np.arange(begin, begin + count)
        couples, rest = _couples(region[owner[there]], forward[there])
        wedges = _wedges(positions[sides[begin, 1:3]], positions[vertex_of[owner[there[rest]]]], forward[there[rest]])
        matched += [there[np.array([pair])] for pair in [*couples, *(tuple(rest[[i, j]]) for i, j in wedges)]]
    first_side, other = np.concatenate(matched).T
    pairs += [np.column_stack([sides[first_side, column], sides[other, column]]) for column in (3, 4)]
    return np.concatenate(pairs)


def connected_corners(vertices: FloatArray, faces: IntArray, kinds: np.ndarray) -> IntArray:
    """Return the vertex of each face corner, int32 (f, 3), in a mesh where no edge has more than two faces."""
    return connected_components(3 * len(faces), joined_corners(vertices, faces, kinds)).reshape(-1, 3)


def connected_faces(vertices: FloatArray, faces: IntArray, kinds: np.ndarray) -> IntArray:
    """Return the component of each face, int32 (f,), numbered in the order of their first faces."""
    return connected_components(len(faces), joined_corners(vertices, faces, kinds) // 3)


def _couples(region: IntArray, forward: np.ndarray) -> tuple[list[tuple[int, int]], np.ndarray]:
    """Return pairs of faces around an edge that are alone there in their region and opposed, and the indices of the
    other faces.
    """
    couples = []
    for number in np.unique(region):
        members = np.flatnonzero(region == number)
        if len(members) == 2 and forward[members[0]] != forward[members[1]]:
            couples.append((int(members[0]), int(members[1])))
    return couples, np.setdiff1d(np.arange(len(region)), np.array(couples, dtype=np.int64))


def _wedges(ends: FloatArray, triangles: FloatArray, forward: np.ndarray) -> list[tuple[int, int]]:
    """Return pairs of faces around an edge that bound the inside of a solid, as indices into `triangles`.

    ends: ends of the edge, float64 (2, 3)
    triangles: triangles on that edge, float64 (k, 3, 3)
    forward: whether each runs along the edge from its first end to its second, bool (k,)

    Seen with the edge pointing at the eye, the inside of a solid lies clockwise from its forward face.
    """
    axis = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    across = triangles.sum(axis=1) - ends.sum(axis=0) - ends[0]  # from the edge to the corner off it
    across = across - np.outer(across @ axis, axis)
    if len(across) < 2 or not np.linalg.norm(across, axis=1).all():
        return []
    counterclockwise = np.arctan2(across @ np.cross(axis, across[0]), across @ across[0])
    # wedges thinner than 1e-4 radians are rounding: there, the solid that ends comes before the one that begins
    clockwise = np.round(-counterclockwise, 4) % np.round(2 * np.pi, 4)
    free = np.lexsort((forward, clockwise)).tolist()
    pairs: list[tuple[int, int]] = []
    index = 0
    while index < len(free) > 1:
        here, after = free[index], free[(index + 1) % len(free)]
        if forward[here] and not forward[after]:
            pairs.append((here, after))
            free = [face for face in free if face not in (here, after)]
            index = 0
        else:
            index += 1
    return pairs
