"""Types by meaning: one label for several surfaces."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from stages.exemplars.language import KitDecoder
from stages.exemplars.settings import KitConfig
from stages.package.glb import glb_bytes
from stages.package.record import describe_sample
from stages.shape.assembly_faults import geometry_faults
from stages.shape.collection.pairs import CONTACTS, pair_bytes
from stages.shape.kit import Assembly, Kit
from stages.shape.kit_files import kit_json
from stages.shape.sample import Sample
from stages.shape.shape import kit_shape
from tests.toy_kits.chains_and_rings import models_of, pose
from tests.toy_kits.tables import ROUND, SHORT, SQUARE, THICK, THIN, table, table_kit


@pytest.fixture(scope="module")
def kit() -> Kit:
    return table_kit(table(THIN, SQUARE), table(THICK, ROUND))


def test_surfaces_of_one_label_are_types_of_their_own_with_one_meaning(kit: Kit) -> None:
    assert kit.type_names() == ("top", "leg", "top_2", "leg_2")
    assert kit.labels == ("top", "leg")
    assert kit.label_of.tolist() == [0, 1, 0, 1]
    assert {len(part_type.symmetries) for part_type in kit.types if part_type.label == "leg"} == {8, 16}


def test_neighbourhoods_are_those_of_labels_and_dockings_those_of_surfaces(kit: Kit) -> None:
    assert kit.grammar.neighbourhoods == {0: {((1, 4),): 2}, 1: {((0, 1),): 8}}
    observed = [(docking.a, docking.b, docking.count) for docking in kit.grammar.dockings if docking.count]
    assert observed == [(0, 1, 4), (2, 3, 4)]


def test_neighbourhoods_are_those_of_labels_also_where_parts_stand_apart_and_are_left_out() -> None:
    (shelf,) = models_of({"shelf": THIN}, [[("shelf", pose(9.0, 0.0, 0.0))]])
    first, second = table(THIN, SQUARE), table(THICK, ROUND)
    apart = replace(first, parts=(*shelf.parts, *first.parts))
    kit = table_kit(apart, second, disconnected="largest")
    assert kit.labels == ("top", "leg")
    assert kit.grammar.neighbourhoods == {0: {((1, 4),): 2}, 1: {((0, 1),): 8}}


def test_kit_by_congruence_or_labels_has_no_labels_by_meaning_in_its_file() -> None:
    for types in ("congruence", "labels"):
        kit = table_kit(table(THIN, SQUARE), table(THIN, SHORT), types=types)
        assert kit.labels == kit.type_names()
        assert kit.label_of.tolist() == list(range(len(kit.types)))
        described = kit_json(kit)
        assert all("meaning" not in part_type for part_type in described["types"])
        assert all(docking["seen"] and "slack" not in docking for docking in described["dockings"])


def test_part_label_is_its_meaning_and_part_name_its_surface(kit: Kit) -> None:
    shape = kit_shape(kit, kit.exemplars[1].assembly)
    assert shape.labels == ("top", "leg")
    assert shape.part_labels.tolist() == [0, 1, 1, 1, 1]
    assert shape.part_names == ("top_2.000", "leg_2.000", "leg_2.001", "leg_2.002", "leg_2.003")
    assert KitDecoder({"toy": kit}).sources["toy"].labels == ("top", "leg")


def mixed(kit: Kit) -> Assembly:
    """Return the thin top on two square and two round legs, which no exemplar shows."""
    whole = kit.exemplars[0].assembly
    types = whole.types.copy()
    types[[1, 4]] = 3
    # a leg of another section stands as its like did in its own exemplar
    poses = whole.poses.copy()
    poses[[1, 4], :3, :3] = kit.exemplars[1].assembly.poses[1, :3, :3]
    return Assembly(types, poses, whole.edges)


def faults(kit: Kit, assembly: Assembly) -> list[str]:
    shape = kit_shape(kit, assembly)
    contacts = pair_bytes(assembly.edges)
    sample = Sample("toy-0", "train", "variations", "toy", "0" * 64, {}, assembly)
    record = describe_sample(sample, "kit", shape, {CONTACTS: contacts, "txt": b"A\n"}, {})
    members = {"json": json.dumps(record).encode(), CONTACTS: contacts, "glb": glb_bytes(shape)}
    return geometry_faults(kit, members)


def test_geometry_check_uses_labels_for_neighbourhoods_and_surfaces_for_contacts(kit: Kit) -> None:
    assembly = mixed(kit)
    assert faults(kit, assembly) == []
    three = Assembly(assembly.types[:4], assembly.poses[:4], assembly.edges[:3])
    assert faults(kit, three) == ["top.000 has a neighbourhood that the grammar does not admit: 3 leg"]
    assembly.poses[1, 1, 3] += 0.05
    assert any("reach" in fault and "into each other" in fault for fault in faults(kit, assembly))


def test_hubs_cannot_be_left_out_by_meaning() -> None:
    with pytest.raises(ValidationError, match=r"set `hubs\.types: none`"):
        KitConfig.model_validate(
            {"name": "toy", "shapes": (Path(__file__),), "types": "meaning", "hubs": {"types": ("leg",)}}
        )


def test_labelled_leaves_poses_and_contacts_as_they_are(kit: Kit) -> None:
    assembly = kit.exemplars[1].assembly
    labelled = kit.labelled(assembly)
    assert labelled.types.tolist() == [0, 1, 1, 1, 1]
    assert np.array_equal(labelled.edges, assembly.edges)
    assert labelled.poses is assembly.poses
