"""Joining a piece with what its boundary leaves of another shape (strings §4)."""

from __future__ import annotations

import numba

from stages.shape.geometry.pose_kernels import apply_transform, looks_same, rotate, squared_distance
from stages.variations.exchange.components import choose_components, find_components
from stages.variations.kernels.outcomes import Outcome
from stages.variations.kernels.structs import N_BOUNDARY, N_EDGES, N_PARTS, N_UNKNOWNS, TRY_NUMBER
from stages.variations.kernels.variant_graph import inherit_edges, place_boxes


@numba.njit(cache=True)
def join(rng, kit, a, b, ws, min_parts, max_parts):
    """Put the piece of A, moved, in place of the part of B that its boundary cuts off.

    Boundary parts replace their images. Of B without the images, components stay so that the neighbourhood of each
    boundary part is in the grammar; parts of them that coincide with parts of the piece are merged. Fills the variant's
    parts and inherited edges.
    """
    ws.counts[TRY_NUMBER] += 1
    ws.counts[N_EDGES] = 0
    ws.counts[N_UNKNOWNS] = 0
    ws.image_of[: len(b.types)] = -1
    for k in range(ws.counts[N_BOUNDARY]):
        ws.image_of[ws.images[k]] = ws.boundary[k]
    components = find_components(b.starts, b.ends, ws.image_of, ws.component, ws.stack)
    if not choose_components(rng, kit, a, b, ws, components):
        return Outcome.GRAMMAR
    outcome = _check_room(a, b, ws, min_parts, max_parts)
    if outcome != Outcome.OK:
        return outcome
    piece = _put_piece(a, b, ws)
    parts = _put_rest(kit, a, b, ws, piece)
    if parts < 0:
        return Outcome.CLASH
    ws.counts[N_PARTS] = parts
    if parts < min_parts:
        return Outcome.TOO_SMALL
    if parts > max_parts:
        return Outcome.TOO_LARGE
    if parts == piece:
        return Outcome.NOTHING_ATTACHED
    inherit_edges(a.starts, a.ends, a.labels, ws.from_a, ws)
    inherit_edges(b.starts, b.ends, b.labels, ws.from_b, ws)
    place_boxes(kit.boxes, ws.types, ws.rotations, ws.translations, parts, ws.boxes)
    return Outcome.OK


@numba.njit(cache=True)
def _check_room(a, b, ws, min_parts, max_parts):
    """Return TOO_SMALL or TOO_LARGE where the variant is that however many parts of the piece and of B are merged."""
    piece, kept = 0, 0
    for part in range(len(a.types)):
        if ws.inside[part]:
            piece += 1
    for part in range(len(b.types)):
        if ws.component[part] >= 0 and ws.keep[ws.component[part]]:
            kept += 1
    if piece + kept < min_parts:
        return Outcome.TOO_SMALL
    if max(piece, kept + ws.counts[N_BOUNDARY]) > max_parts or piece + kept > len(ws.types):
        return Outcome.TOO_LARGE
    return Outcome.OK


@numba.njit(cache=True)
def _put_piece(a, b, ws):
    """Begin the variant with the parts of the piece, moved; boundary parts are of B too. Return their number."""
    ws.from_a[: len(a.types)] = -1
    ws.from_b[: len(b.types)] = -1
    v = 0
    for part in range(len(a.types)):
        if ws.inside[part]:
            ws.from_a[part] = v
            ws.types[v] = a.types[part]
            apply_transform(ws.transform, a.translations[part], ws.translations[v])
            rotate(ws.transform, a.rotations[part], ws.rotations[v])
            ws.origin[v] = 0
            v += 1
    for k in range(ws.counts[N_BOUNDARY]):
        ws.from_b[ws.images[k]] = ws.from_a[ws.boundary[k]]
        ws.origin[ws.from_a[ws.boundary[k]]] = 2
    return v


@numba.njit(cache=True)
def _put_rest(kit, a, b, ws, piece):
    """Add the parts of B that stay to the `piece` parts of the variant; return how many parts it has then.

    -1 where a part is at the place of one of the piece but looks different, or of one that is of B already.
    """
    v = piece
    for part in range(len(b.types)):
        if ws.component[part] < 0 or not ws.keep[ws.component[part]]:
            continue
        first, last = a.type_starts[b.types[part]], a.type_starts[b.types[part] + 1]
        same = _part_of_piece(a.by_type, first, last, ws.from_a, ws.translations, b.translations[part], kit.limits[0])
        if same >= 0:
            if ws.origin[same] != 0 or looks_same(kit, ws.types[same], ws.rotations[same], b.rotations[part]) < 0:
                return -1
            ws.origin[same] = 2
            ws.from_b[part] = same
            continue
        ws.from_b[part] = v
        ws.types[v] = b.types[part]
        for i in range(3):
            ws.translations[v, i] = b.translations[part, i]
            for j in range(3):
                ws.rotations[v, i, j] = b.rotations[part, i, j]
        ws.origin[v] = 1
        v += 1
    return v


@numba.njit(cache=True)
def _part_of_piece(by_type, first, last, from_a, translations, point, tolerance):
    """Return which of the parts by_type[first:last] of A is in the variant at a point, by its number there, or -1."""
    for k in range(first, last):
        v = from_a[by_type[k]]
        if v >= 0 and squared_distance(translations[v], point) <= tolerance**2:
            return v
    return -1
