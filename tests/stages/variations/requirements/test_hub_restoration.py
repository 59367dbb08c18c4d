"""Hub parts put back into finished shapes: only where they fit, and with their true contacts."""

from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh
from trimesh.transformations import translation_matrix

from stages.exemplars.settings import HubConfig
from stages.package.glb import glb_bytes
from stages.shape.assembly_faults import geometry_faults
from stages.shape.collection.pairs import CONTACTS, pair_bytes
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.kit import Assembly, Kit
from stages.shape.shape import kit_shape
from stages.strings.encoder import canonical_string
from stages.strings.tokens import StringError, make_alphabet
from stages.variations.requirements.hub_restoration import HubRestorer
from tests.stages.strings.grammar_check import check_string
from tests.toy_kits.chains_and_rings import CHAIN, Placed, box, chain, kit_of, models_of, pose

MESHES = {**CHAIN, "plate": box(4.5, 0.1, 3.0)}
PLATE: Placed = ("plate", pose(1, -0.55, 0))


@pytest.fixture(scope="module")
def kit() -> Kit:
    """A chain of three links between two caps on a plate that only the caps touch."""
    hubs = HubConfig(types=("plate",), restore=True)
    return kit_of(MESHES, [[*chain(3), PLATE]], hubs=hubs)


@pytest.fixture(scope="module")
def answers(kit: Kit) -> ContactOracle:
    return ContactOracle(kit)


@pytest.fixture(scope="module")
def restorer(answers: ContactOracle) -> HubRestorer:
    return HubRestorer(answers, upright=True)


def placed(kit: Kit, shape: list[Placed], answers: ContactOracle) -> Assembly:
    """A shape of the kit's parts with its true contacts."""
    (model,) = models_of(MESHES, [shape])
    types = np.array([kit.type_names().index(part.mesh_name) for part in model.parts], dtype=np.int16)
    poses = np.array([part.pose @ translation_matrix(MESHES[part.mesh_name].centroid) for part in model.parts])
    return Assembly(types, poses, answers.contact.contacts(types, poses))


def test_exemplar_gets_its_hubs_back_with_all_contacts(kit: Kit, answers: ContactOracle, restorer: HubRestorer) -> None:
    whole = restorer.fit(kit.exemplars[0].assembly)
    expected = placed(kit, [*chain(3), PLATE], answers)
    np.testing.assert_array_equal(whole.types, expected.types)
    np.testing.assert_array_equal(whole.edges, expected.edges)
    np.testing.assert_allclose(whole.poses[-1][:3, 3], expected.poses[-1][:3, 3], atol=1e-6)


def test_moved_and_turned_shape_gets_its_hub(kit: Kit, answers: ContactOracle, restorer: HubRestorer) -> None:
    bare = kit.exemplars[0].assembly
    motion = pose(7, 8, 9, 1)
    moved = restorer.fit(Assembly(bare.types, motion @ bare.poses, bare.edges))
    np.testing.assert_allclose(moved.poses[-1], motion @ restorer.fit(bare).poses[-1], atol=1e-6)


def test_hub_is_left_out_with_too_few_neighbours(kit: Kit, answers: ContactOracle, restorer: HubRestorer) -> None:
    assert restorer.fit(placed(kit, chain(3)[1:], answers)).types.tolist() == [1, 1, 1, 0], "one cap of two"


def test_hub_is_left_out_where_a_part_is_in_its_way(kit: Kit, answers: ContactOracle, restorer: HubRestorer) -> None:
    blocked = placed(kit, [*chain(3), ("link", pose(1, -0.55, 0))], answers)
    assert len(restorer.fit(blocked)) == len(blocked)


def test_only_without_upright_can_a_hub_be_turned_over(kit: Kit, answers: ContactOracle) -> None:
    free = HubRestorer(answers, upright=False).fit(kit.exemplars[0].assembly)
    assert sorted(np.round(free.poses[5:, 1, 3], 3).tolist()) == [-0.55, 0.55]


def test_verification_and_strings_accept_shapes_with_restored_hubs(
    kit: Kit, answers: ContactOracle, restorer: HubRestorer
) -> None:
    alphabet = make_alphabet(kit.type_names())
    for exemplar in kit.exemplars:
        whole = restorer.fit(exemplar.assembly)
        names = kit_shape(kit, whole).part_names
        labels = [kit.types[index].name for index in whole.types]
        described = zip(names, labels, whole.poses.tolist(), strict=True)
        parts = [{"name": name, "label": label, "pose": pose} for name, label, pose in described]
        record, contacts = json.dumps({"parts": parts}).encode(), pair_bytes(whole.edges)
        members = {"json": record, CONTACTS: contacts, "glb": glb_bytes(kit_shape(kit, whole))}
        assert geometry_faults(kit, members) == []
        string = canonical_string(whole.types, whole.edges, alphabet).string
        assert len(check_string(string, alphabet, kit.grammar).types) == len(whole)
    link, plate = (alphabet.tokens[kit.type_names().index(name)] for name in ("link", "plate"))
    with pytest.raises(StringError, match="never neighbours"):
        check_string(f"{link}{plate}", alphabet, kit.grammar)


def test_min_hubs_is_a_number_or_a_share(kit: Kit, restorer: HubRestorer) -> None:
    (plate,), link = kit.grammar.hubs, kit.type_names().index("link")

    def has(required: float, hubs: int, others: int) -> bool:
        types = np.array([plate] * hubs + [link] * others)
        poses, edges = np.tile(np.eye(4), (len(types), 1, 1)), np.empty((0, 2), np.int32)
        return restorer.has_hubs(required, Assembly(types, poses, edges))

    # the exemplar has one hub part of six
    assert [has(0.5, hubs, 24 - hubs) for hubs in (0, 1, 2)] == [False, False, True]
    assert [has(0.5, hubs, 3) for hubs in (0, 1)] == [False, True]
    assert [has(required, 1, 30) for required in (0, 1, 2)] == [True, True, False]


def test_cabinet_needs_both_of_its_sides() -> None:
    meshes = {"side": box(0.1, 4.0, 2.0), "board": box(2.0, 0.1, 1.5)}
    sides: list[Placed] = [("side", pose(x, 0, 0)) for x in (-1.05, 1.05)]
    boards: list[Placed] = [("board", pose(0, y, 0)) for y in (-0.8, -0.7, -0.6)]
    restorer = cut_out(meshes, [*sides, *boards], "side")
    cabinet = restorer.fit(restorer.kit.exemplars[0].assembly)
    (side,) = restorer.kit.grammar.hubs
    one = cabinet.select([part for part in range(len(cabinet)) if part != np.flatnonzero(cabinet.types == side)[0]])
    assert restorer.has_hubs(0.5, cabinet)
    assert not restorer.has_hubs(0.5, one), "half of its sides are enough by number, but each is as large as itself"


def test_rails_end_where_their_road_ends() -> None:
    meshes = {"road": box(5.0, 0.2, 1.0), "rail": box(0.5, 0.3, 0.1)}

    def rails(count: int) -> list[Placed]:
        return [("rail", pose(0.5 * place - 2.25, 0.25, 0.3)) for place in range(count)]

    restorer = cut_out(meshes, [("road", pose(0, 0, 0)), *rails(10)], "road")
    asked = {count: models_of(meshes, [rails(count)])[0] for count in (10, 11, 15)}
    poses = {count: np.array([part.pose for part in model.parts]) for count, model in asked.items()}
    rail = restorer.kit.type_names().index("rail")
    found = {}
    for count, pose_of_part in poses.items():
        types = np.full(count, rail, dtype=np.int16)
        whole = restorer.fit(Assembly(types, pose_of_part, restorer.oracle.contact.contacts(types, pose_of_part)))
        assert len(whole) > count, "it has its road"
        found[count] = restorer.has_hubs(0.5, whole)
    assert found == {10: True, 11: False, 15: False}


def cut_out(meshes: dict[str, trimesh.Trimesh], shape: list[Placed], hub: str) -> HubRestorer:
    """Return the hub restorer of a kit of one shape from which a type is left out."""
    return HubRestorer(ContactOracle(kit_of(meshes, [shape], hubs=HubConfig(types=(hub,), restore=True))), upright=True)
