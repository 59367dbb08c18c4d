"""Neighbourhoods, dockings and depths observed in assemblies."""

from __future__ import annotations

import numpy as np
import pytest

from stages.exemplars.observed_grammar import (
    observe_contacts,
    observe_dockings,
    observe_grammar,
    observe_neighbourhoods,
)
from stages.exemplars.settings import ContactConfig
from stages.shape.arrays import FloatArray
from stages.shape.geometry.contact import ContactTest
from stages.shape.geometry.docking import DockingTable
from stages.shape.kit import Assembly, PartType
from tests.stages.exemplars.blocks import CUBE, SLAB, block_kit, model, ring
from tests.stages.shape.geometry.bodies import box, hull, part, placed, random_rotation

FACES = ContactConfig(kinds=("face",))


def row(count: int) -> dict[str, tuple[tuple[np.ndarray, np.ndarray], tuple[float, float, float]]]:
    return {f"cube.{k}": (CUBE, (float(k), 0.0, 0.0)) for k in range(count)}


class TestNeighbourhoods:
    def test_ring_of_four_has_one_for_all(self) -> None:
        kit = block_kit(ring(), row_neighbourhoods=False)
        assert kit.grammar.neighbourhoods == {0: {((0, 3),): 4}}
        assert kit.exemplars[0].assembly.edges.tolist() == [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]

    def test_only_contacts_that_count_make_neighbours(self) -> None:
        kit = block_kit(ring(), contact=FACES, row_neighbourhoods=False)
        assert kit.grammar.neighbourhoods == {0: {((0, 2),): 4}}
        assert kit.exemplars[0].assembly.edges.tolist() == [[0, 1], [0, 3], [1, 2], [2, 3]]
        assert {docking.kind for docking in kit.grammar.dockings} == {"face"}

    def test_row_has_ends_and_a_middle(self) -> None:
        assert block_kit(model(row(5))).grammar.neighbourhoods == {0: {((0, 1),): 2, ((0, 2),): 3}}

    def test_several_shapes_and_types_count_together(self) -> None:
        tower = model({"slab": (SLAB, (0, 0, 0)), "top": (CUBE, (0, 0, 1.5)), "foot": (CUBE, (0, 0, -1.5))}, "tower")
        kit = block_kit(model(row(3)), tower)
        assert kit.type_names() == ("cube_0", "slab")
        assert kit.grammar.neighbourhoods == {0: {((0, 1),): 2, ((0, 2),): 1, ((1, 1),): 2}, 1: {((0, 2),): 1}}

    def test_parts_without_neighbours_have_the_empty_one(self) -> None:
        alone = Assembly(np.zeros(1, np.int16), np.eye(4)[None], np.empty((0, 2), np.int32))
        assert observe_neighbourhoods([alone]) == {0: {(): 1}}


class TestDockings:
    def test_cubes_in_a_ring_dock_in_two_ways_whichever_side_they_show(self) -> None:
        dockings = {docking.kind: docking for docking in block_kit(ring()).grammar.dockings}
        assert {kind: docking.count for kind, docking in dockings.items()} == {"face": 4, "line": 2}
        assert all(docking.depth == pytest.approx(0.0, abs=1e-5) for docking in dockings.values())
        assert np.linalg.norm(dockings["line"].pose[:3, 3]) == pytest.approx(np.sqrt(2))

    def test_turning_a_cube_in_itself_makes_no_docking_of_its_own(self) -> None:
        quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
        straight = model(row(3))
        turned = model(row(3))
        turned.parts[1].pose[:3, :3] = quarter
        assert len(block_kit(straight).grammar.dockings) == len(block_kit(turned).grammar.dockings) == 1

    def test_slab_docks_with_its_end_and_with_its_side(self) -> None:
        parts = {
            "slab": (SLAB, (0, 0, 0)),
            "end": (CUBE, (0, 0, 1.5)),
            "side": (CUBE, (1, 0, 0.5)),
            "far": (CUBE, (0, 1, -0.5)),
        }
        dockings = block_kit(model(parts), contact=FACES).grammar.dockings
        slab_and_cube = [docking for docking in dockings if docking.a != docking.b]
        assert sorted(docking.count for docking in slab_and_cube) == [1, 2]

    def test_both_ends_of_a_docking_of_two_alike_parts_are_one(self) -> None:
        rng = np.random.default_rng(2)
        types = [part(hull(rng))]
        pose = placed(1, 2, 3, random_rotation(rng))
        start, other = placed(rotation=random_rotation(rng)), placed(5, 5, 5)
        poses = np.array([start, start @ pose, other @ pose, other])
        edges = np.array([[0, 1], [2, 3]], dtype=np.int32)
        (dockings,) = observe_dockings(types, [Assembly(np.zeros(4, np.int16), poses, edges)], 1e-3)
        assert dockings.count == 2
        np.testing.assert_allclose(dockings.pose, pose, atol=1e-12)

    def test_poses_within_tolerance_are_one_docking_and_beyond_are_two(self) -> None:
        types = [part(hull(np.random.default_rng(3)))]
        shifts = [0.0, 0.5, -0.9, 2.5]
        poses: list[FloatArray] = []
        for index, shift in enumerate(shifts):
            poses += [placed(0, 9.0 * index), placed(1.0, 9.0 * index + shift * 1e-3)]
        edges = np.arange(8, dtype=np.int32).reshape(-1, 2)
        dockings = observe_dockings(types, [Assembly(np.zeros(8, np.int16), np.array(poses), edges)], 1e-3)
        assert [docking.count for docking in dockings] == [3, 1]

    def test_every_contact_of_an_exemplar_is_found_again_in_the_table(self) -> None:
        rng = np.random.default_rng(4)
        types = [part(hull(rng)), part(box())]
        poses = np.array([placed(*rng.uniform(0, 4, 3), random_rotation(rng)) for _ in range(14)])
        contact = ContactTest(types, 0.01)
        kinds = rng.integers(0, 2, 14).astype(np.int16)
        assembly = Assembly(kinds, poses, contact.contacts(kinds, poses))
        contacts = observe_contacts(types, [assembly], contact, 0.01, ("point", "line", "face"))
        grammar = observe_grammar(types, [assembly], contacts, ("point", "line", "face"))
        (kept,), (dockings,) = contacts.counted, contacts.kinds
        assert kept.edges.tolist() == assembly.edges.tolist()
        labels = DockingTable(types, grammar.dockings, 0.01).label_edges(kinds, poses, assembly.edges)
        assert len(labels) > 5
        assert labels.min() >= 0
        assert sum(docking.count for docking in grammar.dockings) == len(assembly.edges) == len(dockings)
        assert [grammar.dockings[label].kind for label in (labels[:, 0] // 2).tolist()] == list(dockings)

    def test_depth_is_the_penetration_of_two_parts(self) -> None:
        parts = {"a": (CUBE, (0, 0, 0)), "b": (CUBE, (0.75, 0, 0)), "c": (CUBE, (1.5, 0, 0))}
        (docking,) = block_kit(model(parts)).grammar.dockings
        assert docking.depth == pytest.approx(0.25, abs=1e-3)


class TestNested:
    def test_nested_parts_without_contact_have_their_depth(self) -> None:
        types: list[PartType] = [part(box(2, 2, 2), "big"), part(box(0.5, 0.5, 0.5), "small")]
        contact = ContactTest(types, 1e-3)
        poses = np.array([placed(), placed(0, 0, 0), placed(5, 0, 0)])
        assembly = Assembly(np.array([1, 0, 1], np.int16), poses, np.empty((0, 2), np.int32))
        contacts = observe_contacts(types, [assembly], contact, 1e-3, ("face",))
        grammar = observe_grammar(types, [assembly], contacts, ("face",))
        assert list(grammar.nested) == [(0, 1)]
        assert grammar.nested[0, 1] == pytest.approx(0.75, abs=1e-3)
        assert contacts.kinds == [()]

    def test_parts_that_touch_are_not_nested(self) -> None:
        assert block_kit(ring()).grammar.nested == {}
        assert block_kit(ring(), contact=FACES).grammar.nested == {}
