"""Scattered parts: others number and places of like parts, each held as an old one is; legs and knobs stay."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import trimesh

from stages.proportions.text import ProportionError, ProportionShapes
from stages.proportions.warp_check import warp_fault
from stages.rows.changes import change_json, changed, read_change
from stages.rows.draws import LayoutDraws
from stages.rows.kit_rows import rows_of_kit
from stages.rows.layout import Layout
from stages.rows.scattered import Copy, ScatteredParts, Scattering, find_scattered_parts, rescattered
from stages.rows.settings import RowsConfig
from stages.rows.slabs import SlabError
from stages.shape.arrays import FloatArray
from stages.shape.geometry.contact import ContactTest
from stages.shape.kit import Kit
from tests.stages.rows import models
from tests.toy_kits.chains_and_rings import Placed, box, pose

UP_AXIS = 1
PLATE_TOP, STONE_HEIGHT = 0.1, 0.2
PLACES = ((0.5, 10.0, 20.0), (0.62, 75.0, 47.0), (0.45, 170.0, 5.0), (0.6, 250.0, 71.0))
"""Distance of each stone from the middle of the plate, and the angles of its place and of its own turn, in degrees."""


def plate(sides: int = 60) -> trimesh.Trimesh:
    """A disc of radius 1 on the ground, or a polygon."""
    disc = trimesh.creation.cylinder(1.0, PLATE_TOP, sections=sides)
    disc.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    return disc.apply_translation([0.0, PLATE_TOP / 2, 0.0])


def placed(radius: float, degrees: float, turn: float, height: float = PLATE_TOP + STONE_HEIGHT / 2) -> FloatArray:
    """A place about the vertical axis through the middle."""
    turned = trimesh.transformations.rotation_matrix(np.deg2rad(turn), [0, 1, 0])
    angle = np.deg2rad(degrees)
    turned[:3, 3] = radius * np.cos(angle), height, radius * np.sin(angle)
    return turned


@cache
def stones(more: tuple[str, ...] = (), sides: int = 60) -> tuple[Kit, Layout]:
    """Four stones that lie about on a plate.

    more: `moss` on the first stone, a `twig` across the first two, `bead` on the third and on a bead of the plate
    sides: of the plate
    """
    meshes = {"plate": plate(sides), "stone": box(0.24, STONE_HEIGHT, 0.12)}
    parts: list[Placed] = [("plate", np.eye(4)), *(("stone", placed(*place)) for place in PLACES)]
    top = PLATE_TOP + STONE_HEIGHT
    if "moss" in more:
        meshes["moss"] = box(0.06, 0.02, 0.06)
        parts.append(("moss", placed(0.5, 10.0, 20.0, top + 0.01)))
    if "twig" in more:
        first, second = (placed(*place)[:3, 3] for place in PLACES[:2])
        twig = trimesh.creation.box((float(np.linalg.norm(second - first)), 0.02, 0.02))
        meshes["twig"] = twig
        turned = trimesh.transformations.rotation_matrix(
            -np.arctan2(second[2] - first[2], second[0] - first[0]), [0, 1, 0]
        )
        turned[:3, 3] = (first + second) / 2
        turned[1, 3] = top + 0.01
        parts.append(("twig", turned))
    return models.layout(meshes, parts)


def free(layout: Layout) -> np.ndarray:
    return np.zeros(len(layout), dtype=bool)


def only_scattered(layout: Layout) -> ScatteredParts:
    (scattered,) = find_scattered_parts(layout, UP_AXIS, free(layout))
    return scattered


def assert_sound(kit: Kit, made: Layout) -> None:
    """Assert that the contacts of a layout are those of its meshes, and that its parts hang together."""
    shape = made.shape(kit)
    found = ContactTest(shape.meshes, kit.contact_tolerance).contacts(shape.assembly.types, shape.assembly.poses)
    np.testing.assert_array_equal(found, made.edges)
    assert warp_fault(kit, made.assembly(), shape) is None
    assert made.pieces().max() == 0


def test_stones_on_a_plate_are_scattered() -> None:
    kit, layout = stones()
    scattered = only_scattered(layout)
    assert scattered.members == ((1,), (2,), (3,), (4,))
    assert scattered.holders.tolist() == [0]
    assert "4 scattered stone" in [row.sentence for row in rows_of_kit(kit)]


def test_a_copy_is_an_old_stone_turned_about_the_middle_of_the_plate() -> None:
    kit, layout = stones()
    made = rescattered(layout, Scattering((1, 2, 3, 4), UP_AXIS, (), (Copy(1, 120),)))
    assert len(made) == len(layout) + 1
    expected = trimesh.transformations.rotation_matrix(np.deg2rad(-120), [0, 1, 0]) @ layout.poses[1]
    both = (expected, trimesh.transformations.rotation_matrix(np.deg2rad(120), [0, 1, 0]) @ layout.poses[1])
    assert min(np.abs(made.poses[-1] - pose).max() for pose in both) < 1e-9
    assert made.edges[-1].tolist() == [0, 5]
    assert_sound(kit, made)


def test_what_lies_on_a_stone_goes_with_it() -> None:
    kit, layout = stones(("moss",))
    scattered = only_scattered(layout)
    assert scattered.members[0] == (1, 5)
    assert {len(member) for member in scattered.members[1:]} == {1}
    with_copy = rescattered(layout, Scattering(scattered.parts, UP_AXIS, (), (Copy(1, 120),)))
    assert len(with_copy) == len(layout) + 2
    assert_sound(kit, with_copy)
    without = rescattered(layout, Scattering(scattered.parts, UP_AXIS, (1,)))
    assert len(without) == len(layout) - 2
    assert_sound(kit, without)


def test_a_stone_that_carries_part_of_something_stays() -> None:
    _, layout = stones(("twig",))
    assert not find_scattered_parts(layout, UP_AXIS, free(layout)), "two stones alone are free"


def test_a_copy_that_overlaps_a_stone_needs_its_place() -> None:
    kit, layout = stones()
    parts = (1, 2, 3, 4)
    clash = next(degrees for degrees in range(15, 360, 15) if not _is_valid(layout, parts, (), degrees))
    taken = [part for part in parts if _is_valid(layout, parts, (part,), clash)]
    assert len(taken) == 1
    made = rescattered(layout, Scattering(parts, UP_AXIS, tuple(taken), (Copy(1, clash),)))
    assert len(made) == len(layout)
    assert_sound(kit, made)


def _is_valid(layout: Layout, parts: tuple[int, ...], removed: tuple[int, ...], degrees: int) -> bool:
    try:
        rescattered(layout, Scattering(parts, UP_AXIS, removed, (Copy(1, degrees),)))
    except SlabError:
        return False
    return True


def test_a_copy_stays_on_what_holds_the_old_part() -> None:
    """On a square plate a stone in a corner has no place but in other corners."""
    meshes = {"plate": box(2.0, PLATE_TOP, 1.0), "stone": box(0.24, STONE_HEIGHT, 0.12)}
    parts: list[Placed] = [("plate", pose(0.0, PLATE_TOP / 2, 0.0))]
    parts += [("stone", placed(*place)) for place in ((0.85, 5.0, 20.0), (0.8, 165.0, 47.0), (0.4, 60.0, 71.0))]
    kit, layout = models.layout(meshes, parts)
    for degrees, is_on_it in ((90, False), (45, False), (180, True)):
        assert _is_valid(layout, (1, 2, 3), (), degrees) == is_on_it, degrees
    assert_sound(kit, rescattered(layout, Scattering((1, 2, 3), UP_AXIS, (), (Copy(1, 180),))))


def table_with_legs() -> tuple[Kit, Layout]:
    legs = [("leg", pose(x, 0.5, z)) for x in (-0.4, 0.4) for z in (-0.4, 0.4)]
    return models.layout({"top": box(1.0, 0.1, 1.0), "leg": box(0.08, 1.0, 0.08)}, [("top", pose(0, 1.05, 0)), *legs])


def leaning_legs() -> tuple[Kit, Layout]:
    """Four legs that lean outwards, each turned another way."""
    meshes, parts = {"top": box(1.0, 0.1, 1.0)}, [("top", pose(0.0, 1.0, 0.0))]
    for number, (x, z) in enumerate([(-1, -1), (-1, 1), (1, -1), (1, 1)]):
        leg = box(0.08, 1.0, 0.08)
        leg.apply_transform(trimesh.transformations.rotation_matrix(0.2 * x, [0, 0, 1]))
        leg.apply_transform(trimesh.transformations.rotation_matrix(-0.2 * z, [1, 0, 0]))
        meshes[f"leg{number}"] = leg
        parts.append((f"leg{number}", pose(0.4 * x, 0.5, 0.4 * z)))
    return models.layout(meshes, parts)


def panel_with_knobs() -> tuple[Kit, Layout]:
    places = [(-0.3, 0.7), (0.1, 0.35), (0.3, 0.8), (-0.15, 0.2)]
    knobs = [("knob", pose(x, y, 0.075)) for x, y in places]
    return models.layout(
        {"panel": box(1.0, 1.0, 0.1), "knob": box(0.1, 0.1, 0.05)}, [("panel", pose(0, 0.5, 0)), *knobs]
    )


@pytest.mark.parametrize("make", [table_with_legs, leaning_legs, panel_with_knobs])
def test_legs_and_knobs_are_not_scattered(make: object) -> None:
    assert callable(make)
    _, layout = make()
    assert not find_scattered_parts(layout, UP_AXIS, free(layout))


@pytest.mark.parametrize(("length", "is_found"), [(0.24, True), (0.1, False)])
def test_small_stones_are_not_counted(length: float, is_found: bool) -> None:
    meshes = {"plate": plate(), "stone": box(length, STONE_HEIGHT / 2, length / 2)}
    parts: list[Placed] = [("plate", np.eye(4))]
    parts += [("stone", placed(*place, PLATE_TOP + STONE_HEIGHT / 4)) for place in PLACES]
    _, layout = models.layout(meshes, parts)
    assert bool(find_scattered_parts(layout, UP_AXIS, free(layout))) == is_found


def test_two_stones_are_too_few_and_parts_of_rows_are_left_to_them() -> None:
    _, layout = stones()
    repeated = free(layout)
    repeated[1] = True
    (scattered,) = find_scattered_parts(layout, UP_AXIS, repeated)
    assert scattered.parts == (2, 3, 4)
    repeated[2] = True
    assert not find_scattered_parts(layout, UP_AXIS, repeated)


def test_a_stone_on_two_others_goes_before_them_and_is_not_copied() -> None:
    meshes = {"plate": plate(), "stone": box(0.24, STONE_HEIGHT, 0.12)}
    places = ((0.5, 0.0, 20.0), (0.5, 26.0, 47.0), (0.45, 170.0, 5.0), (0.6, 250.0, 71.0))
    upper = placed(0.5, 13.0, 92.0, PLATE_TOP + 1.5 * STONE_HEIGHT)
    parts: list[Placed] = [("plate", np.eye(4)), *(("stone", placed(*place)) for place in places), ("stone", upper)]
    kit, layout = models.layout(meshes, parts)
    scattered = only_scattered(layout)
    assert scattered.parts == (1, 2, 3, 4, 5)
    assert scattered.is_held.tolist() == [True, True, True, True, False]
    drawn = _draws(layout, scattered)
    for change, made in drawn:
        assert 5 in change.removed or not change.removed
        assert_sound(kit, made)
    assert any(change.removed for change, _ in drawn)
    with pytest.raises(SlabError, match="no longer be held"):
        rescattered(layout, Scattering((1, 2, 3, 4, 5), UP_AXIS, (1, 2)))
    with pytest.raises(SlabError, match="lies on others"):
        rescattered(layout, Scattering((1, 2, 3, 4, 5), UP_AXIS, (), (Copy(5, 90),)))


def test_a_stone_that_lies_on_one_other_goes_with_it() -> None:
    meshes = {"plate": plate(), "stone": box(0.24, STONE_HEIGHT, 0.12)}
    upper = placed(0.5, 10.0, 52.0, PLATE_TOP + 1.5 * STONE_HEIGHT)
    parts: list[Placed] = [("plate", np.eye(4)), *(("stone", placed(*place)) for place in PLACES), ("stone", upper)]
    _, layout = models.layout(meshes, parts)
    assert only_scattered(layout).members == ((1, 5), (2,), (3,), (4,))


def _draws(layout: Layout, scattered: ScatteredParts) -> list[tuple[Scattering, Layout]]:
    drawn = (scattered.drawn(2 + seed % 7, np.random.default_rng(seed)) for seed in range(40))
    return [one for one in drawn if one is not None]


def test_draws_have_other_numbers_and_places_and_can_be_made_again() -> None:
    kit, layout = stones()
    draws = LayoutDraws(layout, RowsConfig(), is_alone=True, up=UP_AXIS)
    assert draws.can_change
    assert not LayoutDraws(layout, RowsConfig(), up=UP_AXIS).scattered, "a search exchanges parts instead"
    drawn = [one for seed in range(80) if (one := draws.draw(np.random.default_rng(seed))) is not None]
    counts = {change.count for changes, _ in drawn for change in changes if isinstance(change, Scattering)}
    assert counts == set(range(2, 9))
    assert len({made.key for _, made in drawn}) > 60
    for changes, made in drawn[:20]:
        again = layout
        for change in changes:
            again = changed(again, read_change(change_json(change)))
        assert again.key == made.key
        assert_sound(kit, made)


def test_its_json_says_what_is_changed_and_makes_it_again() -> None:
    kit, layout = stones()
    change = Scattering((1, 2, 3, 4), UP_AXIS, (2,), (Copy(1, 120), Copy(3, 30)))
    stated = change_json(change)
    assert stated == {"scattered": [1, 2, 3, 4], "axis": "y", "removed": [2], "copies": [[1, 120], [3, 30]]}
    assert read_change(stated) == change
    assert changed(layout, read_change(stated)).key == rescattered(layout, change).key
    shapes = ProportionShapes(kit)
    assert len(shapes.unwarped(kit.exemplars[0].name, (change,)).assembly) == len(layout) + 1


@pytest.mark.parametrize(
    "change",
    [
        Scattering((0, 1, 2, 3), UP_AXIS, (1,)),
        Scattering((1, 2), UP_AXIS, (1,)),
        Scattering((1, 2, 3, 99), UP_AXIS, (1,)),
        Scattering((1, 2, 3), UP_AXIS, (4,)),
        Scattering((1, 1, 2, 3), UP_AXIS, (1,)),
        Scattering((1, 2, 3, 4), UP_AXIS, (1, 1)),
        Scattering((1, 2, 3), UP_AXIS, (), (Copy(4, 30),)),
        Scattering((1, 2, 3, 4), UP_AXIS, (), (Copy(1, 120), Copy(1, 120))),
    ],
)
def test_what_is_not_scattered_is_refused(change: Scattering) -> None:
    kit, layout = stones()
    with pytest.raises(SlabError):
        rescattered(layout, change)
    with pytest.raises(ProportionError):
        ProportionShapes(kit).unwarped(kit.exemplars[0].name, (change,))


@pytest.mark.parametrize(
    "wrong",
    [{"scattered": []}, {"scattered": [-1, 2, 3]}, {"axis": "w"}, {"copies": [[1, 0]]}, {"copies": [[1, 360]]}],
)
def test_impossible_numbers_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="scattered parts have"):
        read_change({"scattered": [1, 2, 3], "axis": "y", "removed": [], "copies": []} | wrong)
