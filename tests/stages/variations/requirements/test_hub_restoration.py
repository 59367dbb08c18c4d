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
from stages.strings.alphabet import make_alphabet
from stages.strings.encoder import canonical_string
from stages.strings.grammar_check import check_string
from stages.strings.tokens import StringError
from stages.variations.requirements.hub_restoration import HubRestorer
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
def backdrop(answers: ContactOracle) -> HubRestorer:
    return HubRestorer(answers, upright=True)


def placed(kit: Kit, shape: list[Placed], answers: ContactOracle) -> Assembly:
    """A shape of the kit's parts with its true contacts."""
    (model,) = models_of(MESHES, [shape])
    types = np.array([kit.type_names().index(part.mesh_name) for part in model.parts], dtype=np.int16)
    poses = np.array([part.pose @ translation_matrix(MESHES[part.mesh_name].centroid) for part in model.parts])
    return Assembly(types, poses, answers.contact.contacts(types, poses))


def test_an_exemplar_gets_its_hubs_back_with_all_their_contacts(
    kit: Kit, answers: ContactOracle, backdrop: HubRestorer
) -> None:
    whole = backdrop.fit(kit.exemplars[0].assembly)
    expected = placed(kit, [*chain(3), PLATE], answers)
    np.testing.assert_array_equal(whole.types, expected.types)
    np.testing.assert_array_equal(whole.edges, expected.edges)
    np.testing.assert_allclose(whole.poses[-1][:3, 3], expected.poses[-1][:3, 3], atol=1e-6)


def test_a_shape_far_away_and_turned_gets_the_hub_too(kit: Kit, answers: ContactOracle, backdrop: HubRestorer) -> None:
    bare = kit.exemplars[0].assembly
    motion = pose(7, 8, 9, 1)
    moved = backdrop.fit(Assembly(bare.types, motion @ bare.poses, bare.edges))
    np.testing.assert_allclose(moved.poses[-1], motion @ backdrop.fit(bare).poses[-1], atol=1e-6)


def test_a_hub_is_left_out_where_too_few_of_its_neighbours_stand(
    kit: Kit, answers: ContactOracle, backdrop: HubRestorer
) -> None:
    assert backdrop.fit(placed(kit, chain(3)[1:], answers)).types.tolist() == [1, 1, 1, 0], "one cap of two"


def test_a_hub_is_left_out_where_something_stands_in_its_way(
    kit: Kit, answers: ContactOracle, backdrop: HubRestorer
) -> None:
    blocked = placed(kit, [*chain(3), ("link", pose(1, -0.55, 0))], answers)
    assert len(backdrop.fit(blocked)) == len(blocked)


def test_only_without_upright_may_a_hub_stand_above_what_it_stood_below(kit: Kit, answers: ContactOracle) -> None:
    free = HubRestorer(answers, upright=False).fit(kit.exemplars[0].assembly)
    assert sorted(np.round(free.poses[5:, 1, 3], 3).tolist()) == [-0.55, 0.55]


def test_verification_and_strings_take_shapes_with_their_backdrop(
    kit: Kit, answers: ContactOracle, backdrop: HubRestorer
) -> None:
    alphabet = make_alphabet(kit.type_names())
    for exemplar in kit.exemplars:
        whole = backdrop.fit(exemplar.assembly)
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


def test_hubs_are_required_by_number_or_by_their_share_in_the_exemplars(kit: Kit, backdrop: HubRestorer) -> None:
    (plate,), link = kit.grammar.hubs, kit.type_names().index("link")

    def has(required: float, hubs: int, others: int) -> bool:
        types = np.array([plate] * hubs + [link] * others)
        poses, edges = np.tile(np.eye(4), (len(types), 1, 1)), np.empty((0, 2), np.int32)
        return backdrop.has_hubs(required, Assembly(types, poses, edges))

    # the exemplar has one hub part of six
    assert [has(0.5, hubs, 24 - hubs) for hubs in (0, 1, 2)] == [False, False, True]
    assert [has(0.5, hubs, 3) for hubs in (0, 1)] == [False, True]
    assert [has(required, 1, 30) for required in (0, 1, 2)] == [True, True, False]


def test_a_cabinet_gets_both_of_its_sides_back_or_is_none() -> None:
    meshes = {"side": box(0.1, 4.0, 2.0), "board": box(2.0, 0.1, 1.5)}
    sides: list[Placed] = [("side", pose(x, 0, 0)) for x in (-1.05, 1.05)]
    boards: list[Placed] = [("board", pose(0, y, 0)) for y in (-0.8, -0.7, -0.6)]
    backdrop = cut_out(meshes, [*sides, *boards], "side")
    cabinet = backdrop.fit(backdrop.kit.exemplars[0].assembly)
    (side,) = backdrop.kit.grammar.hubs
    one = cabinet.select([part for part in range(len(cabinet)) if part != np.flatnonzero(cabinet.types == side)[0]])
    assert backdrop.has_hubs(0.5, cabinet)
    assert not backdrop.has_hubs(0.5, one), "half of its sides are enough by number, but each is as large as itself"


def test_rails_go_no_farther_than_the_road_that_they_stand_on() -> None:
    meshes = {"road": box(5.0, 0.2, 1.0), "rail": box(0.5, 0.3, 0.1)}

    def rails(count: int) -> list[Placed]:
        return [("rail", pose(0.5 * place - 2.25, 0.25, 0.3)) for place in range(count)]

    backdrop = cut_out(meshes, [("road", pose(0, 0, 0)), *rails(10)], "road")
    asked = {count: models_of(meshes, [rails(count)])[0] for count in (10, 11, 15)}
    poses = {count: np.array([part.pose for part in model.parts]) for count, model in asked.items()}
    rail = backdrop.kit.type_names().index("rail")
    found = {}
    for count, each in poses.items():
        types = np.full(count, rail, dtype=np.int16)
        whole = backdrop.fit(Assembly(types, each, backdrop.answers.contact.contacts(types, each)))
        assert len(whole) > count, "it has its road"
        found[count] = backdrop.has_hubs(0.5, whole)
    assert found == {10: True, 11: False, 15: False}


def cut_out(meshes: dict[str, trimesh.Trimesh], shape: list[Placed], hub: str) -> HubRestorer:
    """The backdrop of a kit of one shape from which a type is left out."""
    return HubRestorer(ContactOracle(kit_of(meshes, [shape], hubs=HubConfig(types=(hub,), restore=True))), upright=True)
