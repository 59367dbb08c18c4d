"""Refusals and warnings about a kit: each is one sentence with its remedy."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from stages.exemplars.congruence import are_alike_in_size, comparable_mesh, congruences
from stages.exemplars.model import STATED_IN_CONFIG, Model
from stages.exemplars.settings import MAX_CONTACT_TOLERANCE
from stages.shape.arrays import IntArray
from stages.shape.geometry.components import connected_components
from stages.shape.geometry.contact import ContactTest
from stages.shape.kit import Assembly, Exemplar, Kit, PartType

MAX_LETTER_TYPES = 52
"""Part types beyond this number have names in brackets for string tokens, not letters."""
MAX_CONTACTS = 20
"""A part with more contacts is a hub."""
MAX_CONTACT_SHARE = 1 / 3
"""A part of a larger shape that touches a larger share of all parts is a hub."""
MAX_PARTS_WITHOUT_HUBS = 12
"""Smaller shapes have hubs by MAX_CONTACTS alone, since touching a third of their parts is common."""
TOLERANCE_FACTORS = (2.0, 5.0, 10.0, 20.0, 50.0)
"""Multiples of the contact tolerance that are tried for shapes in pieces."""
MAX_NAMES_SHOWN = 5


def connected_pieces(assembly: Assembly) -> IntArray:
    """Return the piece of each part, int32 (n,): parts of one piece are connected, and piece 0 is the largest."""
    piece = connected_components(len(assembly), assembly.edges)
    order = np.argsort(-np.bincount(piece), kind="stable")
    rank = np.empty(len(order), dtype=np.int32)
    rank[order] = np.arange(len(order))
    ranked: IntArray = rank[piece]
    return ranked


def hub_parts(assembly: Assembly) -> list[int]:
    """Return the parts with too many contacts for another shape to repeat their neighbourhood."""
    degrees = np.bincount(assembly.edges.ravel(), minlength=len(assembly))
    is_small = len(assembly) <= MAX_PARTS_WITHOUT_HUBS
    limit = MAX_CONTACTS if is_small else min(MAX_CONTACTS, MAX_CONTACT_SHARE * len(assembly))
    hubs: list[int] = np.flatnonzero(degrees > limit).tolist()
    return hubs


def refusals(
    kit: Kit,
    models: Sequence[Model],
    hub_names: Sequence[str],
    tolerance: float,
) -> Iterator[str]:
    """Yield why a run does not start with `kit`, made of `models`.

    hub_names: the types that are left out of its graphs.
    tolerance: the kit's contact tolerance, as a share of the median part's diagonal.
    """
    for model, exemplar in zip(models, kit.exemplars, strict=True):
        assembly = exemplar.assembly
        if len(model.parts) < 2:
            yield single_part_refusal(model)
        elif connected_pieces(assembly).any():
            without = f" without its hubs {listed_names(hub_names)}" if hub_names else ""
            yield f"{model.path}: the exemplar{without} falls into {_falls_apart(kit, exemplar, tolerance)}"
        elif len(assembly) < 2:
            yield f"{model.path}: only one part of it is connected or has area, an exemplar needs at least 2"
        others = {
            int(label)
            for other in kit.exemplars
            if other is not exemplar
            for label in kit.label_of[other.assembly.types]
        }
        if others and not others & set(kit.label_of[assembly.types].tolist()):
            yield (
                f"{model.path}: shares no part type with the other shapes of its kit, so nothing can be exchanged; "
                "make it a kit of its own, set `types: meaning` if its parts have the same names, or raise "
                "`congruence_tolerance` if they are meant to be alike"
            )


def single_part_refusal(model: Model) -> str:
    """Say why a model of fewer than two parts is no exemplar, and what helps."""
    mend = "set `parts: auto`, " if model.why == STATED_IN_CONFIG else ""
    return (
        f"{model.path}: has {len(model.parts)} part by {model.segmentation} ({model.why}), an exemplar needs "
        f"at least 2; {mend}split the model into one scene node a part in the modelling tool, or name it in the "
        "section `grammars`, which needs no parts (configs/sections/grammars.md)"
    )


def kit_warnings(kit: Kit) -> Iterator[str]:
    """Yield what may limit the results of `kit`, though a run starts with it."""
    for exemplar in kit.exemplars:
        yield from _hub_warning(exemplar)
    if np.bincount(kit.label_of[np.concatenate([exemplar.assembly.types for exemplar in kit.exemplars])]).max() < 2:
        yield (
            "no part type occurs twice, so little or nothing can be exchanged; repeat parts, add a second shape of the "
            "same parts, or raise `congruence_tolerance` if parts are meant to be alike"
        )
    if len(kit.labels) > MAX_LETTER_TYPES:
        yield (
            f"{len(kit.labels)} part types are more than the {MAX_LETTER_TYPES} letters, so strings write them as "
            f"names in "
            "brackets; raise `congruence_tolerance` if parts are meant to be alike"
        )


def mirror_twins(types: Sequence[PartType], tolerance: float) -> list[tuple[int, int]]:
    """Return pairs i < j of types that are mirror images of each other; `tolerance` is a share of the diagonal."""
    meshes = [comparable_mesh(part_type.vertices, part_type.faces) for part_type in types]
    sizes = np.array([mesh.size for mesh in meshes])
    twins: list[tuple[int, int]] = []
    for i, mesh in enumerate(meshes):
        for j in (i + 1 + np.flatnonzero(are_alike_in_size(sizes[i + 1 :], mesh, tolerance))).tolist():
            transforms = congruences(meshes[j], mesh, tolerance, reflections=True)
            # Types that a rotation maps onto each other differ by their labels and are no twins.
            if len(transforms) and (np.linalg.det(transforms[:, :3, :3]) < 0).all():
                twins.append((i, j))
    return twins


def _hub_warning(exemplar: Exemplar) -> Iterator[str]:
    assembly = exemplar.assembly
    degrees = np.bincount(assembly.edges.ravel(), minlength=len(assembly))
    hubs = sorted(hub_parts(assembly), key=lambda part: (-degrees[part], part))
    if hubs:
        named = listed_names([f"{exemplar.part_names[part]} ({degrees[part]})" for part in hubs])
        yield (
            f"{exemplar.name}: {_count(len(hubs), 'part')} of {len(assembly)} with very many contacts: {named}; "
            "hardly another shape has the same around them, so variants may keep them as they are; split them in the "
            "model, or leave them out with `hubs.types` where the rest holds together without them"
        )


def _falls_apart(kit: Kit, exemplar: Exemplar, tolerance: float) -> str:
    """Describe the pieces of an exemplar, and the remedies that help."""
    piece = connected_pieces(exemplar.assembly)
    sizes = np.bincount(piece).tolist()
    alone = listed_names([exemplar.part_names[index] for index in np.flatnonzero(piece).tolist()])
    joining = _joining_keys(kit, exemplar, tolerance)
    mends = [
        f"set {joining}" if joining else "no contact tolerance joins them, so move the parts together in the model"
    ]
    if sizes[0] > 1:
        mends.append("keep the largest piece alone with `disconnected: largest`")
    if len(sizes) > 1 and sizes[1] > 1:
        mends.append("export each piece as a model of its own and name them all as shapes of one kit")
    listed = listed_names([str(size) for size in sizes], 8)
    return f"{len(sizes)} pieces of {listed} parts (apart: {alone}); {', or '.join(mends)}"


def _joining_keys(kit: Kit, exemplar: Exemplar, tolerance: float) -> str:
    """Return the config keys that make one piece of an exemplar; empty if none do."""
    assembly = exemplar.assembly
    for looser in dict.fromkeys(min(factor * tolerance, MAX_CONTACT_TOLERANCE) for factor in (1.0, *TOLERANCE_FACTORS)):
        test = ContactTest(kit.types, looser / tolerance * kit.contact_tolerance)
        edges = test.contacts(assembly.types, assembly.poses)
        if not connected_pieces(replace(assembly, edges=edges)).any():
            keys = [f"`contact.tolerance: {looser:g}`"] if looser > tolerance else []
            if set(kit.contact_kinds) < {"point", "line", "face"}:
                keys.append("`contact.kinds: [point, line, face]`")
            return " and ".join(keys)
    return ""


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" + ("" if number == 1 else "s")


def listed_names(words: Sequence[str], count: int = MAX_NAMES_SHOWN) -> str:
    """Join the first words of a list, and say how many more there are."""
    more = f" and {len(words) - count} more" if len(words) > count else ""
    return ", ".join(words[:count]) + more
