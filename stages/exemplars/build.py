"""From models to a kit: part types, contacts, shape graphs and the tiling grammar (strings §3)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from pipeline.errors import ConfigError
from stages.exemplars.findings import kit_warnings, pieces, refusals
from stages.exemplars.grammar import observe
from stages.exemplars.identify import identify_parts
from stages.exemplars.read import Model
from stages.exemplars.scene import unique_name
from stages.exemplars.settings import KitConfig
from stages.shape.arrays import IntArray
from stages.shape.contact import ContactTest
from stages.shape.kit import Assembly, ContactKind, Exemplar, Kit

__all__ = ["KitReport", "Observation", "build_kit", "observe_models"]


@dataclass(frozen=True)
class KitReport:
    """What building a kit found and did: segmentation of each model, repairs, contacts by kind, warnings."""

    segmentation: tuple[str, ...]
    repairs: Mapping[str, int]
    contacts: Mapping[ContactKind, int]
    contact_tolerance: float
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class Observation:
    """What is in some models, whether or not a run can make anything of it.

    kit: the parts that have area, in the models' order; the edges of its exemplars are the contacts that count.
    contacts: all contacts of each exemplar, int32 (m, 2), i < j in lexicographic order; kinds: their kinds.
    refusals: why a run does not start with these models, each with its mend; empty where it does.
    """

    kit: Kit
    contacts: tuple[IntArray, ...]
    kinds: tuple[tuple[ContactKind, ...], ...]
    repairs: Mapping[str, int]
    refusals: tuple[str, ...]
    warnings: tuple[str, ...]


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
    )
    return seen.kit, report


def observe_models(config: KitConfig, models: Sequence[Model]) -> Observation:
    """What Shapemill sees in `models`, also where it could make no kit of them.

    With `disconnected: largest` only the largest piece of each exemplar is seen. Raises ConfigError for a model in
    which no part has any area.
    """
    identified = identify_parts(models, config)
    types, names = identified.types, list(identified.part_names)
    diagonals = np.concatenate([[types[each].diagonal for each in made.types] for made in identified.assemblies])
    median = float(np.median(diagonals))
    contact = ContactTest(types, config.contact.tolerance * median)
    pose_tolerance = config.pose_tolerance * median
    touching = [replace(each, edges=contact.contacts(each.types, each.poses)) for each in identified.assemblies]
    assemblies, grammar, kinds = observe(types, touching, contact, pose_tolerance, config.contact.kinds)
    warnings = [f"{model.path.name}: {warning}" for model in models for warning in model.warnings]
    if config.disconnected == "largest":
        kept = [np.flatnonzero(pieces(each) == 0) for each in assemblies]
        if any(len(keep) < len(each) for keep, each in zip(kept, assemblies, strict=True)):
            for index, keep in enumerate(kept):
                out = sorted(set(range(len(names[index]))) - set(keep.tolist()))
                if out:
                    left = ", ".join(names[index][part] for part in out[:5])
                    warnings.append(
                        f"{models[index].path.name}: {len(out)} parts apart from the rest are left out: {left}"
                    )
                names[index] = tuple(names[index][part] for part in keep.tolist())
            touching = [_subassembly(each, keep) for each, keep in zip(touching, kept, strict=True)]
            assemblies, grammar, kinds = observe(types, touching, contact, pose_tolerance, config.contact.kinds)
    kit = Kit(
        name=config.name,
        types=types,
        exemplars=tuple(Exemplar(*each) for each in zip(_exemplar_names(models), assemblies, names, strict=True)),
        grammar=grammar,
        contact_tolerance=contact.tolerance,
        pose_tolerance=pose_tolerance,
        contact_kinds=config.contact.kinds,
        up=config.up,
    )
    return Observation(
        kit=kit,
        contacts=tuple(each.edges for each in touching),
        kinds=tuple(kinds),
        repairs=identified.repairs,
        refusals=tuple(refusals(kit, models, identified.empty)),
        warnings=(*warnings, *kit_warnings(kit)),
    )


def _exemplar_names(models: Sequence[Model]) -> list[str]:
    """The names of the files; where those are alike (all are `model.glb`) the names of their folders."""
    stems = [model.path.stem for model in models]
    names: list[str] = []
    for model in models:
        folder = model.path.resolve().parent.name
        names.append(unique_name(folder if stems.count(model.path.stem) > 1 else model.path.stem, names))
    return names


def _subassembly(assembly: Assembly, keep: np.ndarray) -> Assembly:
    renumbered = np.full(len(assembly), -1, dtype=np.int32)
    renumbered[keep] = np.arange(len(keep))
    edges = renumbered[assembly.edges]
    return Assembly(assembly.types[keep], assembly.poses[keep], edges[(edges >= 0).all(axis=1)])
