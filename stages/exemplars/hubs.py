"""Hubs: part types left out of the shape graph, since what touches everything fixes every boundary (strings §4)."""

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
    """Return the types that the config leaves out of the graphs, ascending. Raises ConfigError for an unknown name."""
    names = [part_type.name for part_type in types]
    hubs = config.resolved().hubs
    for name in hubs:
        if name not in names:
            near = nearest_word(name, names)
            hint = f"did you mean {near!r}?" if near else f"its types are {', '.join(names)}"
            raise ConfigError(f"kit {config.name}: `hubs` names {name!r}, which is no part type of it; {hint}")
    return tuple(sorted(names.index(name) for name in hubs))


def with_touching_types(assembly: Assembly, parts: np.ndarray, types: Sequence[int]) -> np.ndarray:
    """Return `parts` of an assembly and those of the given `types` that touch one of them, ascending."""
    chosen = np.zeros(len(assembly), dtype=bool)
    chosen[parts] = True
    touching = np.zeros(len(assembly), dtype=bool)
    for column in (0, 1):
        touching[assembly.edges[chosen[assembly.edges[:, 1 - column]], column]] = True
    visible: np.ndarray = np.flatnonzero(chosen | (touching & np.isin(assembly.types, types)))
    return visible


def remove_hubs(
    hub_types: Sequence[int],
    assemblies: Sequence[Assembly],
    grammar: Grammar,
    kinds: Sequence[tuple[ContactKind, ...]],
    contacts: Sequence[IntArray],
) -> tuple[list[Assembly], list[Assembly], Grammar, list[tuple[ContactKind, ...]]]:
    """Remove the parts of `hub_types` from what was observed of `assemblies`.

    Returns the assemblies without hubs; their hubs alone, without contacts; the grammar; and the `kinds` of those
    `contacts` that join two other parts. Neighbourhoods of the grammar do not count hubs; the neighbourhood of a hub
    holds its neighbours that are no hubs. Dockings stay those of all parts. Without hub types the grammar is unchanged.
    """
    if not len(hub_types):
        return (
            list(assemblies),
            [assembly.select(np.empty(0, dtype=np.int64)) for assembly in assemblies],
            grammar,
            list(kinds),
        )
    is_hub = [np.isin(assembly.types, hub_types) for assembly in assemblies]
    bare = [assembly.select(np.flatnonzero(~hub)) for assembly, hub in zip(assemblies, is_hub, strict=True)]
    hubs = [assembly.select(np.flatnonzero(hub)) for assembly, hub in zip(assemblies, is_hub, strict=True)]
    between_hubs = [hub[assembly.edges].all(axis=1) for assembly, hub in zip(assemblies, is_hub, strict=True)]
    around = observe_neighbourhoods(
        [
            replace(assembly, edges=assembly.edges[~both])
            for assembly, both in zip(assemblies, between_hubs, strict=True)
        ]
    )
    neighbourhoods = observe_neighbourhoods(bare) | {index: around[index] for index in hub_types}
    kept_kinds = []
    for of_contacts, edges, hub in zip(kinds, contacts, is_hub, strict=True):
        counted = ~hub[edges].any(axis=1)
        kept_kinds.append(tuple(of_contacts[index] for index in np.flatnonzero(counted).tolist()))
    grammar = replace(grammar, neighbourhoods=dict(sorted(neighbourhoods.items())), hubs=tuple(hub_types))
    return bare, [replace(assembly, edges=NO_EDGES) for assembly in hubs], grammar, kept_kinds
