"""Check that a sample's geometry is what its record says: contacts, grammar and penetration, recomputed from meshes.

Nothing here uses the contact test of the search or its tables. Meshes and poses of a finished sample are read back from
its GLB with trimesh, and FCL tests every pair of parts whose boxes overlap.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.collection.pairs import CONTACTS, pairs_of
from stages.shape.geometry.components import connected_components
from stages.shape.geometry.contact import ContactTest, overlapping_boxes
from stages.shape.geometry.docking import DockingTable, symmetric_images
from stages.shape.geometry.penetration import PenetrationTest, depth_bound
from stages.shape.geometry.pose import invert, pose_vectors
from stages.shape.graphs.neighbourhoods import SLOT_LEVELS, admits
from stages.shape.graphs.patterns import MAX_UP_DIFFERENCE
from stages.shape.graphs.slots import SlotGrammar
from stages.shape.kit import Assembly, Kit
from stages.shape.shape import Shape, kit_shape, mesh_name
from stages.shape.stretch import STRETCHED_DEPTH, StretchedMesh, split

BORDERLINE_SHARE = 0.03
"""Distances that differ from the contact tolerance by less than this share of it are not judged.

Poses in a GLB are 32-bit numbers.
"""


def geometry_faults(kit: Kit, members: Mapping[str, bytes]) -> list[str]:
    """Return the faults of the sample with these members.

    Contacts equal the record's. Every neighbourhood is in the grammar. Every pair in contact was observed. No pair of
    parts reaches deeper into each other than pairs of its types in the exemplars; a stretched part may reach
    STRETCHED_DEPTH deeper.
    """
    record = json.loads(members["json"])
    names = [part["name"] for part in record["parts"]]
    type_of = {name: index for index, name in enumerate(kit.type_names())}
    types = np.array([type_of[mesh_name(name)] for name in names], dtype=np.int16)
    meshes, poses = _parts_of(members["glb"], names)
    _, stretches = split(np.array([part["pose"] for part in record["parts"]], dtype=np.float64))
    return _faults(kit, Assembly(types, poses, pairs_of(members[CONTACTS]), stretches), meshes, names)


def assembly_faults(kit: Kit, assembly: Assembly, upright: bool = True) -> list[str]:
    """Return the faults of an assembly that is in no file yet.

    Checks what `geometry_faults` checks. In addition, the assembly is connected, each contact is a docking of the kit,
    and, if it must be `upright`, each part stands as one of its type stood in an exemplar.
    """
    names = [f"{kit.types[kind].name}.{part:03d}" for part, kind in enumerate(assembly.types.tolist())]
    faults = _faults(kit, assembly, [kit.types[kind] for kind in assembly.types.tolist()], names)
    if connected_components(len(assembly), assembly.edges).any():
        faults.append("it is not in one piece")
    faults += [
        f"{names[i]} and {names[j]} touch as no exemplar shows"
        for i, j in assembly.edges.tolist()
        if not _is_docked(
            kit, int(assembly.types[i]), int(assembly.types[j]), invert(assembly.poses[i]) @ assembly.poses[j]
        )
    ]
    return [
        *faults,
        *(f"{names[part]} stands as no exemplar shows" for part in (_fallen(kit, assembly) if upright else ())),
    ]


def _is_docked(kit: Kit, a: int, b: int, pose: FloatArray) -> bool:
    """Return whether a part of type `b` at `pose` (4, 4) to one of type `a` is in a docking of the kit."""
    if a > b:
        a, b, pose = b, a, invert(pose)
    length = kit.types[b].diagonal / 2
    wanted = [pose_vectors(view[None], length) for view in ((pose, invert(pose)) if a == b else (pose,))]
    for docking in kit.grammar.dockings:
        if (docking.a, docking.b) == (a, b):
            images = pose_vectors(symmetric_images(kit.types[a], kit.types[b], docking.pose), length)
            gap = min(np.linalg.norm(images - vectors, axis=1).min() for vectors in wanted)
            if gap <= (1.0 + BORDERLINE_SHARE) * (docking.slack or kit.pose_tolerance):
                return True
    return False


def _fallen(kit: Kit, assembly: Assembly) -> list[int]:
    """Return the parts that stand with another side up than any part of their type in an exemplar."""
    axis = {"y": 1, "z": 2}[kit.up]
    fallen = []
    for part, kind in enumerate(assembly.types.tolist()):
        ups = np.concatenate(
            [exemplar.whole.poses[exemplar.whole.types == kind, axis, :3] for exemplar in kit.exemplars]
        )
        images = kit.types[kind].symmetries[:, :3, :3] @ assembly.poses[part, axis, :3]
        if np.linalg.norm(images[:, None] - ups[None], axis=2).min() > MAX_UP_DIFFERENCE:
            fallen.append(part)
    return fallen


def _faults(kit: Kit, assembly: Assembly, meshes: Sequence[Any], names: Sequence[str]) -> list[str]:
    shape = kit_shape(kit, assembly)
    types, poses = shape.assembly.types, assembly.poses
    boxes = np.stack([_world_box(mesh, pose) for mesh, pose in zip(meshes, poses, strict=True)])
    pairs = overlapping_boxes(boxes, 1.1 * kit.contact_tolerance)
    stored = {(i, j) for i, j in assembly.edges.tolist()}
    touching, doubtful = _contacts(meshes, poses, pairs, kit.contact_tolerance)
    contact = ContactTest(shape.meshes, kit.contact_tolerance)
    faults: list[str] = []
    for i, j in sorted(stored - touching - doubtful):
        faults.append(f"{names[i]} and {names[j]} are recorded as neighbours and do not touch")
    for i, j in sorted(touching - stored):
        # a contact that is a short line from one part and a point from the other is not judged
        a, b, pose = int(types[i]), int(types[j]), invert(poses[i]) @ poses[j]
        if {contact.kind(a, b, pose), contact.kind(b, a, invert(pose))} <= set(kit.contact_kinds):
            faults.append(f"{names[i]} and {names[j]} touch and are not recorded as neighbours")
    faults.extend(_grammar_faults(kit, assembly, names))
    faults.extend(_penetration_faults(kit, assembly, shape, boxes, pairs, names))
    return faults


def _parts_of(content: bytes, names: Sequence[str]) -> tuple[list[Any], FloatArray]:
    """Return the mesh and the pose (n, 4, 4) of each named node of a GLB."""
    import trimesh

    scene = trimesh.load_scene(io.BytesIO(content), file_type="glb", process=False)
    meshes: dict[tuple[Any, ...], Any] = {}
    parts = []
    for name in names:
        own = scene.graph.get(name)[1]
        # trimesh makes the primitives of a part with several materials nodes below its node
        below = scene.graph.transforms.children.get(name, []) if own is None else []
        key = tuple(scene.graph.get(node)[1] for node in below) or (own,)
        if key not in meshes:
            meshes[key] = trimesh.util.concatenate([scene.geometry[geometry] for geometry in key])
        parts.append(meshes[key])
    return parts, np.array([scene.graph.get(name)[0] for name in names], dtype=float)


def _world_box(mesh: Any, pose: FloatArray) -> FloatArray:
    corners = mesh.vertices @ pose[:3, :3].T + pose[:3, 3]
    return np.stack([corners.min(axis=0), corners.max(axis=0)])


def _contacts(
    meshes: Sequence[Any], poses: FloatArray, pairs: IntArray, tolerance: float
) -> tuple[set[tuple[int, ...]], set[tuple[int, ...]]]:
    """Return the pairs in contact by FCL, and the pairs whose distance is too near the tolerance to judge."""
    import fcl

    models: dict[int, Any] = {}
    for mesh in meshes:
        if id(mesh) not in models:
            model = fcl.BVHModel()
            model.beginModel(len(mesh.vertices), len(mesh.faces))
            model.addSubModel(np.asarray(mesh.vertices), np.asarray(mesh.faces))
            model.endModel()
            models[id(mesh)] = model
    bodies = [
        fcl.CollisionObject(models[id(mesh)], fcl.Transform(pose[:3, :3], pose[:3, 3]))
        for mesh, pose in zip(meshes, poses, strict=True)
    ]
    touching: set[tuple[int, ...]] = set()
    doubtful: set[tuple[int, ...]] = set()
    for i, j in pairs.tolist():
        if fcl.collide(bodies[i], bodies[j], fcl.CollisionRequest(), fcl.CollisionResult()):
            touching.add((i, j))
            continue
        distance = fcl.distance(bodies[i], bodies[j], fcl.DistanceRequest(), fcl.DistanceResult())
        if abs(distance - tolerance) <= BORDERLINE_SHARE * tolerance:
            doubtful.add((i, j))
        elif distance < tolerance:
            touching.add((i, j))
    return touching, doubtful


def _grammar_faults(kit: Kit, assembly: Assembly, names: Sequence[str]) -> list[str]:
    known, labelled = kit.labels, kit.labelled(assembly)
    faults = []
    misfits = _slot_misfits(kit, assembly) if kit.grammar.strictness in SLOT_LEVELS else ()
    for part, neighbours in enumerate(assembly.neighbours()):
        around = labelled.multiset(neighbours)
        if part in misfits or not admits(kit.grammar, int(labelled.types[part]), around):
            listed = ", ".join(f"{count} {known[other]}" for other, count in around) or "nothing"
            faults.append(f"{names[part]} has a neighbourhood that the grammar does not admit: {listed}")
    return faults


def _slot_misfits(kit: Kit, assembly: Assembly) -> list[int]:
    """Return the parts whose slots are filled as the grammar does not admit, however the parts are turned.

    A search need not keep parts upright.
    """
    dockings = DockingTable.of(kit)
    misfits = SlotGrammar(kit, dockings, upright=True).misfits(assembly)
    if not misfits:
        return []
    return sorted({*misfits} & {*SlotGrammar(kit, dockings, upright=False).misfits(assembly)})


def _penetration_faults(
    kit: Kit, assembly: Assembly, shape: Shape, boxes: FloatArray, pairs: IntArray, names: Sequence[str]
) -> list[str]:
    meshes, mesh_of, poses = shape.meshes, shape.assembly.types, assembly.poses
    test = PenetrationTest(meshes)
    slack = kit.contact_tolerance + kit.pose_tolerance
    faults = []
    for i, j in pairs.tolist():
        if assembly.types[i] > assembly.types[j]:
            i, j = j, i
        seen = kit.grammar.depths.get((int(assembly.types[i]), int(assembly.types[j])), 0.0)
        both = meshes[mesh_of[i]], meshes[mesh_of[j]]
        if any(isinstance(mesh, StretchedMesh) for mesh in both):
            seen += STRETCHED_DEPTH * min(mesh.diagonal for mesh in both)
        allowed = seen + slack
        if depth_bound(boxes[i], boxes[j]) <= allowed:
            continue
        depth = test.depth(int(mesh_of[i]), int(mesh_of[j]), invert(poses[i]) @ poses[j])
        if depth > allowed:
            faults.append(f"{names[i]} and {names[j]} reach {depth:.4g} into each other, {seen:.4g} in the exemplars")
    return faults
