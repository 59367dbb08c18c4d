"""Named tuples of arrays that compiled code works on.

`KitTables` is fixed for a kit, `ShapeTables` for a shape; `Workspace` holds the variant that is being made.
Letters of dimensions: s parts of the source shape A, t parts of the target shape B, v parts of the variant.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stages.shape.graphs.grammar_patterns import GrammarPatterns

N_EDGES, N_UNKNOWNS, N_PARTS, N_BOUNDARY, TRY_NUMBER, N_PIECE_PARTS = range(6)
"""Indices of `Workspace.counts`."""
MAX_COMPONENT_CHOICES = 64
MIN_UPRIGHT_COSINE = 0.999
"""Cosine of the vertical with its image, from which on a rigid transform counts as upright."""


class NeighbourhoodRules(NamedTuple):
    """Which neighbourhoods a grammar admits. Types are indices of labels here, as `KitTables.label_of` gives them."""

    patterns: GrammarPatterns
    is_exact: bool  # all that is admitted is in the table, since the level is `multiset`
    keys: np.ndarray  # uint64 (2^k,): open-addressing table of neighbourhoods asked for, and of all observed ones
    verdicts: np.ndarray  # int64 (2^k,): 1 admitted, 0 not
    filled: np.ndarray  # int64 (1,): number of keys


class KitTables(NamedTuple):
    """A kit for compiled code."""

    symmetry_starts: np.ndarray  # int64 (types + 1,)
    symmetries: np.ndarray  # float64 (s, 3, 3): rotations of the symmetry group of each type
    boxes: np.ndarray  # float64 (types, 2, 3): centre and half extents in part coordinates
    reach: np.ndarray  # float64 (types,): half diagonals
    weights: np.ndarray  # uint64 (types,): multiset weights of the labels
    label_of: np.ndarray  # int64 (types,): index of each type's label
    rules: NeighbourhoodRules
    limits: np.ndarray  # float64 (3,): pose tolerance, contact tolerance, quantum of contact answers
    up: int  # axis that docking transforms keep upright, or -1
    shares: np.ndarray  # float64 (labels, 2): smallest and largest share of the parts, see `share_bounds`


class ShapeTables(NamedTuple):
    """A shape for compiled code."""

    types: np.ndarray  # int64 (n,)
    rotations: np.ndarray  # float64 (n, 3, 3)
    translations: np.ndarray  # float64 (n, 3)
    starts: np.ndarray  # int64 (n + 1,): first edge of each part in `ends` and `labels`
    ends: np.ndarray  # int64 (2 m,)
    labels: np.ndarray  # int64 (2 m,): docking labels, seen from the start
    type_starts: np.ndarray  # int64 (types + 1,): first part of each type in `by_type`
    by_type: np.ndarray  # int64 (n,): parts, ordered by type


class Workspace(NamedTuple):
    """The variant that is being made, of at most `len(types)` parts."""

    inside: np.ndarray  # bool (s,): part of A is in the piece
    boundary: np.ndarray  # int64 (s,): boundary parts of A
    images: np.ndarray  # int64 (s,): their images in B
    image_of: np.ndarray  # int64 (t,): part of A whose image a part of B is, or -1
    component: np.ndarray  # int64 (t,): component of each part of B without the boundary
    keep: np.ndarray  # bool (t,): component is kept
    stack: np.ndarray  # int64: scratch
    transform: np.ndarray  # float64 (4, 3): rows of a rotation, then a translation, A -> B
    from_a: np.ndarray  # int64 (s,): part of the variant, or -1
    from_b: np.ndarray  # int64 (t,): part of the variant, or -1
    types: np.ndarray  # int64 (v,)
    rotations: np.ndarray  # float64 (v, 3, 3)
    translations: np.ndarray  # float64 (v, 3)
    origin: np.ndarray  # int64 (v,): 0 only in A, 1 only in B, 2 in both
    stamp: np.ndarray  # int64 (v, v): number of the try that set the label
    label: np.ndarray  # int64 (v, v): directed docking label
    edges: np.ndarray  # int64 (e, 2)
    unknown: np.ndarray  # int64 (u, 2): pairs whose contact is not known yet
    colour: np.ndarray  # uint64 (v,)
    fresh: np.ndarray  # uint64 (v,)
    boxes: np.ndarray  # float64 (v, 2, 3): centre and half extents in the world
    near: np.ndarray  # int64 (p, 2): pairs whose boxes overlap
    counts: np.ndarray  # int64 (8,): see N_EDGES
