"""Checking a variant: its contacts, its neighbourhoods, its whole shape graph anew."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.geometry.contact_lookup import contact_key, look_up, quantize_pose
from stages.variations.kernels.membership import admitted, neighbourhood_key, recalled
from stages.variations.kernels.structs import EDGES, FORBIDDEN, LABELS, MISSING, PARTS, TRY, UNKNOWNS, Outcome
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
    """Pairs i < j of overlapping boxes; with `between_sides` only those of a part of A alone and one of B alone, the
    former first. Their number; a number of -1 says that `pairs` is too short."""
    found = 0
    for i in range(count):
        if between_sides and origin[i] != 0:
            continue
        for j in range(0 if between_sides else i + 1, count):
            if between_sides and origin[j] != 1:
                continue
            if not _boxes_apart(boxes, i, j, slack):
                if found == len(pairs):
                    return -1
                pairs[found, 0] = i
                pairs[found, 1] = j
                found += 1
    return found


@numba.njit(cache=True)
def _contact(kit, answers, ws, i, j, quanta):
    """The answer for a pair: NONE, FORBIDDEN, MISSING or a packed pair of labels."""
    reach, quantum = kit.reach[ws.types[j]], kit.limits[2]
    quantize_pose(ws.rotations[i], ws.translations[i], ws.rotations[j], ws.translations[j], reach, quantum, quanta)
    return look_up(answers.keys, answers.values, contact_key(ws.types[i], ws.types[j], quanta))


@numba.njit(cache=True)
def _must_ask(ws, i, j):
    """List a pair whose answer is missing; False where there is no room for more."""
    if ws.counts[UNKNOWNS] == len(ws.unknown):
        return False
    ws.unknown[ws.counts[UNKNOWNS], 0] = i
    ws.unknown[ws.counts[UNKNOWNS], 1] = j
    ws.counts[UNKNOWNS] += 1
    return True


@numba.njit(cache=True)
def _add_contacts(kit, answers, ws, pairs):
    """Add the contacts among the first `pairs` rows of `ws.near` to the edges; UNKNOWN as `connect` says it."""
    quanta = np.empty(12, dtype=np.int64)
    for k in range(pairs):
        i, j = ws.near[k, 0], ws.near[k, 1]
        if ws.stamp[i, j] == ws.counts[TRY]:
            continue
        answer = _contact(kit, answers, ws, i, j, quanta)
        if answer == FORBIDDEN:
            return Outcome.CLASH
        if answer == MISSING:
            if not _must_ask(ws, i, j):
                return Outcome.UNKNOWN
        elif answer >= 0:
            if ws.counts[EDGES] == len(ws.edges):
                return Outcome.TOO_LARGE
            set_edge(ws.stamp, ws.label, ws.edges, ws.counts, i, j, answer // LABELS, answer % LABELS)
    return Outcome.UNKNOWN if ws.counts[UNKNOWNS] > 0 else Outcome.OK


@numba.njit(cache=True)
def _grammar_holds(kit, ws, open_pairs):
    """Whether every part's multiset of neighbour types is allowed, but for the parts in the first `open_pairs` rows of
    `ws.near`."""
    v = ws.counts[PARTS]
    for i in range(v):
        ws.fresh[i] = neighbourhood_key(kit, ws.types[i])
        ws.stack[i] = 0
    for e in range(ws.counts[EDGES]):
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
        if verdict == 0 or (verdict == MISSING and not _neighbours_admitted(kit, ws, i)):
            return False
    return True


@numba.njit(cache=True)
def _neighbours_admitted(kit, ws, part):
    near = np.empty(ws.counts[PARTS], dtype=np.int64)
    count = 0
    for e in range(ws.counts[EDGES]):
        for side in range(2):
            if ws.edges[e, side] == part:
                near[count] = ws.types[ws.edges[e, 1 - side]]
                count += 1
    return admitted(kit, ws.types[part], near, count)


@numba.njit(cache=True)
def connect(kit, answers, ws):
    """Add the contacts between parts that came from A alone and from B alone, then check the grammar.

    With UNKNOWN the pairs in `ws.unknown` must be answered first. What comes out in the end, down to the reason of a
    refusal, is the same whatever was known: first the grammar of the parts that no such contact can change, then
    forbidden contacts, then the grammar of all parts.
    """
    ws.counts[UNKNOWNS] = 0
    pairs = _overlaps(ws.boxes, ws.counts[PARTS], ws.origin, True, 1.1 * kit.limits[1], ws.near)
    if pairs < 0:
        return Outcome.TOO_LARGE
    if not _grammar_holds(kit, ws, pairs):
        return Outcome.GRAMMAR
    outcome = _add_contacts(kit, answers, ws, pairs)
    if outcome != Outcome.OK:
        return outcome
    return Outcome.OK if _grammar_holds(kit, ws, 0) else Outcome.GRAMMAR


@numba.njit(cache=True)
def find_contacts(kit, answers, ws):
    """Add all contacts between the parts of a variant whose boxes are placed, where `ws` has none of its edges yet, or
    some; OK, CLASH, TOO_LARGE, or UNKNOWN as `connect` says it."""
    ws.counts[UNKNOWNS] = 0
    pairs = _overlaps(ws.boxes, ws.counts[PARTS], ws.origin, False, 1.1 * kit.limits[1], ws.near)
    if pairs < 0:
        return Outcome.TOO_LARGE
    return _add_contacts(kit, answers, ws, pairs)


@numba.njit(cache=True)
def validate(kit, answers, ws):
    """Compute the variant's whole shape graph anew from its poses and hold it against the predicted one.

    OK where they are the same, CLASH where they differ, UNKNOWN where pairs must be answered first.
    """
    ws.counts[UNKNOWNS] = 0
    quanta = np.empty(12, dtype=np.int64)
    seen = 0
    pairs = _overlaps(ws.boxes, ws.counts[PARTS], ws.origin, False, 1.1 * kit.limits[1], ws.near)
    if pairs < 0:
        return Outcome.TOO_LARGE
    for k in range(pairs):
        i, j = ws.near[k, 0], ws.near[k, 1]
        answer = _contact(kit, answers, ws, i, j, quanta)
        if answer == MISSING:
            if not _must_ask(ws, i, j):
                return Outcome.UNKNOWN
            continue
        predicted = ws.stamp[i, j] == ws.counts[TRY]
        if answer == FORBIDDEN or (answer >= 0) != predicted:
            return Outcome.CLASH
        if predicted:
            if ws.label[i, j] != answer // LABELS or ws.label[j, i] != answer % LABELS:
                return Outcome.CLASH
            seen += 1
    if ws.counts[UNKNOWNS] > 0:
        return Outcome.UNKNOWN
    return Outcome.OK if seen == ws.counts[EDGES] else Outcome.CLASH
