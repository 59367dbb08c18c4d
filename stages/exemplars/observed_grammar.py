"""Observe the tiling grammar of exemplars: neighbourhoods and docking configurations (strings §3, §6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.contact import ContactTest, overlapping_boxes, world_boxes
from stages.shape.geometry.docking import DockingTable, symmetric_images
from stages.shape.geometry.penetration import DepthMemory
from stages.shape.geometry.pose import invert, pose_vectors
from stages.shape.kit import Assembly, ContactKind, Docking, Grammar, Multiset, PartType, labels_of

MAX_DEPTH_IMAGES = 24
"""Symmetric images of a docking whose penetration is measured; round parts have hundreds."""


def observe_neighbourhoods(assemblies: Sequence[Assembly]) -> dict[int, dict[Multiset, int]]:
    """Return for each type the multisets of neighbour types around its parts, with their counts."""
    observed: dict[int, dict[Multiset, int]] = {}
    for assembly in assemblies:
        for part, neighbours in enumerate(assembly.neighbours()):
            rules = observed.setdefault(int(assembly.types[part]), {})
            multiset = assembly.multiset(neighbours)
            rules[multiset] = rules.get(multiset, 0) + 1
    return {index: dict(sorted(rules.items())) for index, rules in sorted(observed.items())}


def observe_dockings(types: Sequence[PartType], assemblies: Sequence[Assembly], tolerance: float) -> list[Docking]:
    """Return the classes of relative poses of parts in contact, modulo the symmetries of both parts.

    Poses within `tolerance` of the first pose of a class belong to it. `kind` and `depth` are not measured here: they
    are `face` and 0.
    """
    classes: dict[tuple[int, int], list[tuple[Docking, FloatArray]]] = {}
    for assembly in assemblies:
        for i, j in assembly.edges.tolist():
            if assembly.types[i] > assembly.types[j]:
                i, j = j, i
            a, b = int(assembly.types[i]), int(assembly.types[j])
            pose = invert(assembly.poses[i]) @ assembly.poses[j]
            length = types[b].diagonal / 2
            vector = pose_vectors(pose[None], length)
            known = classes.setdefault((a, b), [])
            for index, (docking, images) in enumerate(known):
                if np.linalg.norm(images - vector, axis=1).min() <= tolerance:
                    known[index] = replace(docking, count=docking.count + 1), images
                    break
            else:
                poses = symmetric_images(types[a], types[b], pose)
                if a == b:
                    poses = np.concatenate([poses, symmetric_images(types[a], types[b], invert(pose))])
                known.append((Docking(a, b, pose, "face", 1, 0.0), pose_vectors(poses, length)))
    return [docking for _, known in sorted(classes.items()) for docking, _ in known]


@dataclass(frozen=True)
class ObservedContacts:
    """The contacts in some assemblies.

    dockings: their classes, with kinds of contact and depths of 0.
    counted: the assemblies with the edges whose kinds count.
    kinds: for each assembly the kind of every original edge.
    """

    dockings: tuple[Docking, ...]
    counted: list[Assembly]
    kinds: list[tuple[ContactKind, ...]]


def observe_contacts(
    types: Sequence[PartType],
    assemblies: Sequence[Assembly],
    contact: ContactTest,
    tolerance: float,
    kinds: Sequence[ContactKind],
) -> ObservedContacts:
    """Classify the contacts of `assemblies`; those of the given `kinds` count."""
    dockings = tuple(
        replace(docking, kind=contact.kind(docking.a, docking.b, docking.pose) or "point")
        for docking in observe_dockings(types, assemblies, tolerance)
    )
    table = DockingTable(types, dockings, tolerance)
    kinds_of_edges: list[tuple[ContactKind, ...]] = []
    counted: list[Assembly] = []
    for assembly in assemblies:
        labels = table.label_edges(assembly.types, assembly.poses, assembly.edges)[:, 0] // 2
        kinds_of_edges.append(tuple(dockings[label].kind for label in labels.tolist()))
        chosen = np.array([kind in kinds for kind in kinds_of_edges[-1]], dtype=bool)
        counted.append(replace(assembly, edges=assembly.edges[chosen]))
    return ObservedContacts(dockings, counted, kinds_of_edges)


def observe_grammar(
    types: Sequence[PartType],
    assemblies: Sequence[Assembly],
    contacts: ObservedContacts,
    kinds: Sequence[ContactKind],
    depths: DepthMemory | None = None,
) -> Grammar:
    """Return the grammar of `assemblies`, whose `contacts` count if they are of the given `kinds`.

    depths: what is known of the depths of parts of these types
    """
    depths = depths or DepthMemory(types)
    dockings = measure_depths(types, [docking for docking in contacts.dockings if docking.kind in kinds], depths)
    labels = labels_of(types)[1]
    labelled = [replace(assembly, types=labels[assembly.types]) for assembly in contacts.counted]
    return Grammar(observe_neighbourhoods(labelled), dockings, observe_nested(types, assemblies, depths))


def measure_depths(types: Sequence[PartType], dockings: Sequence[Docking], depths: DepthMemory) -> tuple[Docking, ...]:
    """Return the dockings with the penetration depths of their parts. depths: what is known of them"""
    return tuple(replace(docking, depth=round(_deepest(types, docking, depths), 6)) for docking in dockings)


def observe_nested(
    types: Sequence[PartType], assemblies: Sequence[Assembly], depths: DepthMemory
) -> dict[tuple[int, int], float]:
    """Return for pairs of types the largest penetration depth of parts whose surfaces do not touch.

    depths: what is known of the depths of parts of these types
    """
    nested: dict[tuple[int, int], float] = {}
    for assembly in assemblies:
        touching = set(map(tuple, assembly.edges.tolist()))
        boxes = world_boxes(types, assembly.types, assembly.poses)
        for i, j in overlapping_boxes(boxes, 0.0).tolist():
            if (i, j) not in touching:
                if assembly.types[i] > assembly.types[j]:
                    i, j = j, i
                a, b = int(assembly.types[i]), int(assembly.types[j])
                depth = depths.depth(types[a], types[b], invert(assembly.poses[i]) @ assembly.poses[j])
                if depth > 0.0:
                    nested[a, b] = max(nested.get((a, b), 0.0), round(depth, 6))
    return dict(sorted(nested.items()))


def _deepest(types: Sequence[PartType], docking: Docking, depths: DepthMemory) -> float:
    """Return the penetration depth of a docking: the largest over its symmetric images, whose probes differ."""
    images = symmetric_images(types[docking.a], types[docking.b], docking.pose)
    rounded = np.round(pose_vectors(images, types[docking.b].diagonal / 2) / (1e-3 * types[docking.b].diagonal))
    _, first = np.unique(rounded, axis=0, return_index=True)
    chosen = first[:: -(-len(first) // MAX_DEPTH_IMAGES)]
    a, b = types[docking.a], types[docking.b]
    return max(depths.depth(a, b, images[index]) for index in chosen.tolist())
