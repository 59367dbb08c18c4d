"""What the compiled kernels of a try work on; numba makes the constants part of them.

All arrays live in four tuples: `KitTables` (fixed for a kit), `ShapeTables` (fixed for a shape),
`ContactTable` and `Workspace` (the try in hand). Indices below: `s` parts of the source shape A, `t`
parts of the target shape B, `v` parts of the variant.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class NeighbourhoodRules(NamedTuple):
    """Which neighbourhoods the grammar admits, by rule: what a loose grammar admits is too much to be listed.

    Types are places of labels here, `KitTables.label_of`.
    level: 0 `multiset`, 1 `count_and_set`, 2 `count_and_pairs`, 3 `count_and_types`, 4 one of slots, of which only the
    types around a part can be told here.
    keys uint64 (c,), verdicts int64 (c,): an open-addressing table of neighbourhoods that were asked for, 1 where they
    are admitted; at level 0 those observed, which are all. filled int64 (1,): how many it holds.
    sizes bool (types, k): whether a part of a type may have so many neighbours.
    set_weights uint64 (types,); sets uint64 (m,): sorted keys of a type with a number and a set of neighbour types.
    local int32 (types, types): number of a type among those seen around another, or -1; pair_starts int64 (types,)
    and pairs bool (p,): from there, row by row, whether two of them were seen around one part.
    """

    level: int
    keys: np.ndarray
    verdicts: np.ndarray
    filled: np.ndarray
    sizes: np.ndarray
    set_weights: np.ndarray
    sets: np.ndarray
    local: np.ndarray
    pair_starts: np.ndarray
    pairs: np.ndarray


class KitTables(NamedTuple):
    """A kit for the kernels.

    symmetry_starts int64 (types + 1,), symmetries float64 (s, 3, 3): rotations of each type's group;
    boxes float64 (types, 2, 3): centre and half extents in part coordinates; reach float64 (types,): half diagonals;
    weights uint64 (types,): multiset weights of their labels; label_of int64 (types,): places of
    the labels; rules: the neighbourhoods that the grammar admits;
    limits float64 (3,): pose tolerance, contact tolerance, quantum of the answers; up: the axis that docking motions
    must keep upright, or -1.
    """

    symmetry_starts: np.ndarray
    symmetries: np.ndarray
    boxes: np.ndarray
    reach: np.ndarray
    weights: np.ndarray
    label_of: np.ndarray
    rules: NeighbourhoodRules
    limits: np.ndarray
    up: int


class ShapeTables(NamedTuple):
    """A shape for the kernels: types int64 (n,), rotations float64 (n, 3, 3), translations float64 (n, 3), the shape
    graph as starts int64 (n + 1,), ends int64 (2 m,), labels int64 (2 m,) seen from the start, and the parts of each
    type as type_starts int64 (types + 1,), by_type int64 (n,).
    """

    types: np.ndarray
    rotations: np.ndarray
    translations: np.ndarray
    starts: np.ndarray
    ends: np.ndarray
    labels: np.ndarray
    type_starts: np.ndarray
    by_type: np.ndarray


class ContactTable(NamedTuple):
    """An open-addressing table: keys uint64 (c,), 0 where free; values int64 (c,): NONE, FORBIDDEN or a packed pair of
    labels."""

    keys: np.ndarray
    values: np.ndarray


class Workspace(NamedTuple):
    """The try in hand, for variants of at most `len(types)` parts."""

    inside: np.ndarray  # bool, part of A is in the piece
    boundary: np.ndarray  # int64, boundary parts of A
    images: np.ndarray  # int64, their images in B
    image_of: np.ndarray  # int64, B part -> A part it stands for, or -1
    component: np.ndarray  # int64, component of each part of B without the boundary
    keep: np.ndarray  # bool, component is kept
    stack: np.ndarray  # int64 scratch
    motion: np.ndarray  # float64 (4, 3): rotation rows and translation, A -> B
    from_a: np.ndarray  # int64, A part -> v or -1
    from_b: np.ndarray  # int64, B part -> v or -1
    types: np.ndarray  # int64 (v,)
    rotations: np.ndarray  # float64 (v, 3, 3)
    translations: np.ndarray  # float64 (v, 3)
    origin: np.ndarray  # int64 (v,): 0 only in A, 1 only in B, 2 in both
    stamp: np.ndarray  # int64 (v, v): number of the try that set the label
    label: np.ndarray  # int64 (v, v): directed docking label
    edges: np.ndarray  # int64 (e, 2)
    unknown: np.ndarray  # int64 (u, 2): pairs whose contact is not yet known
    colour: np.ndarray  # uint64 (v,)
    fresh: np.ndarray  # uint64 (v,)
    boxes: np.ndarray  # float64 (v, 2, 3)
    near: np.ndarray  # int64 (p, 2): pairs whose boxes overlap
    counts: np.ndarray  # int64 (8,): by EDGES, UNKNOWNS, PARTS, BOUNDARY, TRY, PIECE


class _Outcomes(NamedTuple):
    """What a kernel says of a try."""

    OK: int = 0
    WHOLE: int = 1
    NO_SUCH_PART: int = 2
    NO_MATCH: int = 3
    NOTHING_ATTACHED: int = 4
    TOO_SMALL: int = 5
    TOO_LARGE: int = 6
    CLASH: int = 7
    GRAMMAR: int = 8
    UNKNOWN: int = 9
    ASKEW: int = 10
    KNOWN: int = 11


Outcome = _Outcomes()
EDGES, UNKNOWNS, PARTS, BOUNDARY, TRY, PIECE = 0, 1, 2, 3, 4, 5
"""Places in `Workspace.counts`: numbers of edges, unknown pairs, parts of the variant, boundary parts, tries so far
and parts of the piece."""
GROWN, PLANES, JOINTS, MEANINGS, NOTHING, REPLACED, UNITS = 0, 1, 2, 3, 4, 5, 6
"""Ways of cutting; by meanings is substitution, no cut of the exchange, and nothing is cut where shapes are grown; what
is replaced is listed, not cut; by units what repeats in a row of a shape is repeated once more, or removed."""
NONE, FORBIDDEN, MISSING = -1, -2, -9
"""Contact answers that are no pair of labels: apart, never to be, not asked yet."""
LABELS = 1 << 20
"""An answer is a first label times this and a second."""
CHOICES = 64
"""Choices of components that are tried where there are too many to try all."""
UPRIGHT = 0.999
"""Least cosine of the vertical with itself after a motion that keeps it upright."""
