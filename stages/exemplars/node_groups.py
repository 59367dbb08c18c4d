"""Groups of parts that the node trees of models name."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import numpy as np

from stages.exemplars.model import Model
from stages.shape.geometry.pose import invert
from stages.shape.kit import Assembly, PartGroup, PartType

_NUMBER = re.compile(r"(?<=.)[.~_]\d+$")
"""Suffix by which exporters distinguish nodes of one name."""
MAX_GROUPS = 1000
"""Groups of a kit; of more, the largest are kept."""


def groups_of_models(
    models: Sequence[Model],
    part_names: Sequence[Sequence[str]],
    assemblies: Sequence[Assembly],
    types: Sequence[PartType],
) -> tuple[PartGroup, ...]:
    """Return the groups of all models, larger ones first.

    part_names, assemblies: of each model, the parts that are used
    """
    found = [
        group
        for model, names, assembly in zip(models, part_names, assemblies, strict=True)
        for group in _groups_of_model(model, names, assembly, types)
    ]
    return tuple(sorted(found, key=lambda group: -len(group.parts))[:MAX_GROUPS])


def _groups_of_model(
    model: Model, part_names: Sequence[str], assembly: Assembly, types: Sequence[PartType]
) -> Iterator[PartGroup]:
    """Yield a group for each node with two or more parts at or below it, but not all, and not those of its parent."""
    node_of = {part.name: part.node for part in model.parts}
    below: list[list[int]] = [[] for _ in model.nodes]
    for place, name in enumerate(part_names):
        node = node_of[name]
        while node is not None and node >= 0:
            below[node].append(place)
            node = model.nodes[node].parent
    for described, parts in zip(model.nodes, below, strict=True):
        of_parent = below[described.parent] if described.parent >= 0 else range(len(part_names))
        if 1 < len(parts) < min(len(part_names), len(of_parent) or len(part_names)):
            base = invert(assembly.poses[parts[0]])
            name = _NUMBER.sub("", described.name.rpartition("/")[2]) or "group"
            kinds = tuple(types[kind] for kind in assembly.types[parts].tolist())
            yield PartGroup(name, kinds, np.asarray(base @ assembly.poses[parts]))
