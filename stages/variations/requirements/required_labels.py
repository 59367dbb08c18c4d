"""The carcass of a kit: what is as large as an exemplar itself, without which a variant is no more than a piece of one.

A cabinet is seen by its top, sides and back; what is left when these are gone is drawers, however well they fit. A
castle of tiles has no such parts.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from stages.shape.arrays import BoolArray
from stages.shape.geometry.contact import world_boxes
from stages.shape.kit import Assembly, Exemplar, Kit
from stages.variations.requirements.named_labels import named_labels

SPAN = 2 / 3
"""A part belongs to the carcass if the diagonal of its box is so much of the exemplar's."""
LABELS_MISSING = "without its carcass"
"""Why a variant is refused that lacks a part of the carcass."""


def spanning_labels(kit: Kit) -> tuple[str, ...]:
    """The labels of the carcass, in the order of the kit's: of each, every exemplar has a part that spans it. Hubs are
    none of it, for they are put back behind finished shapes."""
    spanning = [_spanning(kit, each) for each in kit.exemplars]
    return tuple(name for label, name in enumerate(kit.labels) if all(label in each for each in spanning))


def labels_test(kit: Kit, required: Sequence[str]) -> Callable[[Assembly], bool]:
    """Whether an assembly has a part of each of the labels `required`. Raises ConfigError for one that no part has."""
    asked = set(np.flatnonzero(named_labels(kit, required, "variations.require.labels")).tolist())
    return lambda assembly: asked <= set(kit.label_of[assembly.types].tolist())


def spanning_hubs(kit: Kit) -> dict[int, int]:
    """The hubs that would be of the carcass, such as the sides of a cabinet, by type, and how many of each the exemplar
    has that has fewest: a shape with half of them is no whole one."""
    counts = [Counter(each.whole.types[_spans(kit, each)].tolist()) for each in kit.exemplars]
    fewest = {hub: min(each[hub] for each in counts) for hub in kit.grammar.hubs}
    return {hub: count for hub, count in fewest.items() if count}


def _spanning(kit: Kit, exemplar: Exemplar) -> set[int]:
    types = exemplar.whole.types
    bare = _spans(kit, exemplar) & ~np.isin(types, kit.grammar.hubs)
    found: set[int] = set(kit.label_of[types[bare]].tolist())
    return found


def _spans(kit: Kit, exemplar: Exemplar) -> BoolArray:
    """Which parts of an exemplar, hubs among them, are about as large as itself."""
    whole = exemplar.whole
    boxes = world_boxes(kit.types, whole.types, whole.poses)
    extent = np.linalg.norm(boxes[:, 1].max(axis=0) - boxes[:, 0].min(axis=0))
    spans: BoolArray = np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1) >= SPAN * extent
    return spans
