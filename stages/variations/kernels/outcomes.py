"""How a step of a compiled search ends: one set of codes for exchange, growth and instantiation."""

from __future__ import annotations

from typing import NamedTuple


class _Outcomes(NamedTuple):
    OK: int = 0
    WHOLE: int = 1  # the cut took the whole shape
    NO_SUCH_PART: int = 2  # A boundary part has no counterpart in the other shape
    NO_MATCH: int = 3
    NOTHING_ATTACHED: int = 4
    TOO_SMALL: int = 5
    TOO_LARGE: int = 6
    CLASH: int = 7
    GRAMMAR: int = 8  # the grammar does not admit a neighbourhood
    UNKNOWN: int = 9  # contacts must be asked of the oracle first
    ASKEW: int = 10  # the boundaries are rotated against each other
    KNOWN: int = 11  # the shape was found before
    CONFLICT: int = 12  # a domain is empty: the last decision must be undone
    NO_ROOM: int = 13  # an array is full
    SOLVED: int = 14  # every node of a graph is placed
    IMPOSSIBLE: int = 15  # the search space is exhausted
    BUDGET: int = 16  # the work allowed is used up
    IDENTITY: int = 17  # a part type is missing, or its share is out of bounds


Outcome = _Outcomes()
"""One instance, whose fields numba compiles as constants."""
