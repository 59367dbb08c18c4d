"""One try of the exchange in one call: cut, match by poses, join, connect, and the key for duplicates (strings §4)."""

from __future__ import annotations

import numba
import numpy as np

from stages.variations.exchange.cuts import cut_connected_piece
from stages.variations.exchange.joins import join
from stages.variations.exchange.pose_matching import match_poses
from stages.variations.exchange.repeated_units import insert_or_remove_unit
from stages.variations.kernels.checks import connect, keeps_types
from stages.variations.kernels.graph_key import graph_key
from stages.variations.kernels.operators import REPEATED_UNIT
from stages.variations.kernels.outcomes import Outcome
from stages.variations.kernels.structs import N_PIECE_PARTS

MIN_LARGE_SHARE, MAX_LARGE_SHARE = 0.2, 0.8
"""A piece with a share of parts between these is large: it can change a shape as a whole."""
MAX_CUTS = 4
"""Cuts made until one is large."""


@numba.njit(cache=True)
def cut_piece(rng, a, b, ws, operator, large, slack):
    """Cut a piece out of A; where it must be large, cut until it is neither small nor nearly everything."""
    parts = len(a.types)
    outcome = cut_connected_piece(rng, a, b, ws, operator, slack)
    for _ in range(MAX_CUTS - 1 if large else 0):
        if outcome == Outcome.OK and MIN_LARGE_SHARE * parts <= ws.counts[N_PIECE_PARTS] <= MAX_LARGE_SHARE * parts:
            break
        outcome = cut_connected_piece(rng, a, b, ws, operator, slack)
    return outcome


@numba.njit(cache=True)
def attempt(rng, kit, a, b, same_shape, contacts, ws, operator, large, min_parts, max_parts, with_labels):
    """Return outcome and key (0 unless OK) of a try. With REPEATED_UNIT, `b` is `a`.

    After UNKNOWN the pairs in `ws.unknown` must be resolved; then `complete` goes on.
    """
    if operator == REPEATED_UNIT:
        outcome = insert_or_remove_unit(rng, kit, a, ws)
    else:
        outcome = cut_piece(rng, a, b, ws, operator, large, kit.limits[0])
        if outcome == Outcome.OK:
            outcome = match_poses(rng, kit, a, b, same_shape, ws)
    if outcome == Outcome.OK:
        outcome = join(rng, kit, a, b, ws, min_parts, max_parts)
    if outcome != Outcome.OK:
        return outcome, np.uint64(0)
    return complete(kit, contacts, ws, with_labels)


@numba.njit(cache=True)
def complete(kit, contacts, ws, with_labels):
    """Connect a joined variant that keeps its part types; return outcome and key as in `attempt`."""
    if not keeps_types(kit, ws):
        return Outcome.IDENTITY, np.uint64(0)
    outcome = connect(kit, contacts, ws)
    return outcome, graph_key(kit.label_of, ws, with_labels) if outcome == Outcome.OK else np.uint64(0)
