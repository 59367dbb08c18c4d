"""The independent look at a sample: it finds each kind of fault, and none in a sound shape."""

from __future__ import annotations

import json

import numpy as np
import pytest

from stages.package.glb import glb_bytes
from stages.shape.assembly_faults import assembly_faults, geometry_faults
from stages.shape.collection.pairs import CONTACTS, pair_bytes
from stages.shape.geometry.contact import ContactTest
from stages.shape.geometry.pose import invert
from stages.shape.kit import Assembly, Kit
from stages.shape.shape import kit_shape
from tests.toy_kits.chains_and_rings import ROAD, kit_of, ring


@pytest.fixture(scope="module")
def kit() -> Kit:
    return kit_of(ROAD, [ring(1, 1), ring(2, 3)])


def faults(kit: Kit, assembly: Assembly) -> list[str]:
    placed = assembly.placements.tolist()
    parts = [
        {"name": name, "label": kit.types[index].name, "pose": pose}
        for name, index, pose in zip(kit_shape(kit, assembly).part_names, assembly.types.tolist(), placed, strict=True)
    ]
    record, contacts = json.dumps({"parts": parts}).encode(), pair_bytes(assembly.edges)
    return geometry_faults(kit, {"json": record, CONTACTS: contacts, "glb": glb_bytes(kit_shape(kit, assembly))})


def test_exemplars_have_no_faults(kit: Kit) -> None:
    for exemplar in kit.exemplars:
        assert faults(kit, exemplar.assembly) == []


def test_a_contact_that_is_not_recorded_is_named(kit: Kit) -> None:
    whole = kit.exemplars[0].assembly
    found = faults(kit, Assembly(whole.types, whole.poses, whole.edges[1:]))
    first, second = (kit_shape(kit, whole).part_names[part] for part in whole.edges[0])
    assert any(f"{first} and {second} touch and are not recorded" in fault for fault in found)
    assert any("neighbourhood that the grammar does not admit" in fault for fault in found)


def test_a_contact_that_counts_as_seen_from_one_part_alone_may_be_recorded_or_not() -> None:
    """An edge rests on another at a slant: the one has a short line near the other, that no more than a point."""
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)], kinds=("line", "face"))
    corner = kit.type_names().index("corner")
    aslant = np.array(
        [
            [0.73086204, 0.54207241, -0.41472664, -0.0263769],
            [-0.6825204, 0.58274381, -0.4411072, -0.10801633],
            [0.00256733, 0.6054479, 0.7958808, 0.96171885],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
    contact = ContactTest(kit.types, kit.contact_tolerance)
    assert contact.kind(corner, corner, aslant) == "line"
    assert contact.kind(corner, corner, invert(aslant)) == "point"
    types, poses = np.array([corner, corner], dtype=np.int16), np.stack([np.eye(4), aslant])
    for placed in (poses, poses[::-1]):
        found = assembly_faults(kit, Assembly(types, placed, np.empty((0, 2), dtype=np.int32)))
        assert not any("touch and are not recorded" in fault for fault in found)


def test_a_recorded_contact_that_is_none_is_named(kit: Kit) -> None:
    whole = kit.exemplars[0].assembly
    poses = whole.poses.copy()
    poses[2, 1, 3] += 3.0
    found = faults(kit, Assembly(whole.types, poses, whole.edges))
    assert sum("are recorded as neighbours and do not touch" in fault for fault in found) == 2


def test_parts_that_penetrate_deeper_than_in_exemplars_are_named(kit: Kit) -> None:
    whole = kit.exemplars[0].assembly
    names = kit_shape(kit, whole).part_names
    i, j = whole.edges[0].tolist()
    poses = whole.poses.copy()
    towards = poses[i, :3, 3] - poses[j, :3, 3]
    poses[j, :3, 3] += 0.3 * towards / np.linalg.norm(towards)
    found = faults(kit, Assembly(whole.types, poses, whole.edges))
    pair = {names[i], names[j]}
    assert any("into each other" in fault and all(name in fault for name in pair) for fault in found)


def test_a_part_inside_another_is_named(kit: Kit) -> None:
    whole = kit.exemplars[0].assembly
    types = np.append(whole.types, whole.types[3]).astype(np.int16)
    poses = np.concatenate([whole.poses, whole.poses[3:4]])
    found = faults(kit, Assembly(types, poses, whole.edges))
    assert any("touch and are not recorded" in fault for fault in found)


def test_an_assembly_in_memory_is_looked_at_in_the_same_way(kit: Kit) -> None:
    for exemplar in kit.exemplars:
        assert assembly_faults(kit, exemplar.assembly) == []
    whole = kit.exemplars[0].assembly
    fewer = assembly_faults(kit, Assembly(whole.types, whole.poses, whole.edges[1:]))
    assert any("touch and are not recorded" in fault for fault in fewer)


def test_an_assembly_upside_down_stands_as_no_exemplar_does(kit: Kit) -> None:
    whole = kit.exemplars[0].assembly
    over = np.diag([1.0, -1.0, -1.0, 1.0])
    turned = Assembly(whole.types, over @ whole.poses, whole.edges)
    found = assembly_faults(kit, turned)
    assert len(found) == len(whole)
    assert all("stands as no exemplar shows" in fault for fault in found)
    assert assembly_faults(kit, turned, upright=False) == []


def test_two_assemblies_side_by_side_are_not_one_piece(kit: Kit) -> None:
    one = kit.exemplars[0].assembly
    aside = one.poses.copy()
    aside[:, 0, 3] += 100.0
    edges = np.concatenate([one.edges, one.edges + len(one)])
    both = Assembly(np.tile(one.types, 2), np.concatenate([one.poses, aside]), edges)
    assert assembly_faults(kit, both) == ["it is not in one piece"]


def test_a_contact_that_is_no_docking_is_named(kit: Kit) -> None:
    """Two straights in a row, the second moved to the side: they touch, and as no two straights of the exemplars do."""
    whole = kit.exemplars[1].assembly
    straight = kit.type_names().index("straight")
    i, j = next((i, j) for i, j in whole.edges.tolist() if whole.types[i] == whole.types[j] == straight)
    pair = whole.select(np.array([i, j]))
    pair.poses[1, :3, 3] += 0.1 * pair.poses[0, :3, 2]
    assert any("touch as no exemplar shows" in fault for fault in assembly_faults(kit, pair))
