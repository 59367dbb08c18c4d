"""Scattered parts: like parts in other numbers and places, each held as an old one is; legs and knobs stay."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
import pytest
import trimesh

from stages.proportions.text import ProportionError, ProportionShapes
from stages.rows.changes import change_json, changed, read_change
from stages.rows.draws import LayoutDraws
from stages.rows.kit_rows import rows_of_kit
from stages.rows.layout import Layout
from stages.rows.likeness import have_like_shapes, have_like_sizes, principal_axes
from stages.rows.scattered import ScatteredParts, Scattering, TurnedCopy, find_scattered_parts, rescattered
from stages.rows.settings import RowsConfig
from stages.rows.slabs import SlabError
from stages.shape.arrays import FloatArray
from stages.shape.kit import Kit
from tests.stages.rows import models
from tests.stages.rows.soundness import assert_sound
from tests.stages.shape.geometry.bodies import random_rotation
from tests.toy_kits.chains_and_rings import Placed, box, pose

UP_AXIS = 1
PLATE_TOP, STONE_HEIGHT = 0.1, 0.2
PLACES = ((0.5, 10.0, 20.0), (0.62, 75.0, 47.0), (0.45, 170.0, 5.0), (0.6, 250.0, 71.0))
"""Distance of each stone from the middle of the plate, and the angles of its place and of its own turn, in degrees."""
TURNS = (20.0, 47.0, 5.0, 71.0)
BAR, FLAT_BAR = box(0.24, 0.2, 0.12), box(0.24, 0.03, 0.12)
EGG = trimesh.creation.icosphere(3).apply_scale([0.16, 0.14, 0.085])


def finely_divided_bar() -> trimesh.Trimesh:
    return BAR.subdivide().subdivide()


def plate() -> trimesh.Trimesh:
    """A disc of radius 1 on the ground."""
    return models.round_plate(1.0).apply_translation([0.0, PLATE_TOP / 2, 0.0])


def placed(radius: float, degrees: float, turn: float, height: float = PLATE_TOP + STONE_HEIGHT / 2) -> FloatArray:
    """A place about the vertical axis through the middle."""
    turned = trimesh.transformations.rotation_matrix(np.deg2rad(turn), [0, 1, 0])
    angle = np.deg2rad(degrees)
    turned[:3, 3] = radius * np.cos(angle), height, radius * np.sin(angle)
    return turned


@cache
def stones(more: str = "") -> tuple[Kit, Layout]:
    """Four stones that lie about on a plate.

    more: `moss` on the first stone, or a `twig` across the first two
    """
    meshes = {"plate": plate(), "stone": box(0.24, STONE_HEIGHT, 0.12)}
    parts: list[Placed] = [("plate", np.eye(4)), *(("stone", placed(*place)) for place in PLACES)]
    top = PLATE_TOP + STONE_HEIGHT
    if more == "moss":
        meshes["moss"] = box(0.06, 0.02, 0.06)
        parts.append(("moss", placed(0.5, 10.0, 20.0, top + 0.01)))
    if more == "twig":
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


def test_stones_on_a_plate_are_scattered() -> None:
    kit, layout = stones()
    scattered = only_scattered(layout)
    assert scattered.members == ((1,), (2,), (3,), (4,))
    assert scattered.holders.tolist() == [0]
    assert "4 scattered stone" in [row.sentence for row in rows_of_kit(kit)]


def test_a_copy_is_an_old_stone_turned_about_the_middle_of_the_plate() -> None:
    kit, layout = stones()
    made = rescattered(layout, Scattering((1, 2, 3, 4), UP_AXIS, (), (TurnedCopy(1, 120),)))
    assert len(made) == len(layout) + 1
    expected = trimesh.transformations.rotation_matrix(np.deg2rad(120), [0, -1, 0]) @ layout.poses[1]
    np.testing.assert_allclose(made.poses[-1], expected, atol=1e-9)
    assert made.edges[-1].tolist() == [0, 5]
    assert_sound(kit, made)


def test_what_lies_on_a_stone_goes_with_it() -> None:
    kit, layout = stones("moss")
    scattered = only_scattered(layout)
    assert scattered.members[0] == (1, 5)
    assert {len(member) for member in scattered.members[1:]} == {1}
    with_copy = rescattered(layout, Scattering(scattered.parts, UP_AXIS, (), (TurnedCopy(1, 120),)))
    assert len(with_copy) == len(layout) + 2
    assert_sound(kit, with_copy)
    without = rescattered(layout, Scattering(scattered.parts, UP_AXIS, (1,)))
    assert len(without) == len(layout) - 2
    assert_sound(kit, without)


def test_a_stone_that_carries_part_of_something_stays() -> None:
    _, layout = stones("twig")
    assert not find_scattered_parts(layout, UP_AXIS, free(layout)), "two stones alone are free"


def test_a_copy_that_overlaps_a_stone_needs_its_place() -> None:
    kit, layout = stones()
    parts = (1, 2, 3, 4)
    clash = next(degrees for degrees in range(15, 360, 15) if not _is_valid(layout, parts, (), degrees))
    taken = [part for part in parts if _is_valid(layout, parts, (part,), clash)]
    assert len(taken) == 1
    made = rescattered(layout, Scattering(parts, UP_AXIS, tuple(taken), (TurnedCopy(1, clash),)))
    assert len(made) == len(layout)
    assert_sound(kit, made)


def _is_valid(layout: Layout, parts: tuple[int, ...], removed: tuple[int, ...], degrees: int, part: int = 1) -> bool:
    try:
        rescattered(layout, Scattering(parts, UP_AXIS, removed, (TurnedCopy(part, degrees),)))
    except SlabError:
        return False
    return True


def test_a_copy_stays_on_what_holds_the_old_part() -> None:
    """On an oblong plate a stone near one end has its only other place near the other end."""
    meshes = {"plate": box(2.0, PLATE_TOP, 1.0), "stone": box(0.24, STONE_HEIGHT, 0.12)}
    parts: list[Placed] = [("plate", pose(0.0, PLATE_TOP / 2, 0.0))]
    parts += [("stone", placed(*place)) for place in ((0.85, 5.0, 20.0), (0.8, 165.0, 47.0), (0.45, 8.0, 0.0))]
    kit, layout = models.layout(meshes, parts)
    for degrees, is_on_it in ((90, False), (30, False), (180, True)):
        assert _is_valid(layout, (1, 2, 3), (), degrees) == is_on_it, degrees
    for degrees, is_on_it in ((90, False), (180, True)):
        assert _is_valid(layout, (1, 2, 3), (), degrees, 3) == is_on_it, "half of it would stand over the edge"
    assert_sound(kit, rescattered(layout, Scattering((1, 2, 3), UP_AXIS, (), (TurnedCopy(1, 180),))))


def test_a_copy_touches_what_holds_the_old_part() -> None:
    """Between the arms of a cross there is nothing to stand on."""
    cross = trimesh.util.concatenate([box(2.0, PLATE_TOP, 0.4), box(0.4, PLATE_TOP, 2.0)])
    meshes = {"cross": cross.apply_translation([0.0, PLATE_TOP / 2, 0.0]), "stone": box(0.24, STONE_HEIGHT, 0.12)}
    parts: list[Placed] = [("cross", np.eye(4))]
    parts += [("stone", placed(*place)) for place in ((0.7, 8.0, 20.0), (0.8, 98.0, 47.0), (0.5, 191.0, 71.0))]
    _, layout = models.layout(meshes, parts)
    for degrees in (90, 180, 270):
        assert _is_valid(layout, (1, 2, 3), (2, 3), degrees)
        assert not _is_valid(layout, (1, 2, 3), (2, 3), degrees - 45)


def table_with_legs() -> tuple[Kit, Layout]:
    legs = [("leg", pose(x, 0.15, z)) for x in (-0.4, 0.4) for z in (-0.4, 0.4)]
    return models.layout({"top": box(1.0, 0.1, 1.0), "leg": box(0.1, 0.3, 0.1)}, [("top", pose(0, 0.35, 0)), *legs])


def leaning_legs() -> tuple[Kit, Layout]:
    """Four legs that lean outwards, each turned another way, and each the mirror image of two others."""
    meshes, parts = {"top": box(1.0, 0.1, 1.0)}, [("top", pose(0.0, 0.3, 0.0))]
    for number, (x, z) in enumerate([(-1, -1), (-1, 1), (1, -1), (1, 1)]):
        leg = box(0.1, 0.4, 0.1)
        leg.apply_transform(trimesh.transformations.rotation_matrix(0.2 * x, [0, 0, 1]))
        leg.apply_transform(trimesh.transformations.rotation_matrix(-0.2 * z, [1, 0, 0]))
        meshes[f"leg{number}"] = leg
        parts.append((f"leg{number}", pose(0.4 * x, 0.1, 0.4 * z)))
    return models.layout(meshes, parts)


def panel_with_knobs() -> tuple[Kit, Layout]:
    places = [(-0.3, 0.7), (0.1, 0.35), (0.3, 0.8), (-0.15, 0.2)]
    knobs = [("knob", pose(x, y, 0.075)) for x, y in places]
    return models.layout(
        {"panel": box(1.0, 1.0, 0.1), "knob": box(0.1, 0.1, 0.05)}, [("panel", pose(0, 0.5, 0)), *knobs]
    )


def hanging(turns: Sequence[float], bars: Sequence[trimesh.Trimesh] = (BAR,)) -> tuple[Kit, Layout]:
    """Four bars that hang under a round plate, each with its own turn in degrees.

    bars: their meshes, the last one for all that are left
    """
    meshes = {"plate": plate(), **{f"bar{number}": bar for number, bar in enumerate(bars)}}
    parts: list[Placed] = [("plate", np.eye(4))]
    for number, (place, turn) in enumerate(zip(PLACES, turns, strict=True)):
        name = f"bar{min(number, len(bars) - 1)}"
        parts.append((name, placed(*place[:2], turn, -float(meshes[name].bounds[1, 1]))))
    return models.layout(meshes, parts)


@pytest.mark.parametrize(
    "make",
    [
        table_with_legs,
        leaning_legs,
        panel_with_knobs,
        lambda: hanging((0, 0, 0, 0)),
        lambda: hanging(TURNS, [FLAT_BAR]),
    ],
)
def test_legs_and_knobs_are_not_scattered(make: Callable[[], tuple[Kit, Layout]]) -> None:
    _, layout = make()
    assert not find_scattered_parts(layout, UP_AXIS, free(layout))


def test_parts_that_hang_are_scattered_if_they_are_turned_in_many_ways() -> None:
    _, layout = hanging(TURNS)
    assert only_scattered(layout).parts == (1, 2, 3, 4)


@pytest.mark.parametrize(
    ("bars", "found"),
    [
        ([BAR, EGG, EGG, BAR], []),
        ([BAR, EGG, BAR, BAR], [(1, 3, 4)]),
        ([BAR, finely_divided_bar(), BAR, BAR], [(1, 2, 3, 4)]),
    ],
)
def test_parts_that_hang_have_one_shape(bars: list[trimesh.Trimesh], found: list[tuple[int, ...]]) -> None:
    """Eggs have the size of bars. Only the shape counts, not the mesh."""
    _, layout = hanging(TURNS, bars)
    sizes = [principal_axes(points)[0] for points in layout.points[1:]]
    assert all(have_like_sizes(sizes[0], size) for size in sizes)
    assert [scattered.parts for scattered in find_scattered_parts(layout, UP_AXIS, free(layout))] == found


def test_mirror_images_have_no_like_shape() -> None:
    hand = trimesh.util.concatenate([box(1.0, 0.3, 0.2), box(0.2, 1.0, 0.2), box(0.2, 0.3, 1.2)])
    hand.vertices[8:16] += [0.4, 0.4, 0.0]
    hand.vertices[16:24] += [-0.4, 0.0, 0.5]
    points = np.asarray(hand.subdivide().subdivide().vertices)
    rng = np.random.default_rng(1)
    for _ in range(8):
        turned = points @ random_rotation(rng)[:3, :3].T * 1.2 + 3.0
        assert have_like_shapes(points, turned)
        assert not have_like_shapes(points, turned * [1.0, 1.0, -1.0])


def test_parts_that_stand_are_scattered_although_they_are_turned_alike() -> None:
    meshes = {"plate": plate(), "stone": box(0.24, STONE_HEIGHT, 0.12)}
    alike = [("stone", placed(*place[:2], 0.0)) for place in PLACES]
    _, layout = models.layout(meshes, [("plate", np.eye(4)), *alike])
    assert only_scattered(layout).parts == (1, 2, 3, 4)


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
        rescattered(layout, Scattering((1, 2, 3, 4, 5), UP_AXIS, (), (TurnedCopy(5, 90),)))


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
    change = Scattering((1, 2, 3, 4), UP_AXIS, (2,), (TurnedCopy(1, 120), TurnedCopy(3, 30)))
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
        Scattering((1, 2, 3), UP_AXIS, (), (TurnedCopy(4, 30),)),
        Scattering((1, 2, 3, 4), UP_AXIS, (), (TurnedCopy(1, 120), TurnedCopy(1, 120))),
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
