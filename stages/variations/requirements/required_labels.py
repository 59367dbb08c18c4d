"""Required labels: parts that span an exemplar, without which a variant is only a piece of one.

A cabinet is its top, sides and back; without these only drawers are left. A castle of tiles has no such parts.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from stages.shape.arrays import BoolArray
from stages.shape.geometry.contact import world_boxes
from stages.shape.kit import Assembly, Exemplar, Kit
from stages.variations.requirements.named_labels import named_labels

MIN_SPAN = 2 / 3
"""A part spans an exemplar if the diagonal of its box is at least this share of the exemplar's."""
LABELS_MISSING = "required labels missing"
"""Reject reason of a variant that lacks a part of a required label."""


def spanning_labels(kit: Kit) -> tuple[str, ...]:
    """Return the labels, in the kit's order, for which every exemplar has a spanning part. Hubs do not count."""
    spanning = [_spanning(kit, exemplar) for exemplar in kit.exemplars]
    return tuple(name for label, name in enumerate(kit.labels) if all(label in labels for labels in spanning))


def labels_test(kit: Kit, required: Sequence[str]) -> Callable[[Assembly], bool]:
    """Return a test whether an assembly has a part of each required label. Raise ConfigError for a label that no part
    has.
    """
    labels = set(np.flatnonzero(named_labels(kit, required, "variations.require.labels")).tolist())
    return lambda assembly: labels <= set(kit.label_of[assembly.types].tolist())


def spanning_hubs(kit: Kit) -> dict[int, int]:
    """Return the hub types that span an exemplar, such as cabinet sides, with the smallest number of them in an
    exemplar.
    """
    counts = [Counter(exemplar.whole.types[_spans(kit, exemplar)].tolist()) for exemplar in kit.exemplars]
    smallest = {hub: min(types[hub] for types in counts) for hub in kit.grammar.hubs}
    return {hub: count for hub, count in smallest.items() if count}


def _spanning(kit: Kit, exemplar: Exemplar) -> set[int]:
    types = exemplar.whole.types
    bare = _spans(kit, exemplar) & ~np.isin(types, kit.grammar.hubs)
    labels: set[int] = set(kit.label_of[types[bare]].tolist())
    return labels


def _spans(kit: Kit, exemplar: Exemplar) -> BoolArray:
    """Return which parts of an exemplar, hubs included, span it, bool (n,)."""
    whole = exemplar.whole
    boxes = world_boxes(kit.types, whole.types, whole.poses)
    extent = np.linalg.norm(boxes[:, 1].max(axis=0) - boxes[:, 0].min(axis=0))
    spans: BoolArray = np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1) >= MIN_SPAN * extent
    return spans
