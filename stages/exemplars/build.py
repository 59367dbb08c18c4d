"""From models to a kit: part types, contacts, shape graphs and the tiling grammar (strings §3)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from pipeline.errors import ConfigError
from stages.exemplars.diagnostics import connected_pieces, kit_warnings, listed_names, refusals
from stages.exemplars.formats.scene import UniqueNames
from stages.exemplars.hubs import hub_types, remove_hubs, with_touching_types
from stages.exemplars.identify import IdentifiedParts, identify_parts
from stages.exemplars.inferred_dockings import infer_dockings
from stages.exemplars.model import Model
from stages.exemplars.observed_grammar import observe_contacts, observe_grammar
from stages.exemplars.read import read_model
from stages.exemplars.settings import KitConfig
from stages.shape.arrays import IntArray
from stages.shape.geometry.contact import ContactTest
from stages.shape.kit import EMPTY_ASSEMBLY, Assembly, ContactKind, Exemplar, Kit


@dataclass(frozen=True)
class KitReport:
    """What building a kit found and did: segmentation of each model, repairs, contacts by kind, warnings, and for each
    type that the models call by several names the names beside its own."""

    segmentation: tuple[str, ...]
    repairs: Mapping[str, int]
    contacts: Mapping[ContactKind, int]
    contact_tolerance: float
    warnings: tuple[str, ...]
    aliases: Mapping[str, tuple[str, ...]]


@dataclass(frozen=True)
class Observation:
    """What is in some models, whether or not a run can make anything of it.

    kit: the parts that have area, in the models' order; the edges of its exemplars are the contacts that count.
    contacts: all contacts of each exemplar, int32 (m, 2), i < j in lexicographic order; kinds: their kinds.
    aliases: for each type that the models call by several names the names beside its own.
    refusals: why a run does not start with these models, each with its mend; empty where it does.
    """

    kit: Kit
    contacts: tuple[IntArray, ...]
    kinds: tuple[tuple[ContactKind, ...], ...]
    repairs: Mapping[str, int]
    aliases: Mapping[str, tuple[str, ...]]
    refusals: tuple[str, ...]
    warnings: tuple[str, ...]


def read_kit(config: KitConfig) -> Kit:
    """The kit of the model files of `config`. Raises ConfigError, as `build_kit` and `read_model` do."""
    kit, _ = build_kit(config, [read_model(shape.path, config.parts) for shape in config.shapes])
    return kit


def build_kit(config: KitConfig, models: Sequence[Model]) -> tuple[Kit, KitReport]:
    """The kit of `models`, and what was found on the way.

    Raises ConfigError, with the model, the part and the mend, where no kit can be made.
    """
    seen = observe_models(config, models)
    if seen.refusals:
        raise ConfigError("\n".join(seen.refusals))
    found = [kind for kinds in seen.kinds for kind in kinds]
    report = KitReport(
        segmentation=tuple(f"{model.path.name}: {model.segmentation}: {model.why}" for model in models),
        repairs=seen.repairs,
        contacts={kind: found.count(kind) for kind in get_args(ContactKind)},
        contact_tolerance=seen.kit.contact_tolerance,
        warnings=seen.warnings,
        aliases=seen.aliases,
    )
    return seen.kit, report


def observe_models(config: KitConfig, models: Sequence[Model]) -> Observation:
    """What Shapemill sees in `models`, also where it could make no kit of them; as `observe_parts`."""
    return observe_parts(config, models, identify_parts(models, config))


def observe_parts(config: KitConfig, models: Sequence[Model], identified: IdentifiedParts) -> Observation:
    """What Shapemill sees in `models`, whose parts are `identified`, also where it could make no kit of them.

    Hubs that the config leaves out are not in the exemplars; those kept as backdrop are types of the kit, and what
    was seen around them and between them and others is in its grammar. With `disconnected: largest` only the largest
    piece of what is left of each exemplar is seen. Raises ConfigError for a model in which no part has any area, or
    nothing but hubs, for hubs that are no types, and for a config that leaves a key at `auto`.
    """
    made = config.resolved()
    types, aliases, names = identified.types, identified.aliases, list(identified.part_names)
    median = identified.median_diagonal
    contact = ContactTest(types, made.tolerance * median)
    pose_tolerance, counted = config.pose_tolerance * median, made.kinds
    touching = [replace(each, edges=contact.contacts(each.types, each.poses)) for each in identified.assemblies]
    contacts = observe_contacts(types, touching, contact, pose_tolerance, counted)
    hubs = hub_types(config, types)
    left_out = [types[index].name for index in hubs]
    kept, warnings = _kept_parts(config, models, identified, contacts.counted, hubs)
    is_whole = all(len(keep) == len(each) for keep, each in zip(kept, touching, strict=True))
    if is_whole:
        grammar = observe_grammar(types, touching, contacts, counted)
        assemblies, kinds, backdrops = contacts.counted, contacts.kinds, [EMPTY_ASSEMBLY] * len(touching)
    else:
        # Classes of dockings, their order and their poses are those of the parts that are seen.
        backdrop = hubs if config.hubs.restore else ()
        seen = [with_touching_types(each, keep, backdrop) for each, keep in zip(contacts.counted, kept, strict=True)]
        everything = [each.select(parts) for each, parts in zip(touching, seen, strict=True)]
        used = np.unique(np.concatenate([each.types for each in everything]))
        types, aliases = tuple(types[index] for index in used), tuple(aliases[index] for index in used)
        everything = [replace(each, types=np.searchsorted(used, each.types).astype(np.int16)) for each in everything]
        contact = ContactTest(types, contact.tolerance)
        contacts = observe_contacts(types, everything, contact, pose_tolerance, counted)
        grammar = observe_grammar(types, everything, contacts, counted)
        aside = np.flatnonzero(np.isin(used, backdrop)).tolist()
        edges = [each.edges for each in everything]
        assemblies, backdrops, grammar, kinds = remove_hubs(aside, contacts.counted, grammar, contacts.kinds, edges)
        names = [tuple(words[part] for part in keep.tolist()) for words, keep in zip(names, kept, strict=True)]
        touching = [each.select(keep) for each, keep in zip(touching, kept, strict=True)]
    if config.types == "meaning":
        fits = infer_dockings(
            types, assemblies, grammar.dockings, contact, config.fit_tolerance * median, pose_tolerance
        )
        grammar = replace(grammar, dockings=(*grammar.dockings, *fits))
    kit = Kit(
        name=config.name,
        types=types,
        exemplars=tuple(map(Exemplar, _exemplar_names(models), assemblies, names, backdrops)),
        grammar=replace(grammar, strictness=made.grammar),
        contact_tolerance=contact.tolerance,
        pose_tolerance=pose_tolerance,
        contact_kinds=made.kinds,
        up=made.up,
        one_surface=all(each.is_cut for each in models),
    )
    return Observation(
        kit=kit,
        contacts=tuple(each.edges for each in touching),
        kinds=tuple(kinds),
        repairs=identified.repairs,
        aliases={each.name: words for each, words in zip(types, aliases, strict=True) if words},
        refusals=tuple(refusals(kit, models, left_out, made.tolerance)),
        warnings=(*warnings, *kit_warnings(kit)),
    )


def _kept_parts(
    config: KitConfig,
    models: Sequence[Model],
    identified: IdentifiedParts,
    assemblies: Sequence[Assembly],
    hubs: Sequence[int],
) -> tuple[list[np.ndarray], list[str]]:
    """The parts of each of `assemblies`, ascending, that are no hubs and in no piece that the config leaves out; and
    the warnings of the models and of what is left out. Raises ConfigError where nothing is kept of a model."""
    types = identified.types
    warnings = [f"{model.path.name}: {warning}" for model in models for warning in model.warnings]
    for model in models:
        left_out = [f"{part} ({why})" for owner, part, why in identified.left_out if owner is model]
        if left_out:
            parts = "1 part is" if len(left_out) == 1 else f"{len(left_out)} parts are"
            warnings.append(f"{model.path.name}: {parts} left out of the model: {listed_names(left_out)}")
    kept = [np.flatnonzero(~np.isin(each.types, hubs)) for each in assemblies]
    for model, each, keep in zip(models, assemblies, kept, strict=True):
        if not len(keep):
            raise ConfigError(f"{model.path}: every part of it is of a hub type; name fewer types in `hubs`")
        if len(keep) < len(each):
            named = ", ".join(types[index].name for index in np.intersect1d(hubs, each.types))
            warnings.append(f"{model.path.name}: {len(each) - len(keep)} hubs are left out of the graph: {named}")
    if config.resolved().disconnected == "largest":
        for index, (each, model) in enumerate(zip(assemblies, models, strict=True)):
            apart = kept[index][connected_pieces(each.select(kept[index])) > 0]
            if len(apart):
                left = ", ".join(identified.part_names[index][part] for part in apart[:5].tolist())
                warnings.append(f"{model.path.name}: {len(apart)} parts apart from the rest are left out: {left}")
                kept[index] = np.setdiff1d(kept[index], apart)
    return kept, warnings


def _exemplar_names(models: Sequence[Model]) -> list[str]:
    """The names of the files; where those are alike (all are `model.glb`) the names of their folders."""
    stems = [model.path.stem for model in models]
    unique = UniqueNames()
    return [
        unique(model.path.resolve().parent.name if stems.count(model.path.stem) > 1 else model.path.stem)
        for model in models
    ]
