"""What holds a part: at which sides, and halves of sides, it touched others in the exemplars."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stages.shape.kit import Assembly, Kit
from stages.variations.substitution.attachment import AttachmentTest
from tests.toy_kits.chains_and_rings import box, kit_of, pose

BOARDS = {"upright": box(0.1, 2.0, 1.0), "shelf": box(1.9, 0.1, 0.9), "top": box(2.1, 0.1, 1.1)}


def bookcase() -> tuple[Kit, Assembly, AttachmentTest]:
    """Two uprights with a shelf between them and a top on them."""
    uprights = [("upright", pose(x, 1.0, 0.0)) for x in (-1.0, 1.0)]
    kit = kit_of(BOARDS, [[*uprights, ("shelf", pose(0.0, 0.8, 0.0)), ("top", pose(0.0, 2.05, 0.0))]])
    return kit, kit.exemplars[0].assembly, AttachmentTest(kit, kit.contact_tolerance)


def parts_of(kit: Kit, assembly: Assembly, name: str) -> np.ndarray:
    return np.flatnonzero([kit.types[part_type].name == name for part_type in assembly.types])


def test_exemplars_are_attached_and_shapes_without_upright_shelf_or_top_are_not() -> None:
    kit, whole, test = bookcase()
    assert not test.is_loose(whole)
    for name in BOARDS:
        lost = parts_of(kit, whole, name)[0]
        assert test.is_loose(whole.select(np.delete(np.arange(len(whole)), lost)))


def test_top_that_rests_on_one_half_is_loose() -> None:
    kit, whole, test = bookcase()
    top = int(parts_of(kit, whole, "top")[0])
    poses = whole.poses.copy()
    poses[top, 0, 3] += 1.0
    left = int(parts_of(kit, whole, "upright")[np.argmin(whole.poses[parts_of(kit, whole, "upright"), 0, 3])])
    kept = ~((whole.edges == top).any(axis=1) & (whole.edges == left).any(axis=1))
    assert test.is_loose(replace(whole, poses=poses, edges=whole.edges[kept]))


def test_attachment_does_not_depend_on_pose_or_symmetry() -> None:
    kit, whole, test = bookcase()
    turned = pose(3.0, 0.0, 1.0, 1)
    assert not test.is_loose(replace(whole, poses=turned @ whole.poses))
    for symmetry in range(len(kit.types[0].symmetries)):
        turns = [kit.types[part].symmetries[symmetry % len(kit.types[part].symmetries)] for part in whole.types]
        assert not test.is_loose(replace(whole, poses=whole.poses @ np.stack(turns)))


def test_ground_supports_parts_that_were_supported_from_below() -> None:
    kit = kit_of(
        {"post": box(0.2, 1.0, 0.2), "slab": box(1.0, 0.2, 1.0)}, [[("slab", pose(0, 0, 0)), ("post", pose(0, 0.6, 0))]]
    )
    whole, test = kit.exemplars[0].assembly, AttachmentTest(kit, kit.contact_tolerance)
    post = parts_of(kit, whole, "post")
    assert not test.is_loose(whole.select(post))
