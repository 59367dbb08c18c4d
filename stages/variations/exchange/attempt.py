"""One try in one call: cut, match by poses, join, connect, and the key by which duplicates are told (strings §4)."""

from __future__ import annotations

import numba
import numpy as np

from stages.variations.exchange.cuts import cut
from stages.variations.exchange.joins import join
from stages.variations.exchange.pose_matching import match_poses
from stages.variations.exchange.repeated_units import shift
from stages.variations.kernels.checks import connect
from stages.variations.kernels.graph_key import graph_key
from stages.variations.kernels.structs import PIECE, UNITS, Outcome

SMALL, NEARLY_ALL = 0.2, 0.8
"""A piece with a share of parts between these is a large cut, one that can change a shape as a whole."""
RECUTS = 4
"""Cuts made at most until one is large."""


@numba.njit(cache=True)
def cut_piece(rng, a, b, ws, way, large, slack):
    """Cut a piece out of A; where it must be large it is cut anew while it is small or nearly everything."""
    parts = len(a.types)
    outcome = cut(rng, a, b, ws, way, slack)
    for _ in range(RECUTS - 1 if large else 0):
        if outcome == Outcome.OK and SMALL * parts <= ws.counts[PIECE] <= NEARLY_ALL * parts:
            break
        outcome = cut(rng, a, b, ws, way, slack)
    return outcome


@numba.njit(cache=True)
def attempt(rng, kit, a, b, same_shape, answers, ws, way, large, smallest, largest, with_labels):
    """Outcome and key (0 unless OK) of a try; by UNITS, `b` is `a`. After UNKNOWN the pairs in `ws.unknown` must be
    answered, and `complete` goes on."""
    if way == UNITS:
        outcome = shift(rng, kit, a, ws)
    else:
        outcome = cut_piece(rng, a, b, ws, way, large, kit.limits[0])
        if outcome == Outcome.OK:
            outcome = match_poses(rng, kit, a, b, same_shape, ws)
    if outcome == Outcome.OK:
        outcome = join(rng, kit, a, b, ws, smallest, largest)
    if outcome != Outcome.OK:
        return outcome, np.uint64(0)
    return complete(kit, answers, ws, with_labels)


@numba.njit(cache=True)
def complete(kit, answers, ws, with_labels):
    """Connect a joined variant; outcome and key as in `attempt`."""
    outcome = connect(kit, answers, ws)
    return outcome, graph_key(kit.label_of, ws, with_labels) if outcome == Outcome.OK else np.uint64(0)
