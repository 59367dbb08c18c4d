"""Build a kit from models: part types, contacts, shape graphs and the tiling grammar (strings §3)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import ConfigError
from stages.exemplars.diagnostics import connected_pieces, kit_warnings, listed_names, refusals
from stages.exemplars.hubs import hub_types, remove_hubs, with_touching_types
from stages.exemplars.identify import IdentifiedParts, identify_parts
from stages.exemplars.inferred_dockings import infer_dockings
from stages.exemplars.model import Model
from stages.exemplars.node_groups import groups_of_models
from stages.exemplars.observed_grammar import observe_contacts, observe_grammar
from stages.exemplars.read import read_parts
from stages.exemplars.row_neighbourhoods import with_row_neighbourhoods
from stages.exemplars.settings import KitConfig
from stages.model_files.scene import UniqueNames
from stages.shape.arrays import IntArray
from stages.shape.geometry.contact import ContactTest
from stages.shape.kit import EMPTY_ASSEMBLY, Assembly, ContactKind, Exemplar, Kit


@dataclass(frozen=True)
class Observation:
    """What models hold, whether or not a run can use them.

    kit: the parts that have area, in the models' order; the edges of its exemplars are the contacts that count.
    contacts: all contacts of each exemplar, int32 (m, 2), i < j in lexicographic order.
    kinds: the kinds of these contacts.
    repairs: number of repairs by kind.
    aliases: for each type with several names in the models, its other names.
    refusals: why a run does not start with these models, each with its remedy.
    warnings: a sentence each.
    """

    kit: Kit
    contacts: tuple[IntArray, ...]
    kinds: tuple[tuple[ContactKind, ...], ...]
    repairs: Mapping[str, int]
    aliases: Mapping[str, tuple[str, ...]]
    refusals: tuple[str, ...]
    warnings: tuple[str, ...]


def read_kit(config: KitConfig) -> Kit:
    """Return the kit of the model files of `config`. Raises ConfigError, as `build_kit` and `read_parts` do."""
    texture_size = config.appearance.kept_texture_size
    models = [
        read_parts(shape.path, config.parts, units=config.units, texture_size=texture_size) for shape in config.shapes
    ]
    return build_kit(config, models)[0]


def build_kit(config: KitConfig, models: Sequence[Model]) -> tuple[Kit, Observation]:
    """Return the kit of `models`, and the observation that it comes from.

    Raises ConfigError, with the model, the part and the remedy, if no kit can be made.
    """
    observation = observe_models(config, models)
    if observation.refusals:
        raise ConfigError("\n".join(observation.refusals))
    return observation.kit, observation


def observe_models(config: KitConfig, models: Sequence[Model]) -> Observation:
    """Return what `models` hold, even if they make no kit; as `observe_parts`."""
    return observe_parts(config, models, identify_parts(models, config))


def observe_parts(config: KitConfig, models: Sequence[Model], identified: IdentifiedParts) -> Observation:
    """Return what `models`, whose parts are `identified`, hold, even if they make no kit.

    Hubs that the config leaves out are not in the exemplars. If they are restored later, they are types of the kit, and
    its grammar holds what was observed around them. With `disconnected: largest` only the largest piece of the rest of
    each exemplar is kept. Raises ConfigError for a model in which no part has any area, or nothing but hubs, for hubs
    that are no types, and for a config with a key at `auto`.
    """
    settings = config.resolved()
    types, aliases, names = identified.types, identified.aliases, list(identified.part_names)
    median = identified.median_diagonal
    contact = ContactTest(types, settings.tolerance * median)
    pose_tolerance = config.pose_tolerance * median
    touching = [
        replace(assembly, edges=contact.contacts(assembly.types, assembly.poses)) for assembly in identified.assemblies
    ]
    contacts = observe_contacts(types, touching, contact, pose_tolerance, settings.kinds)
    hubs = hub_types(config, types)
    hub_names = [types[index].name for index in hubs]
    kept, warnings = _kept_parts(config, models, identified, contacts.counted, hubs)
    if all(len(keep) == len(assembly) for keep, assembly in zip(kept, touching, strict=True)):
        grammar = observe_grammar(types, touching, contacts, settings.kinds, identified.depths)
        assemblies, kinds, hub_parts = contacts.counted, contacts.kinds, [EMPTY_ASSEMBLY] * len(touching)
    else:
        # Classes of dockings, their order and their poses are those of the parts that are kept.
        restored = hubs if config.hubs.restore else ()
        visible = [
            with_touching_types(assembly, keep, restored) for assembly, keep in zip(contacts.counted, kept, strict=True)
        ]
        everything = [assembly.select(parts) for assembly, parts in zip(touching, visible, strict=True)]
        used = np.unique(np.concatenate([assembly.types for assembly in everything]))
        types, aliases = tuple(types[index] for index in used), tuple(aliases[index] for index in used)
        everything = [
            replace(assembly, types=np.searchsorted(used, assembly.types).astype(np.int16)) for assembly in everything
        ]
        contact = ContactTest(types, contact.tolerance)
        contacts = observe_contacts(types, everything, contact, pose_tolerance, settings.kinds)
        grammar = observe_grammar(types, everything, contacts, settings.kinds, identified.depths)
        removed = np.flatnonzero(np.isin(used, restored)).tolist()
        edges = [assembly.edges for assembly in everything]
        assemblies, hub_parts, grammar, kinds = remove_hubs(removed, contacts.counted, grammar, contacts.kinds, edges)
        names = [tuple(words[part] for part in keep.tolist()) for words, keep in zip(names, kept, strict=True)]
        touching = [assembly.select(keep) for assembly, keep in zip(touching, kept, strict=True)]
    if config.types == "meaning":
        fit_tolerance = config.fit_tolerance * median
        inferred = infer_dockings(types, assemblies, grammar.dockings, contact, fit_tolerance, pose_tolerance)
        grammar = replace(grammar, dockings=(*grammar.dockings, *inferred))
    kit = Kit(
        name=config.name,
        types=types,
        exemplars=tuple(map(Exemplar, _exemplar_names(models), assemblies, names, hub_parts)),
        grammar=replace(grammar, strictness=settings.grammar),
        contact_tolerance=contact.tolerance,
        pose_tolerance=pose_tolerance,
        contact_kinds=settings.kinds,
        up=settings.up,
        one_surface=all(model.is_cut for model in models),
        unit="metre" if all(model.unit == 1.0 for model in models) else "unknown",
        groups=groups_of_models(models, names, assemblies, types),
    )
    if config.row_neighbourhoods:
        kit = replace(kit, grammar=with_row_neighbourhoods(kit))
    return Observation(
        kit=kit,
        contacts=tuple(assembly.edges for assembly in touching),
        kinds=tuple(kinds),
        repairs=identified.repairs,
        aliases={kind.name: words for kind, words in zip(types, aliases, strict=True) if words},
        refusals=tuple(refusals(kit, models, hub_names, settings.tolerance)),
        warnings=(*warnings, *kit_warnings(kit)),
    )


def _kept_parts(
    config: KitConfig,
    models: Sequence[Model],
    identified: IdentifiedParts,
    assemblies: Sequence[Assembly],
    hubs: Sequence[int],
) -> tuple[list[np.ndarray], list[str]]:
    """Return the parts of each assembly, ascending, without hubs and dropped pieces; and warnings.

    The warnings are those of the models and of what is left out. Raises ConfigError if nothing is kept of a model.
    """
    types = identified.types
    warnings = [f"{model.path.name}: {warning}" for model in models for warning in model.warnings]
    unknown = [model.path.name for model in models if model.unit is None]
    if 0 < len(unknown) < len(models):
        warnings.append(f"no unit is known for {listed_names(unknown)}, others are in metres; set `units` of the kit")
    for model in models:
        left_out = [f"{part} ({why})" for owner, part, why in identified.left_out if owner is model]
        if left_out:
            parts = "1 part is" if len(left_out) == 1 else f"{len(left_out)} parts are"
            warnings.append(f"{model.path.name}: {parts} left out of the model: {listed_names(left_out)}")
        others = [part for owner, part in identified.other_looks if owner is model]
        if others:
            parts = "1 part has" if len(others) == 1 else f"{len(others)} parts have"
            warnings.append(
                f"{model.path.name}: {parts} other colours or materials than the first part of their type, whose look "
                f"all have: {listed_names(others)}"
            )
    kept = [np.flatnonzero(~np.isin(assembly.types, hubs)) for assembly in assemblies]
    for model, assembly, keep in zip(models, assemblies, kept, strict=True):
        if not len(keep):
            raise ConfigError(f"{model.path}: every part of it is of a hub type; name fewer types in `hubs`")
        if len(keep) < len(assembly):
            named = ", ".join(types[index].name for index in np.intersect1d(hubs, assembly.types))
            warnings.append(f"{model.path.name}: {len(assembly) - len(keep)} hubs are left out of the graph: {named}")
    if config.resolved().disconnected == "largest":
        for index, (assembly, model) in enumerate(zip(assemblies, models, strict=True)):
            apart = kept[index][connected_pieces(assembly.select(kept[index])) > 0]
            if len(apart):
                left = ", ".join(identified.part_names[index][part] for part in apart[:5].tolist())
                warnings.append(f"{model.path.name}: {len(apart)} parts apart from the rest are left out: {left}")
                kept[index] = np.setdiff1d(kept[index], apart)
    return kept, warnings


def _exemplar_names(models: Sequence[Model]) -> list[str]:
    """Return the names of the files; if those are equal (all are `model.glb`), the names of their folders."""
    stems = [model.path.stem for model in models]
    unique = UniqueNames()
    return [
        unique(model.path.resolve().parent.name if stems.count(model.path.stem) > 1 else model.path.stem)
        for model in models
    ]
