"""Rows become longer and shorter, every contact stays, and what occurs once stays once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from stages.rows.changes import change_json, read_change
from stages.rows.changes import changed as changed_by
from stages.rows.draws import LayoutDraws
from stages.rows.kit_rows import rows_of_kit
from stages.rows.layout import Layout, LengthenedMesh
from stages.rows.rows import Row, find_rows
from stages.rows.settings import RowsConfig
from stages.rows.slabs import RowChange, SlabError, repeat
from stages.rows.steps import bays_of, steps_of
from stages.rows.turns import find_circles, turned
from stages.shape.appearance import Appearance
from stages.shape.kit import Kit, PartMesh
from tests.stages.rows import models
from tests.stages.rows.soundness import assert_contacts_hold
from tests.toy_kits.chains_and_rings import box, pose

MODELS: dict[str, Callable[[], tuple[Kit, Layout]]] = {
    "shelf": models.shelf,
    "rail": models.rail,
    "leaning frame": models.leaning_frame,
    "wall": models.wall,
    "truss": models.truss,
    "stair": models.stair,
    "mirrored row": models.mirrored_row,
    "framed windows": models.framed_windows,
}


def counts(kit: Kit, layout: Layout) -> Counter[str]:
    return Counter(kit.types[kind].label for kind in layout.types.tolist())


def changes(rows: list[Row], times: int) -> Iterator[RowChange]:
    for row in rows:
        places = row.insertions if times > 0 else row.removals
        for index in range(len(places)):
            yield row.insertion(index, times) if times > 0 else row.removal(index)


def facts(row: Row) -> list[object]:
    return [value.tolist() if isinstance(value, np.ndarray) else value for value in vars(row).values()]


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("times", [1, 3, -1])
def test_every_change_keeps_contacts_and_adds_none(name: str, times: int) -> None:
    kit, layout = MODELS[name]()
    tried = list(changes(find_rows(layout), times))
    assert tried, f"the {name} has rows"
    for change in tried[:: 1 + len(tried) // 12]:
        assert_contacts_hold(kit, repeat(layout, change))


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("may_stretch", [False, True])
def test_rules_asked_of_all_planes_at_once_leave_out_no_row(
    name: str, may_stretch: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same rows are found where every plane is asked by its slab alone."""
    _, layout = MODELS[name]()
    found = find_rows(layout, may_stretch=may_stretch)
    monkeypatch.setattr("stages.rows.rows._may_end_slabs", lambda _, planes, *__: np.ones(len(planes), dtype=bool))
    assert [facts(row) for row in found] == [facts(row) for row in find_rows(layout, may_stretch=may_stretch)]


@pytest.mark.parametrize("name", MODELS)
def test_removing_what_was_inserted_gives_the_exemplar_back(name: str) -> None:
    _, layout = MODELS[name]()
    for change in list(changes(find_rows(layout), 1))[::5]:
        longer = repeat(layout, change)
        end = change.at + float(change.normal @ change.shift)
        same = repeat(longer, RowChange(change.normal, change.shift, end, -1))
        assert same.key == layout.key
        np.testing.assert_array_equal(same.edges, layout.edges)
        np.testing.assert_allclose(same.boxes, layout.boxes, atol=1e-6)


def test_a_shelf_gets_boards_and_longer_sides() -> None:
    kit, layout = models.shelf()
    (first, *_) = find_rows(layout)
    assert first.count == models.SHELF_BOARDS
    np.testing.assert_allclose(first.shift, [0.0, models.BOARD_STEP, 0.0])
    longer = repeat(layout, first.insertion(2, 3))
    assert counts(kit, longer) == {"side": 2, "board": 8}
    np.testing.assert_allclose(longer.extent, layout.extent + np.array([0.0, 3 * models.BOARD_STEP, 0.0]))
    assert all(mesh.label == "side" for mesh in longer.meshes[:2])


def test_a_row_can_be_shortened_to_one() -> None:
    kit, layout = models.shelf(3)
    for _ in range(2):
        layout = repeat(layout, next(changes(find_rows(layout), -1)))
    assert counts(kit, layout) == {"side": 2, "board": 1}
    assert_contacts_hold(kit, layout)
    assert not find_rows(layout)


def test_what_occurs_once_stays_once() -> None:
    kit, layout = models.shelf(crates=(2,))
    tried = [*changes(find_rows(layout), 1), *changes(find_rows(layout), -1)]
    assert tried
    for change in tried:
        changed = repeat(layout, change)
        assert counts(kit, changed)["crate"] == 1
        assert_contacts_hold(kit, changed)


def test_copies_do_not_lack_what_all_parts_of_a_row_have() -> None:
    """Each board carries something, and only two of the things are alike."""
    kit, layout = models.shelf(4, crates=(0, 1), cans=(2, 3))
    for change in changes(find_rows(layout), 1):
        changed = repeat(layout, change)
        held = counts(kit, changed)
        assert held["crate"] + held["can"] == held["board"] == 5


def test_alternating_parts_stay_alternating() -> None:
    kit, layout = models.rail()
    for times in (1, -1):
        for change in changes(find_rows(layout), times):
            changed = repeat(layout, change)
            feet = [part for part in range(len(changed)) if kit.types[changed.types[part]].label != "bar"]
            order = sorted(feet, key=lambda part: changed.anchors[part, 0])
            names = [kit.types[changed.types[part]].label for part in order]
            assert all(one != other for one, other in pairwise(names)), names


def test_a_grid_grows_in_both_directions() -> None:
    kit, layout = models.wall()
    rows = find_rows(layout)
    assert {tuple(np.flatnonzero(row.shift).tolist()) for row in rows} == {(0,), (1,)}
    wide = next(row for row in rows if row.shift[0] > 0 and row.count == 3)
    wider = repeat(layout, wide.insertion(0, 1))
    tall = next(row for row in find_rows(wider) if row.shift[1] > 0 and row.count == 3)
    both = repeat(wider, tall.insertion(0, 1))
    assert counts(kit, both) == {"wall": 1, "window": 16}
    assert_contacts_hold(kit, both)


def test_a_slanted_row_moves_along_its_slope() -> None:
    for build in (models.leaning_frame, models.stair):
        _, layout = build()
        row = next(row for row in find_rows(layout) if len(row.insertions) and row.count == 6)
        assert np.count_nonzero(np.abs(row.shift) > 1e-6) == 2
        longer = repeat(layout, row.insertion(0, 2))
        np.testing.assert_allclose(longer.extent - layout.extent, 2 * np.abs(row.shift), atol=1e-6)


def test_a_periodic_chord_keeps_its_knots() -> None:
    kit, layout = models.truss()
    row = next(row for row in find_rows(layout) if row.count == 6)
    longer = repeat(layout, row.insertion(0, 2))
    chord, before = longer.points[0], layout.points[0]
    assert len(np.unique(np.round(chord[np.abs(chord[:, 1]) > 0.049, 0] - 0.05))) == 8
    assert np.ptp(chord[:, 0]) == pytest.approx(np.ptp(before[:, 0]) + 2.0)
    assert_contacts_hold(kit, longer)


def test_a_slab_that_does_not_fit_says_why() -> None:
    _, layout = models.shelf(crates=(2,))
    up = np.array([0.0, 1.0, 0.0])
    with pytest.raises(SlabError, match="occurs once is in the slab"):
        repeat(layout, RowChange(up, up * models.BOARD_STEP, 1.3, -1))
    with pytest.raises(SlabError, match="nothing recurs"):
        repeat(layout, RowChange(up, up * 0.3, 1.2, 1))


def test_draws_depend_on_the_seed_alone_and_stay_in_range() -> None:
    kit, layout = models.wall()
    keys = []
    for draws in (LayoutDraws(layout, RowsConfig()), LayoutDraws(layout, RowsConfig())):
        drawn = [draws.draw(np.random.default_rng(seed)) for seed in range(10)]
        keys.append([result and result[1].key for result in drawn])
    assert keys[0] == keys[1]
    made = [result for result in drawn if result]
    assert len(made) > 6
    for result in made:
        assert_contacts_hold(kit, result[1])
        assert 1 <= counts(kit, result[1])["window"] <= 36


def test_every_draw_of_every_model_passes_the_check() -> None:
    for build in (*MODELS.values(), models.round_temple):
        kit, layout = build()
        draws = LayoutDraws(layout, RowsConfig())
        drawn = [result for seed in range(4) if (result := draws.draw(np.random.default_rng(seed)))]
        assert drawn
        for made, changed in drawn:
            assert_contacts_hold(kit, changed)
            again = layout
            for change in made:
                again = changed_by(again, change)
            assert again.key == changed.key


def test_a_pair_inside_a_period_is_no_row() -> None:
    kit, layout = models.framed_windows()
    rows = find_rows(layout)
    assert all(
        Counter(kit.types[kind].label for kind in row.copied) == {"pane": 1, "side": 2}
        for row in rows
        if row.count == 3
    )
    assert not any(np.isclose(np.linalg.norm(row.shift), 1.0) for row in rows)


@pytest.mark.parametrize("count", [3, 4, 5, 12])
def test_columns_about_an_axis_change_their_number(count: int) -> None:
    kit, layout = models.round_temple()
    (circle,) = find_circles(layout)
    assert (circle.axis, circle.sectors, len(circle.orbits)) == (1, 8, 2)
    other = turned(layout, circle.turn(count))
    assert counts(kit, other) == {"plate": 2, "base": count, "column": count}
    assert_contacts_hold(kit, other)
    (again,) = find_circles(other)
    back = turned(other, again.turn(8))
    assert back.key == layout.key
    assert read_change(change_json(circle.turn(count))).count == count  # type: ignore[union-attr]


def test_groups_of_parts_about_an_axis_change_their_number() -> None:
    kit, layout = models.fan()
    (circle,) = find_circles(layout)
    assert (circle.axis, circle.sectors, len(circle.orbits)) == (1, 3, 3)
    other = turned(layout, circle.turn(5))
    assert counts(kit, other) == {"plate": 1, "blade": 5, "screw": 10}
    assert_contacts_hold(kit, other)
    (again,) = find_circles(other)
    assert turned(other, again.turn(3)).key == layout.key


def test_like_parts_about_an_axis_go_with_what_they_hang_on() -> None:
    kit, layout = models.chandelier()
    (circle,) = find_circles(layout)
    assert (circle.axis, circle.sectors, len(circle.orbits)) == (1, 5, 3)
    labels = [[kit.types[layout.types[part]].label for part in orbit] for orbit in circle.orbits.tolist()]
    shades = next(orbit for orbit in labels if orbit[0].startswith("shade"))
    assert sorted(shades) == [f"shade{number}" for number in range(5)]
    for count in (3, 8):
        other = turned(layout, circle.turn(count))
        assert counts(kit, other) == {"plate": 1, "arm": count, "socket": count, shades[0]: count}
        assert_contacts_hold(kit, other)


@pytest.mark.parametrize(
    ("widths", "aside", "is_found"),
    [
        ((0.2, 0.21, 0.19), 0.05, True),
        ((0.2, 0.21, 0.4), 0.0, False),
        ((0.2, 0.21, 0.1), 0.0, False),
        ((0.2, 0.21, 0.19), 0.12, False),
    ],
)
def test_unlike_parts_about_an_axis_bar_the_circle(widths: tuple[float, ...], aside: float, is_found: bool) -> None:
    _, layout = models.chandelier(widths, aside)
    assert bool(find_circles(layout)) == is_found


def test_rows_are_described() -> None:
    kit, layout = models.shelf()
    assert rows_of_kit(kit)[0].sentence == "5 times board, along y"
    assert [step.count for step in steps_of(layout)] == [5]


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("times", [2, -1])
def test_lengthened_parts_have_the_look_of_their_faces(name: str, times: int) -> None:
    """A face that is kept has its texture coordinates; one that is cut has some between them."""
    _, layout = MODELS[name]()
    meshes = {mesh: replace(mesh, appearance=planar_look(mesh)) for mesh in layout.meshes}
    textured = replace(layout, meshes=tuple(meshes[mesh] for mesh in layout.meshes))
    for change in list(changes(find_rows(layout), times))[:3]:
        for mesh in repeat(textured, change).meshes:
            look = mesh.appearance
            assert look is not None
            assert look.uv is not None
            assert len(look) == len(mesh.faces)
            if isinstance(mesh, LengthenedMesh):
                source = meshes[next(own for own in meshes if own.name == mesh.name)].appearance
                assert source.uv.min() <= look.uv.min()
                assert look.uv.max() <= source.uv.max()


def planar_look(mesh: PartMesh) -> Appearance:
    uv = mesh.vertices[mesh.faces][:, :, :2].astype(np.float32)
    return Appearance((), np.full(len(mesh.faces), -1, np.int32), uv)


@pytest.mark.parametrize(("ratio", "pegs"), [(0.9, 6), (2.0, 3)])
def test_no_change_tears_another_row_apart(ratio: float, pegs: int) -> None:
    """Boards and pegs on the same sides change together, or one of them at its end alone."""
    kit, layout = models.two_pitches(ratio, pegs)
    draws = LayoutDraws(layout, RowsConfig())
    assert draws.rows
    assert draws.refused["a row with another step would be torn apart"] > 0
    for change in [*changes(find_rows(layout), 1), *changes(find_rows(layout), -1)]:
        changed = repeat(layout, change)
        assert_contacts_hold(kit, changed)
        for label in ("board", "peg"):
            places = [changed.anchors[part, 1] for part in range(len(changed))
                      if kit.types[changed.types[part]].label == label]  # fmt: skip
            steps = np.diff(np.sort(places))
            np.testing.assert_allclose(steps, steps[:1].repeat(len(steps)), atol=1e-6)


@pytest.mark.parametrize("times", [2, -1])
def test_rail_with_a_flat_underside_is_stretched_over_its_bars(times: int) -> None:
    kit, layout = models.arched_rail()
    assert not find_rows(layout), "it is no prism, and repeats nothing"
    tried = list(changes(find_rows(layout, may_stretch=True), times))
    assert tried
    for change in tried:
        changed = repeat(layout, change)
        assert_contacts_hold(kit, changed)
        assert counts(kit, changed)["bar"] == 6 + times
        np.testing.assert_allclose(changed.boxes[1] - layout.boxes[1], [[0, 0, 0], [0.5 * times, 0, 0]], atol=1e-9)
        heights = [np.unique(np.round(kind.points[1][:, 1], 9)) for kind in (layout, changed)]
        np.testing.assert_array_equal(*heights)
    with pytest.raises(SlabError, match="too short to stretch"):
        repeat(layout, replace(tried[0], times=4))


def test_rail_is_not_stretched_for_two_bars() -> None:
    _, layout = models.arched_rail(bars=2)
    assert not find_rows(layout, may_stretch=True)


def test_wall_is_not_stretched_if_its_pegs_would_hang_over_notches() -> None:
    _, layout = models.battlement()
    assert not find_rows(layout, may_stretch=True)
    with pytest.raises(SlabError, match="apart from what it has to touch"):
        repeat(layout, RowChange(np.array([1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]), 1.3, 1))


def test_no_period_leaves_a_bar_out_where_the_rail_is_stretched() -> None:
    """One more bar between two others occurs once: a copy of its period would lack it."""
    place = 0.45
    _, layout = models.arched_rail(more=(place,))
    rows = find_rows(layout, may_stretch=True)
    assert rows
    for change in changes(rows, 1):
        assert not change.at - 0.5 <= place < change.at


def test_no_front_gets_a_second_handle() -> None:
    kit, layout = models.fronts()
    tried = [*changes(find_rows(layout), 2), *changes(find_rows(layout), -1)]
    assert tried
    for change in tried:
        changed = repeat(layout, change)
        held = counts(kit, changed)
        assert held["handle"] == held["tall"] + held["front"]
        assert_contacts_hold(kit, changed)


@pytest.mark.parametrize("stands_out", [0.0, 0.02])
def test_a_bay_is_inserted_with_what_occurs_once_in_it(stands_out: float) -> None:
    kit, layout = models.cabinet(stands_out)
    assert not find_rows(layout), "two sides alone are no row"
    (bay,) = find_rows(layout, bays_of(layout))
    np.testing.assert_allclose(bay.shift, [0.95, 0.0, 0.0])
    longer = repeat(layout, bay.insertion(0, 2))
    assert counts(kit, longer) == {"side": 4, "top": 1, "shelf": 3, "door": 3}
    np.testing.assert_allclose(longer.extent, layout.extent + np.array([2 * 0.95, 0.0, 0.0]))
    assert_contacts_hold(kit, longer)


def test_a_bay_is_removed_while_every_type_stays() -> None:
    _, layout = models.cabinet()
    steps = bays_of(layout)
    (bay,) = find_rows(layout, steps)
    assert not len(bay.removals), "the two ends of a shape stay"
    longer = repeat(layout, bay.insertion(0, 1))
    removals = list(changes(find_rows(longer, steps), -1))
    assert removals
    for change in removals:
        assert repeat(longer, change).key == layout.key
    with pytest.raises(SlabError, match="last part of a type"):
        repeat(layout, RowChange(bay.normal, bay.shift, float(bay.insertions[0]), -1, is_bay=True))


def test_draws_have_bays_where_they_are_asked_for_and_json_keeps_them() -> None:
    kit, layout = models.cabinet()
    assert not LayoutDraws(layout, RowsConfig()).rows
    draws = LayoutDraws(layout, RowsConfig(), is_alone=True)
    drawn = [draws.draw(np.random.default_rng(seed)) for seed in range(20)]
    found = [result for result in drawn if result is not None]
    assert {counts(kit, longer)["side"] for _, longer in found} == {3, 4}
    made, longer = found[0]
    for change in made:
        layout = changed_by(layout, read_change(change_json(change)))
    assert layout.key == longer.key
    assert [row.sentence for row in rows_of_kit(kit)] == ["bays between side, along x"]


def test_a_part_gets_no_longer_where_its_other_row_would_leave_a_gap() -> None:
    _, layout = models.frame_with_knobs((0.1, 1.0, 1.9, 2.85))
    heights = [float(row.shift[1]) for row in find_rows(layout) if len(row.insertions)]
    assert heights == pytest.approx([0.5] * len(heights)), "more knobs alone would need longer posts without bars"


def test_a_table_becomes_no_longer_beyond_its_legs() -> None:
    kit, layout = models.table_of_boxes()
    (boxes,) = (row for row in find_rows(layout) if row.shift[0] == pytest.approx(1.0))
    assert max(boxes.insertions) > 0.9, "more boxes alone would stand on a top that reaches beyond the legs"
    found = find_rows(layout, [*steps_of(layout), *bays_of(layout)])
    for row in found:
        for change in changes([row], 1):
            longer = repeat(layout, change)
            legs = longer.boxes[[kit.types[kind].label == "leg" for kind in longer.types.tolist()]]
            np.testing.assert_allclose(
                legs[:, 1].max(axis=0)[[0, 2]] - longer.boxes[:, 1].max(axis=0)[[0, 2]],
                layout.boxes[:4, 1].max(axis=0)[[0, 2]] - layout.boxes[:, 1].max(axis=0)[[0, 2]],
            )
    assert any(row.is_bay for row in found)


def test_rows_too_small_to_be_seen_make_no_layouts_of_their_own() -> None:
    walls = [("wall", pose(-0.6, 1.5, 0.0)), ("thin wall", pose(0.6, 1.5, 0.0))]
    bars = [("bar", pose(0.0, 0.25 + 0.5 * number, 0.0)) for number in range(6)]
    meshes = {"wall": box(1.0, 3.0, 1.0), "thin wall": box(1.0, 3.0, 0.9), "bar": box(0.2, 0.01, 0.01)}
    kit, layout = models.layout(meshes, [*walls, *bars])
    assert LayoutDraws(layout, RowsConfig()).rows
    alone = LayoutDraws(layout, RowsConfig(), is_alone=True)
    assert not alone.rows
    assert alone.refused["its parts are too small to be seen"] > 0
    assert not rows_of_kit(kit)
