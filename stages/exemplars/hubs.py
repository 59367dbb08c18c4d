"""Hubs: part types left out of the shape graph, for what touches everything pins every boundary (strings §4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.config import nearest_word
from pipeline.errors import ConfigError
from stages.exemplars.observed_grammar import observe_neighbourhoods
from stages.exemplars.settings import KitConfig
from stages.shape.arrays import IntArray
from stages.shape.kit import Assembly, ContactKind, Grammar, PartType

NO_EDGES = np.empty((0, 2), dtype=np.int32)


def hub_types(config: KitConfig, types: Sequence[PartType]) -> tuple[int, ...]:
    """The types that the config leaves out of the graphs, ascending. Raises ConfigError for a name that no type has."""
    names = [each.name for each in types]
    wanted = config.resolved().hubs
    for name in wanted:
        if name not in names:
            near = nearest_word(name, names)
            hint = f"did you mean {near!r}?" if near else f"its types are {', '.join(names)}"
            raise ConfigError(f"kit {config.name}: `hubs` names {name!r}, which is no part type of it; {hint}")
    return tuple(sorted(names.index(name) for name in wanted))


def with_touching_types(assembly: Assembly, parts: np.ndarray, types: Sequence[int]) -> np.ndarray:
    """`parts` of an assembly and those of the given `types` that touch one of them, ascending."""
    chosen = np.zeros(len(assembly), dtype=bool)
    chosen[parts] = True
    beside = np.zeros(len(assembly), dtype=bool)
    for column in (0, 1):
        beside[assembly.edges[chosen[assembly.edges[:, 1 - column]], column]] = True
    found: np.ndarray = np.flatnonzero(chosen | (beside & np.isin(assembly.types, types)))
    return found


def remove_hubs(
    hub_types: Sequence[int],
    assemblies: Sequence[Assembly],
    grammar: Grammar,
    kinds: Sequence[tuple[ContactKind, ...]],
    contacts: Sequence[IntArray],
) -> tuple[list[Assembly], list[Assembly], Grammar, list[tuple[ContactKind, ...]]]:
    """What was observed of `assemblies` as it is without the parts of `hub_types`.

    The assemblies without hubs; their hubs alone, without contacts; the grammar, in which no neighbourhood counts
    hubs, those of hubs themselves being the parts around them that are none; and the `kinds` of those `contacts` that
    join two parts that are no hubs.
    Dockings stay those of all parts. Without hubs the grammar stays as it is, for neighbourhoods go by label.
    """
    if not len(hub_types):
        return list(assemblies), [each.select(np.empty(0, dtype=np.int64)) for each in assemblies], grammar, list(kinds)
    is_hub = [np.isin(each.types, hub_types) for each in assemblies]
    bare = [each.select(np.flatnonzero(~hub)) for each, hub in zip(assemblies, is_hub, strict=True)]
    alone = [each.select(np.flatnonzero(hub)) for each, hub in zip(assemblies, is_hub, strict=True)]
    between_hubs = [hub[each.edges].all(axis=1) for each, hub in zip(assemblies, is_hub, strict=True)]
    around = observe_neighbourhoods(
        [replace(each, edges=each.edges[~both]) for each, both in zip(assemblies, between_hubs, strict=True)]
    )
    neighbourhoods = observe_neighbourhoods(bare) | {index: around[index] for index in hub_types}
    left = []
    for found, edges, hub in zip(kinds, contacts, is_hub, strict=True):
        counted = ~hub[edges].any(axis=1)
        left.append(tuple(found[index] for index in np.flatnonzero(counted).tolist()))
    rules = replace(grammar, neighbourhoods=dict(sorted(neighbourhoods.items())), hubs=tuple(hub_types))
    return bare, [replace(each, edges=NO_EDGES) for each in alone], rules, left
