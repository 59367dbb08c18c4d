"""What is wrong with a kit, or may disappoint: each finding is one sentence with its mend."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from stages.exemplars.congruence import comparable_mesh, congruences
from stages.exemplars.model import STATED_IN_CONFIG, Model
from stages.exemplars.settings import MAX_CONTACT_TOLERANCE
from stages.shape.arrays import IntArray
from stages.shape.geometry.components import connected_components
from stages.shape.geometry.contact import ContactTest
from stages.shape.kit import Assembly, Exemplar, Kit, PartType

LETTERS = 52
"""Part types beyond this number have names in brackets for string tokens, not letters."""
HUB_CONTACTS = 20
"""A part with more contacts than this is a hub."""
HUB_SHARE = 1 / 3
"""So is a part that touches more than this share of all parts, in shapes of some size."""
MAX_PARTS_WITHOUT_HUBS = 12
"""Shapes of at most so many parts have no hubs: there, to touch a third of all parts is nothing."""
TOLERANCE_FACTORS = (2.0, 5.0, 10.0, 20.0, 50.0)
"""Multiples of the contact tolerance that are tried for shapes in pieces."""
NAMED = 5
"""So many parts are named in a sentence."""


def connected_pieces(assembly: Assembly) -> IntArray:
    """The piece that each part belongs to, int32 (n,): parts of one piece are connected; piece 0 is the largest."""
    piece = connected_components(len(assembly), assembly.edges)
    order = np.argsort(-np.bincount(piece), kind="stable")
    rank = np.empty(len(order), dtype=np.int32)
    rank[order] = np.arange(len(order))
    ranked: IntArray = rank[piece]
    return ranked


def hub_parts(assembly: Assembly) -> list[int]:
    """The parts that touch so many others that hardly another shape can repeat their neighbourhood."""
    degrees = np.bincount(assembly.edges.ravel(), minlength=len(assembly))
    most = min(HUB_CONTACTS, HUB_SHARE * len(assembly)) if len(assembly) > MAX_PARTS_WITHOUT_HUBS else HUB_CONTACTS
    found: list[int] = np.flatnonzero(degrees > most).tolist()
    return found


def refusals(
    kit: Kit,
    models: Sequence[Model],
    left_out: Sequence[str],
    tolerance: float,
) -> Iterator[str]:
    """Why a run does not start with `kit`, made of `models`; `left_out` are the names of the hub types not in its
    graphs, and `tolerance` is what the kit's contact tolerance is as a share of the median part's diagonal."""
    for model, exemplar in zip(models, kit.exemplars, strict=True):
        assembly = exemplar.assembly
        if len(model.parts) < 2:
            mend = "set `parts: auto`, or " if model.why == STATED_IN_CONFIG else ""
            yield (
                f"{model.path}: has {len(model.parts)} part by {model.segmentation} ({model.why}), an exemplar needs "
                f"at least 2; {mend}split the model into one scene node a part in the modelling tool"
            )
        elif connected_pieces(assembly).any():
            without = f" without its hubs {listed_names(left_out)}" if left_out else ""
            yield f"{model.path}: the exemplar{without} falls into {_falls_apart(kit, exemplar, tolerance)}"
        elif len(assembly) < 2:
            yield f"{model.path}: only one part of it is connected or has area, an exemplar needs at least 2"
        others = {
            int(index) for each in kit.exemplars if each is not exemplar for index in kit.label_of[each.assembly.types]
        }
        if others and not others & set(kit.label_of[assembly.types].tolist()):
            yield (
                f"{model.path}: shares no part type with the other shapes of its kit, so nothing can be exchanged; "
                "make it a kit of its own, set `types: meaning` if its parts are called as theirs are, or raise "
                "`congruence_tolerance` if they are meant to be alike"
            )


def kit_warnings(kit: Kit) -> Iterator[str]:
    """What may disappoint in `kit`, though a run starts with it."""
    for exemplar in kit.exemplars:
        yield from _hub_warning(exemplar)
    if np.bincount(kit.label_of[np.concatenate([each.assembly.types for each in kit.exemplars])]).max() < 2:
        yield (
            "no part type occurs twice, so little or nothing can be exchanged; repeat parts, add a second shape of the "
            "same parts, or raise `congruence_tolerance` if parts are meant to be alike"
        )
    if len(kit.labels) > LETTERS:
        yield (
            f"{len(kit.labels)} part types are more than the {LETTERS} letters, so strings write them as names in "
            "brackets; raise `congruence_tolerance` if parts are meant to be alike"
        )


def mirror_twins(types: Sequence[PartType], tolerance: float) -> list[tuple[int, int]]:
    """Pairs i < j of types that are each other's mirror image; `tolerance` is a share of the diagonal."""
    meshes = [comparable_mesh(each.vertices, each.faces) for each in types]
    twins: list[tuple[int, int]] = []
    for i, j in itertools.combinations(range(len(types)), 2):
        motions = congruences(meshes[i], meshes[j], tolerance, reflections=True)
        # Types that rotations alone make equal, told apart by their labels, are no twins.
        if len(motions) and (np.linalg.det(motions[:, :3, :3]) < 0).all():
            twins.append((i, j))
    return twins


def _hub_warning(exemplar: Exemplar) -> Iterator[str]:
    assembly = exemplar.assembly
    degrees = np.bincount(assembly.edges.ravel(), minlength=len(assembly))
    found = sorted(hub_parts(assembly), key=lambda part: (-degrees[part], part))
    if found:
        named = listed_names([f"{exemplar.part_names[part]} ({degrees[part]})" for part in found])
        yield (
            f"{exemplar.name}: {_count(len(found), 'part')} of {len(assembly)} with very many contacts: {named}; "
            "hardly another shape has the same around them, so variants may keep them as they are; split them in the "
            "model, or leave them out with `hubs.types` where the rest holds together without them"
        )


def _falls_apart(kit: Kit, exemplar: Exemplar, tolerance: float) -> str:
    """The pieces of an exemplar, and of all mends those that help it."""
    piece = connected_pieces(exemplar.assembly)
    sizes = np.bincount(piece).tolist()
    alone = listed_names([exemplar.part_names[index] for index in np.flatnonzero(piece).tolist()])
    way = _way_together(kit, exemplar, tolerance)
    mends = [f"set {way}" if way else "no contact tolerance joins them, so move the parts together in the model"]
    if sizes[0] > 1:
        mends.append("keep the largest piece alone with `disconnected: largest`")
    if len(sizes) > 1 and sizes[1] > 1:
        mends.append("export each piece as a model of its own and name them all as shapes of one kit")
    listed = listed_names([str(size) for size in sizes], 8)
    return f"{len(sizes)} pieces of {listed} parts (apart: {alone}); {', or '.join(mends)}"


def _way_together(kit: Kit, exemplar: Exemplar, tolerance: float) -> str:
    """What a config must say so that an exemplar is in one piece; empty where nothing makes it so."""
    assembly = exemplar.assembly
    for looser in dict.fromkeys(min(factor * tolerance, MAX_CONTACT_TOLERANCE) for factor in (1.0, *TOLERANCE_FACTORS)):
        test = ContactTest(kit.types, looser / tolerance * kit.contact_tolerance)
        edges = test.contacts(assembly.types, assembly.poses)
        if not connected_pieces(replace(assembly, edges=edges)).any():
            said = [f"`contact.tolerance: {looser:g}`"] if looser > tolerance else []
            if set(kit.contact_kinds) < {"point", "line", "face"}:
                said.append("`contact.kinds: [point, line, face]`")
            return " and ".join(said)
    return ""


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" + ("" if number == 1 else "s")


def listed_names(words: Sequence[str], count: int = NAMED) -> str:
    """The first words of a list, and how many more there are."""
    more = f" and {len(words) - count} more" if len(words) > count else ""
    return ", ".join(words[:count]) + more
