"""Divisions: pieces of a front fill its place, are held as it was, and keep what hangs on it."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
import trimesh

from stages.proportions.text import ProportionError, Proportions, ProportionShapes, proportion_text, read_proportions
from stages.rows.changes import change_json, changed, read_change
from stages.rows.divisions import GAP_SHARE, Division, divided, find_divisions
from stages.rows.draws import LayoutDraws
from stages.rows.kit_rows import rows_of_kit
from stages.rows.layout import Layout, layout_of
from stages.rows.settings import RowsConfig
from stages.rows.slabs import SlabError
from stages.shape.kit import Kit
from tests.stages.rows import models
from tests.stages.rows.soundness import assert_sound
from tests.toy_kits.chains_and_rings import box, pose

UP_AXIS = 1
DOOR_PART, KNOB_PART = 1, 2


def counts(kit: Kit, layout: Layout) -> Counter[str]:
    return Counter(kit.types[kind].label for kind in layout.types.tolist())


def all_divisions(layout: Layout) -> list[Division]:
    return [division for alike in find_divisions(layout, UP_AXIS) for division in alike]


def test_a_door_is_divided_side_by_side_and_one_above_the_other() -> None:
    _, layout = models.chest_with_door()
    assert all_divisions(layout) == [Division((DOOR_PART,), axis, count) for axis in (0, 1) for count in (2, 3, 4)]


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("count", [2, 3, 4])
def test_contacts_are_those_of_the_meshes_and_pieces_have_knobs(axis: int, count: int) -> None:
    kit, layout = models.chest_with_door()
    division = Division((DOOR_PART,), axis, count)
    made = divided(layout, division)
    assert counts(kit, made) == {"body": 1, "door": division.count, "knob": division.count}
    assert_sound(kit, made)


@pytest.mark.parametrize("axis", [0, 1])
def test_pieces_fill_the_place_of_the_front_with_equal_gaps(axis: int) -> None:
    kit, layout = models.chest_with_door()
    made = divided(layout, Division((DOOR_PART,), axis, 3))
    doors = np.array([kit.types[kind].label == "door" for kind in made.types.tolist()])
    boxes = made.boxes[doors][np.argsort(made.boxes[doors, 0, axis])]
    np.testing.assert_allclose(boxes[0, 0], layout.boxes[DOOR_PART, 0])
    np.testing.assert_allclose(boxes[-1, 1], layout.boxes[DOOR_PART, 1])
    pitch = boxes[1, 0, axis] - boxes[0, 0, axis]
    np.testing.assert_allclose(boxes[1:, 0, axis] - boxes[:-1, 1, axis], GAP_SHARE * pitch)
    assert len({id(mesh) for mesh, is_door in zip(made.meshes, doors, strict=True) if is_door}) == 1


def test_a_knob_keeps_its_size_and_its_distance_from_the_edge() -> None:
    kit, layout = models.chest_with_door()
    made = divided(layout, Division((DOOR_PART,), 0, 2))
    knobs = [part for part, kind in enumerate(made.types.tolist()) if kit.types[kind].label == "knob"]
    doors = [part for part, kind in enumerate(made.types.tolist()) if kit.types[kind].label == "door"]
    distance = layout.boxes[DOOR_PART, 1, 0] - layout.boxes[KNOB_PART, 1, 0]
    for knob, door in zip(knobs, doors, strict=True):
        assert made.meshes[knob] is layout.meshes[KNOB_PART]
        assert made.boxes[door, 1, 0] - made.boxes[knob, 1, 0] == pytest.approx(distance)


def test_frames_keep_their_width() -> None:
    kit, layout = models.chest_with_glass_door()
    (part,) = (part for part, kind in enumerate(layout.types.tolist()) if kit.types[kind].label == "frame")
    made = divided(layout, Division((part,), 0, 2))
    assert counts(kit, made) == {"body": 1, "frame": 2, "pane": 2}
    inner = np.unique(np.round(made.points[part][:, 0], 9))
    outer = np.unique(np.round(layout.points[part][:, 0], 9))
    np.testing.assert_allclose(np.diff(inner)[[0, -1]], np.diff(outer)[[0, -1]])


def test_doors_of_one_size_are_divided_together_or_alone() -> None:
    kit, layout = models.chest_with_door(doors=2)
    (alike,) = find_divisions(layout, UP_AXIS)
    assert {division.fronts for division in alike} == {(1, 2), (1,), (2,)}
    together = next(division for division in alike if len(division.fronts) == 2 and division.axis == 1)
    assert counts(kit, divided(layout, together))["door"] == 2 * together.count


@pytest.mark.parametrize(
    ("parts", "reason"),
    [
        ([("door", pose(0.0, 0.5, 0.22))], "nothing hangs on it"),
        ([("door", pose(0.0, 0.5, 0.22)), ("screw", pose(0.0, 0.5, 0.245))], "a screw alone hangs on it"),
        ([("door", pose(0.0, 0.5, 0.26)), ("hinge", pose(-0.4, 0.5, 0.22)), ("knob", pose(0.3, 0.5, 0.305))],
         "a hinge alone holds it"),
        ([("door", pose(0.0, 0.5, 0.27)), ("ring", pose(0.0, 0.5, 0.225)), ("lamp", pose(0.0, 0.5, 0.24))],
         "what hangs on it is behind it"),
        ([("disc", pose(0.0, 0.5, 0.22)), ("knob", pose(0.3, 0.5, 0.265))], "it is round"),
        ([("door", pose(0.0, 0.5, 0.22)), ("bar", pose(0.0, 0.5, 0.27))], "a bar reaches beyond it"),
    ],
)  # fmt: skip
def test_other_parts_stay_whole(parts: list[tuple[str, np.ndarray]], reason: str) -> None:
    disc = trimesh.creation.cylinder(0.45, 0.04)
    solid = np.ones((3, 3), dtype=bool)
    solid[1, 1] = False
    ring = models.plate([-0.45, -0.4, 0.4, 0.45], [-0.45, -0.4, 0.4, 0.45], 0.05, solid)
    others = {
        "ring": ring,
        "lamp": box(0.2, 0.2, 0.02),
        "hinge": box(0.02, 0.1, 0.04),
        "bar": box(1.2, 0.05, 0.06),
        "disc": disc,
        "screw": box(0.02, 0.02, 0.01),
    }
    meshes = models.CHEST | others
    _, layout = models.layout(meshes, [("body", pose(0.0, 0.5, 0.0)), *parts])
    assert not find_divisions(layout, UP_AXIS), reason


@pytest.mark.parametrize("angle", [0.0, 0.2])
def test_a_lid_stays_whole_if_it_leans(angle: float) -> None:
    lean = trimesh.transformations.rotation_matrix(angle, [1, 0, 0])
    meshes = {"base": box(1.2, 0.5, 1.0), "lid": box(0.9, 0.8, 0.03), "logo": box(0.4, 0.3, 0.02)}
    parts = [
        ("base", pose(0.0, -0.25, 0.5)),
        ("lid", lean @ pose(0.0, 0.4, 0.015)),
        ("logo", lean @ pose(0.0, 0.4, -0.01)),
    ]
    _, layout = models.layout(meshes, parts)
    assert bool(find_divisions(layout, UP_AXIS)) == (angle == 0.0)


@pytest.mark.parametrize(("sides", "is_front"), [(3, True), (4, True), (48, False)])
def test_a_door_with_a_round_window_stays_whole(sides: int, is_front: bool) -> None:
    """Its window would be squeezed; a triangular or square one of the same size may be."""
    window = trimesh.creation.cylinder(0.3, 0.03, sections=sides)
    window.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 4, [0, 0, 1]))
    parts = [("body", pose(0.0, 0.5, 0.0)), ("door", pose(0.0, 0.5, 0.22)), ("window", pose(0.0, 0.5, 0.255))]
    _, layout = models.layout(models.CHEST | {"window": window}, parts)
    assert bool(find_divisions(layout, UP_AXIS)) == is_front


def test_walls_stay_whole_if_one_of_them_has_no_banner() -> None:
    meshes = {"floor": box(4.0, 0.1, 1.0), "wall": box(0.9, 0.9, 0.1), "banner": box(0.4, 0.4, 0.02)}
    walls = [("wall", pose(x, 0.5, 0.0)) for x in (-1.5, -0.5, 0.5, 1.5)]
    banners = [("banner", pose(x, 0.5, 0.06)) for x in (-1.5, -0.5)]
    _, layout = models.layout(meshes, [("floor", pose(0.0, 0.0, 0.0)), *walls, *banners])
    assert not find_divisions(layout, UP_AXIS)
    _, layout = models.layout(meshes, [("floor", pose(0.0, 0.0, 0.0)), *walls[:2], *banners])
    assert find_divisions(layout, UP_AXIS)


def test_a_table_top_on_its_legs_stays_whole() -> None:
    _, layout = models.table_of_boxes()
    assert not find_divisions(layout, UP_AXIS)


def test_a_shelf_with_a_vase_stays_whole() -> None:
    meshes = {"body": box(1.0, 1.0, 0.1), "shelf": box(0.9, 0.04, 0.4), "vase": box(0.1, 0.2, 0.1)}
    parts = [("body", pose(0.0, 0.5, -0.05)), ("shelf", pose(0.0, 0.5, 0.2)), ("vase", pose(0.2, 0.62, 0.2))]
    _, layout = models.layout(meshes, parts)
    assert find_divisions(layout, up=0)
    assert not find_divisions(layout, UP_AXIS)


def test_its_json_says_what_is_divided_and_makes_it_again() -> None:
    kit, layout = models.chest_with_door()
    division = Division((DOOR_PART,), 0, 3)
    stated = change_json(division)
    assert stated == {"fronts": [DOOR_PART], "axis": "x", "pieces": 3}
    assert read_change(stated) == division
    assert changed(layout, read_change(stated)).key == divided(layout, division).key
    name = kit.exemplars[0].name
    shapes = ProportionShapes(kit)
    lattice = shapes.unwarped(name, (division,)).lattice
    text = proportion_text(Proportions(name, tuple(np.ones(len(knots) - 1) for knots in lattice.knots), (division,)))
    assert read_proportions(text).changes == (division,)


@pytest.mark.parametrize("part", [0, KNOB_PART, 99])
def test_what_is_no_front_is_refused(part: int) -> None:
    kit, layout = models.chest_with_door()
    with pytest.raises(SlabError):
        divided(layout, Division((part,), 0, 2))
    with pytest.raises(ProportionError):
        ProportionShapes(kit).unwarped(kit.exemplars[0].name, (Division((part,), 0, 2),))


@pytest.mark.parametrize("wrong", [{"pieces": 1}, {"pieces": 99}, {"axis": "w"}, {"fronts": []}, {"fronts": [-1]}])
def test_impossible_numbers_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="fronts are divided"):
        read_change({"fronts": [DOOR_PART], "axis": "x", "pieces": 2} | wrong)


def test_draws_divide_fronts_where_nothing_else_can_change() -> None:
    kit, layout = models.chest_with_door()
    draws = LayoutDraws(layout, RowsConfig(), is_alone=True, up=UP_AXIS)
    assert draws.can_change
    assert not LayoutDraws(layout, RowsConfig(), up=UP_AXIS).can_change, "a search exchanges parts instead"
    assert not LayoutDraws(layout, RowsConfig(divide_fronts=False), is_alone=True, up=UP_AXIS).can_change
    drawn = [draws.draw(np.random.default_rng(seed)) for seed in range(24)]
    made = {counts(kit, one[1])["door"] for one in drawn if one is not None}
    assert made == {2, 3, 4}
    assert {row.sentence for row in rows_of_kit(kit)} == {
        "door in up to 4 pieces, along x",
        "door in up to 4 pieces, along y",
    }
    assert layout_of(kit, kit.exemplars[0]).key == layout.key
