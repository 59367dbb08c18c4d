"""Shapes that face as the exemplars do."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from trimesh.transformations import rotation_matrix, translation_matrix

from stages.shape.kit import Assembly, Kit
from stages.variations.selection.orientation import OrientationFix
from tests.toy_kits.chains_and_rings import box, kit_of, pose

MESHES = {"seat": box(2.0, 0.2, 2.0), "leg": box(0.2, 1.0, 0.2), "back": box(1.6, 1.5, 0.1)}
LEGS = [("leg", pose(x, -0.6, z)) for x in (-0.9, 0.9) for z in (-0.9, 0.9)]
CHAIR = [("seat", pose(0, 0, 0)), *LEGS, ("back", pose(0, 0.85, -0.9)), ("back", pose(0, 0.85, -0.8))]


@cache
def chair_kit() -> Kit:
    return kit_of(MESHES, [CHAIR])


def facing_of(kit: Kit, assembly: Assembly) -> Assembly:
    facing = OrientationFix(kit)
    return facing.turned_back(assembly, facing.turn(assembly))


def moved(assembly: Assembly, motion: np.ndarray) -> Assembly:
    return Assembly(assembly.types, motion @ assembly.poses, assembly.edges)


@pytest.mark.parametrize("angle", [np.pi / 2, np.pi, 3 * np.pi / 2, 0.3])
def test_chair_is_turned_to_face_as_the_exemplar(angle: float) -> None:
    chair = chair_kit().exemplars[0].assembly
    away = moved(chair, translation_matrix([3, 0, 1]) @ rotation_matrix(angle, [0, 1, 0]))
    back = facing_of(chair_kit(), away)
    turn = back.poses[:, :3, :3] @ np.swapaxes(chair.poses[:, :3, :3], 1, 2)
    np.testing.assert_allclose(turn, np.tile(np.eye(3), (len(chair), 1, 1)), atol=1e-9)
    np.testing.assert_allclose(back.poses[:, 1, 3], chair.poses[:, 1, 3], atol=1e-12)
    assert {tuple(edge) for edge in back.edges.tolist()} == {tuple(edge) for edge in chair.edges.tolist()}


def test_most_contacts_decide_and_ties_change_nothing() -> None:
    chair = chair_kit().exemplars[0].assembly
    assert facing_of(chair_kit(), chair) is chair
    table = kit_of(MESHES, [CHAIR[:-2]])
    quarter = moved(table.exemplars[0].assembly, rotation_matrix(np.pi / 2, [0, 1, 0]))
    assert facing_of(table, quarter) is quarter, "a table on four legs looks the same from four sides"


def test_unseen_contacts_do_not_count() -> None:
    chair = chair_kit().exemplars[0].assembly
    lying = moved(chair, rotation_matrix(np.pi / 2, [1, 0, 0]))
    assert facing_of(chair_kit(), lying) is lying
    alone = chair.select([0])
    assert facing_of(chair_kit(), alone) is alone
