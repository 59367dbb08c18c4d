"""Tests of a variant: its contacts, its neighbourhoods, and its whole shape graph recomputed."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.geometry.contact_lookup import (
    FORBIDDEN_CONTACT,
    LABEL_BASE,
    UNKNOWN_CONTACT,
    contact_key,
    quantize_pose,
)
from stages.shape.geometry.hash_tables import look_up
from stages.variations.kernels.membership import admitted, neighbourhood_key, recalled
from stages.variations.kernels.outcomes import Outcome
from stages.variations.kernels.structs import N_EDGES, N_PARTS, N_UNKNOWNS, TRY_NUMBER
from stages.variations.kernels.variant_graph import set_edge


@numba.njit(cache=True, inline="always")
def _boxes_apart(boxes, i, j, slack):
    return (
        abs(boxes[i, 0, 0] - boxes[j, 0, 0]) > boxes[i, 1, 0] + boxes[j, 1, 0] + slack
        or abs(boxes[i, 0, 1] - boxes[j, 0, 1]) > boxes[i, 1, 1] + boxes[j, 1, 1] + slack
        or abs(boxes[i, 0, 2] - boxes[j, 0, 2]) > boxes[i, 1, 2] + boxes[j, 1, 2] + slack
    )


@numba.njit(cache=True)
def _overlaps(boxes, count, origin, between_sides, slack, pairs):
    """Write the pairs i < j of overlapping boxes to `pairs`; return their number, or -1 if `pairs` is too short.

    between_sides: only pairs of a part of A alone and one of B alone, the former first
    """
    filled = 0
    for i in range(count):
        if between_sides and origin[i] != 0:
            continue
        for j in range(0 if between_sides else i + 1, count):
            if between_sides and origin[j] != 1:
                continue
            if not _boxes_apart(boxes, i, j, slack):
                if filled == len(pairs):
                    return -1
                pairs[filled, 0] = i
                pairs[filled, 1] = j
                filled += 1
    return filled


@numba.njit(cache=True)
def _contact(kit, contacts, ws, i, j, quanta):
    """Return the answer for a pair: NO_CONTACT, FORBIDDEN_CONTACT, UNKNOWN_CONTACT or a packed pair of labels."""
    reach, quantum = kit.reach[ws.types[j]], kit.limits[2]
    quantize_pose(ws.rotations[i], ws.translations[i], ws.rotations[j], ws.translations[j], reach, quantum, quanta)
    return look_up(contacts.keys, contacts.values, contact_key(ws.types[i], ws.types[j], quanta))


@numba.njit(cache=True)
def _must_ask(ws, i, j):
    """List a pair whose answer is missing; return False where there is no room."""
    if ws.counts[N_UNKNOWNS] == len(ws.unknown):
        return False
    ws.unknown[ws.counts[N_UNKNOWNS], 0] = i
    ws.unknown[ws.counts[N_UNKNOWNS], 1] = j
    ws.counts[N_UNKNOWNS] += 1
    return True


@numba.njit(cache=True)
def _add_contacts(kit, contacts, ws, pairs):
    """Add the contacts among the first `pairs` rows of `ws.near` to the edges; return an outcome as `connect`."""
    quanta = np.empty(12, dtype=np.int64)
    for k in range(pairs):
        i, j = ws.near[k, 0], ws.near[k, 1]
        if ws.stamp[i, j] == ws.counts[TRY_NUMBER]:
            continue
        answer = _contact(kit, contacts, ws, i, j, quanta)
        if answer == FORBIDDEN_CONTACT:
            return Outcome.CLASH
        if answer == UNKNOWN_CONTACT:
            if not _must_ask(ws, i, j):
                return Outcome.UNKNOWN
        elif answer >= 0:
            if ws.counts[N_EDGES] == len(ws.edges):
                return Outcome.TOO_LARGE
            set_edge(ws.stamp, ws.label, ws.edges, ws.counts, i, j, answer // LABEL_BASE, answer % LABEL_BASE)
    return Outcome.UNKNOWN if ws.counts[N_UNKNOWNS] > 0 else Outcome.OK


@numba.njit(cache=True)
def _grammar_holds(kit, ws, open_pairs):
    """Return whether every part has an admitted multiset of neighbour types.

    Parts in the first `open_pairs` rows of `ws.near` are not tested.
    """
    v = ws.counts[N_PARTS]
    for i in range(v):
        ws.fresh[i] = neighbourhood_key(kit, ws.types[i])
        ws.stack[i] = 0
    for e in range(ws.counts[N_EDGES]):
        i, j = ws.edges[e, 0], ws.edges[e, 1]
        ws.fresh[i] += kit.weights[ws.types[j]]
        ws.fresh[j] += kit.weights[ws.types[i]]
    for k in range(open_pairs):
        ws.stack[ws.near[k, 0]] = 1
        ws.stack[ws.near[k, 1]] = 1
    for i in range(v):
        if ws.stack[i] == 1:
            continue
        verdict = recalled(kit.rules, ws.fresh[i])
        if verdict == 0 or (verdict == UNKNOWN_CONTACT and not _neighbours_admitted(kit, ws, i)):
            return False
    return True


@numba.njit(cache=True)
def _neighbours_admitted(kit, ws, part):
    near = np.empty(ws.counts[N_PARTS], dtype=np.int64)
    count = 0
    for e in range(ws.counts[N_EDGES]):
        for side in range(2):
            if ws.edges[e, side] == part:
                near[count] = ws.types[ws.edges[e, 1 - side]]
                count += 1
    return admitted(kit, ws.types[part], near, count)


@numba.njit(cache=True)
def keeps_types(kit, ws):
    """Return whether the share of every label is within `kit.shares`, rounded outwards to whole parts.

    A label whose smallest share is above 0 has at least one part, and one part is never too many.
    """
    v, counts = ws.counts[N_PARTS], ws.stack
    counts[: len(kit.shares)] = 0
    for part in range(v):
        counts[kit.label_of[ws.types[part]]] += 1
    for label in range(len(kit.shares)):
        low, high = kit.shares[label, 0], kit.shares[label, 1]
        if low > 0.0 and (counts[label] == 0 or counts[label] < np.floor(low * v + 1e-9)):
            return False
        if counts[label] > 1 and counts[label] > np.ceil(high * v - 1e-9):
            return False
    return True


@numba.njit(cache=True)
def connect(kit, contacts, ws):
    """Add the contacts between parts of A alone and of B alone, then test the grammar.

    With UNKNOWN the pairs in `ws.unknown` must be resolved first. The final outcome does not depend on what was known:
    first the grammar of parts that no such contact can change, then forbidden contacts, then the grammar of all parts.
    """
    ws.counts[N_UNKNOWNS] = 0
    pairs = _overlaps(ws.boxes, ws.counts[N_PARTS], ws.origin, True, 1.1 * kit.limits[1], ws.near)
    if pairs < 0:
        return Outcome.TOO_LARGE
    if not _grammar_holds(kit, ws, pairs):
        return Outcome.GRAMMAR
    outcome = _add_contacts(kit, contacts, ws, pairs)
    if outcome != Outcome.OK:
        return outcome
    return Outcome.OK if _grammar_holds(kit, ws, np.int64(0)) else Outcome.GRAMMAR


@numba.njit(cache=True)
def find_contacts(kit, contacts, ws):
    """Add all contacts between the parts of a variant whose boxes are set; `ws` may have some of its edges.

    Returns OK, CLASH, TOO_LARGE, or UNKNOWN as `connect` does.
    """
    ws.counts[N_UNKNOWNS] = 0
    pairs = _overlaps(ws.boxes, ws.counts[N_PARTS], ws.origin, False, 1.1 * kit.limits[1], ws.near)
    if pairs < 0:
        return Outcome.TOO_LARGE
    return _add_contacts(kit, contacts, ws, pairs)


@numba.njit(cache=True)
def validate(kit, contacts, ws):
    """Recompute the variant's whole shape graph from its poses and compare it with the predicted one.

    Returns OK where they are equal, CLASH where they differ, UNKNOWN where pairs must be resolved first.
    """
    ws.counts[N_UNKNOWNS] = 0
    quanta = np.empty(12, dtype=np.int64)
    seen = 0
    pairs = _overlaps(ws.boxes, ws.counts[N_PARTS], ws.origin, False, 1.1 * kit.limits[1], ws.near)
    if pairs < 0:
        return Outcome.TOO_LARGE
    for k in range(pairs):
        i, j = ws.near[k, 0], ws.near[k, 1]
        answer = _contact(kit, contacts, ws, i, j, quanta)
        if answer == UNKNOWN_CONTACT:
            if not _must_ask(ws, i, j):
                return Outcome.UNKNOWN
            continue
        predicted = ws.stamp[i, j] == ws.counts[TRY_NUMBER]
        if answer == FORBIDDEN_CONTACT or (answer >= 0) != predicted:
            return Outcome.CLASH
        if predicted:
            if ws.label[i, j] != answer // LABEL_BASE or ws.label[j, i] != answer % LABEL_BASE:
                return Outcome.CLASH
            seen += 1
    if ws.counts[N_UNKNOWNS] > 0:
        return Outcome.UNKNOWN
    return Outcome.OK if seen == ws.counts[N_EDGES] else Outcome.CLASH
