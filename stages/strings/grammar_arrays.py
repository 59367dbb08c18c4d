"""The arrays of a compiled tiling grammar (strings §3)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

ANY_SIZE = -1
"""Size of a pattern that fits any number of neighbours."""
MAX_NEIGHBOURS = 1 << 14
"""Of one type."""
NO_COMPLETION = 1 << 28
"""Tokens to complete a node that cannot be completed."""


class CompiledGrammar(NamedTuple):
    """Patterns of complete neighbourhoods by type, and what follows from them, as arrays for compiled code."""

    first: np.ndarray  # int64 (types + 1,): the patterns of type t are rows first[t] to first[t + 1]
    low: np.ndarray  # int64 (patterns, types): least neighbours of each type
    high: np.ndarray  # int64 (patterns, types): most neighbours of each type
    size: np.ndarray  # int64 (patterns,): counted neighbours in all, or ANY_SIZE
    loose: np.ndarray  # bool (patterns,): uncounted neighbours fit, too
    counted: np.ndarray  # bool (types,): neighbours of the type count; those of hubs do not
    partial: bool  # strings have some contacts only: a node is complete with fewer neighbours
    cost: np.ndarray  # int64 (types, types): fewest tokens of a subtree with root `column` below a `row`
    arc: np.ndarray  # int64 (types, types): number of the pair of neighbour types (row, column), or -1
    closes: np.ndarray  # bool (arcs, arcs): the subtree below the first pair can close a cycle that is the second pair
    closes_below: np.ndarray  # bool (arcs, arcs): the same, without the root of the subtree
