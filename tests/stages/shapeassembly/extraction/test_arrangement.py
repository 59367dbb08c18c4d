from __future__ import annotations

import numpy as np
import pytest

from stages.shapeassembly.extraction.arrangement import arrange_parts, frame_parts
from stages.shapeassembly.extraction.category_rules import CATEGORY_RULES
from stages.shapeassembly.extraction.hierarchy import PartNode
from tests.stages.shapeassembly.extraction.shapes import leaf, node, turned

BOX = ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))


def labels(part: PartNode) -> object:
    return {part.label: [labels(child) for child in part.children]} if part.children else part.label


def test_chair_back_is_flattened_and_casters_collapse() -> None:
    bars = node("back_surface", [leaf("bar", *BOX), leaf("bar", *BOX)])
    back = node("chair_back", [node("back_support", [bars]), leaf("frame", *BOX)])
    caster = node("caster", [leaf("wheel", *BOX), leaf("fork", *BOX)])
    base = node("chair_base", [leaf("leg", *BOX), node("leg_set", [caster, leaf("leg", *BOX)])])
    arranged = arrange_parts(node("chair", [back, base]), CATEGORY_RULES["chair"])
    assert labels(arranged) == {
        "chair": [{"chair_back": ["bar", "bar", "frame"]}, {"chair_base": ["leg", "caster", "leg"]}]
    }


def test_without_rules_the_hierarchy_stays_but_for_nodes_of_one_child() -> None:
    seat = node("chair_seat", [node("seat_surface", [leaf("seat_board", *BOX)])])
    back = node("chair_back", [node("rail", [leaf("a", *BOX), leaf("b", *BOX)])])
    assert labels(arrange_parts(node("chair", [seat, back]), CATEGORY_RULES["any"])) == {
        "chair": ["chair_seat", {"chair_back": ["a", "b"]}]
    }


def test_doors_shelves_and_drawers_move_into_the_cabinet_frame() -> None:
    frame = node("cabinet_frame", [leaf("side", *BOX), leaf("shelf", *BOX)])
    drawer = node("drawer", [leaf("front", *BOX), leaf("handle", *BOX)])
    cabinet = node(
        "cabinet", [frame, node("fittings", [drawer, leaf("cabinet_door", *BOX)]), leaf("cabinet_base", *BOX)]
    )
    assert labels(arrange_parts(cabinet, CATEGORY_RULES["storage"])) == {
        "cabinet": [{"cabinet_frame": ["side", "shelf", "drawer", "cabinet_door"]}, "cabinet_base"]
    }


def test_moved_parts_make_a_cabinet_frame_where_there_is_none() -> None:
    cabinet = node("cabinet", [leaf("shelf", *BOX), leaf("shelf", *BOX), leaf("cabinet_base", *BOX)])
    assert labels(arrange_parts(cabinet, CATEGORY_RULES["storage"])) == {
        "cabinet": ["cabinet_base", {"cabinet_frame": ["shelf", "shelf"]}]
    }


def test_part_within_five_degrees_is_aligned_and_one_beyond_is_not() -> None:
    parts = [leaf("a", (0, 0, 0), (1, 2, 3), turned(0, 4.9)), leaf("b", (0, 0, 0), (1, 2, 3), turned(0, 5.1))]
    near, far = frame_parts(node("root", parts)).children
    np.testing.assert_array_equal(near.box.axes, np.eye(3))
    np.testing.assert_allclose(far.box.axes, turned(0, 5.1), atol=1e-12)


def test_sides_are_renamed_so_that_parts_turn_least() -> None:
    lying = leaf("lying", (0, 0, 0), (3, 2, 1), turned(2, 90))
    (part,) = frame_parts(node("root", [lying])).children
    np.testing.assert_array_equal(part.box.axes, np.eye(3))
    assert part.box.size.tolist() == pytest.approx([2, 3, 1])


def test_box_of_a_node_is_the_smallest_around_its_leaves_in_its_frame() -> None:
    axes = turned(2, 30)
    leaves = [leaf("x", tuple(np.array([x, 0, 0]) @ axes), (1, 1, 1), axes) for x in (-2.0, 2.0)]
    tilted = PartNode("tilted", leaves[0].box, tuple(leaves))
    root = frame_parts(node("root", [tilted, leaf("y", (0, 3, 0), (1, 1, 1))]))
    np.testing.assert_allclose(root.children[0].box.axes, axes, atol=1e-12)
    assert root.children[0].box.size.tolist() == pytest.approx([5, 1, 1])
    np.testing.assert_array_equal(root.box.axes, np.eye(3))
