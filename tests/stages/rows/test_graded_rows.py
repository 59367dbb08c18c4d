"""Graded rows: other numbers of like parts fill the same place, are held as the old ones were, and keep the curve."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import trimesh

from stages.proportions.text import ProportionError, ProportionShapes
from stages.proportions.warp_check import warp_fault
from stages.rows.changes import change_json, changed, read_change
from stages.rows.draws import LayoutDraws
from stages.rows.graded_rows import GradedRow, Respacing, find_graded_rows, renumbered, respaced, respacing
from stages.rows.kit_rows import rows_of_kit
from stages.rows.layout import Layout
from stages.rows.rows import find_rows
from stages.rows.settings import RowsConfig
from stages.rows.slabs import SlabError
from stages.shape.kit import Kit
from tests.stages.rows import models
from tests.stages.rows.soundness import assert_sound
from tests.toy_kits.chains_and_rings import box, pose

UP_AXIS = 1
BAR_COUNT, BAR_WIDTH, BAR_STEP = 7, 0.06, 0.225
ARCH_HEIGHT = 0.4


def arch(x: np.ndarray) -> np.ndarray:
    """Return the height of the lower edge of the arched rail."""
    return 1.0 + ARCH_HEIGHT * (1.0 - (x / 0.9) ** 2)


@cache
def headboard(bars: int = BAR_COUNT) -> tuple[Kit, Layout]:
    """Bars between two posts, on a straight rail and under an arched one."""
    xs = np.linspace(-0.9, 0.9, 61)
    columns = trimesh.util.concatenate(
        [
            box(xs[i + 1] - xs[i], 0.1, 0.08).apply_translation(
                [(xs[i] + xs[i + 1]) / 2, float(arch((xs[i] + xs[i + 1]) / 2)) + 0.05, 0.0]
            )
            for i in range(60)
        ]
    )
    columns.merge_vertices()
    meshes = {"arch": columns, "rail": box(1.8, 0.1, 0.08), "post": box(0.1, 1.6, 0.1)}
    parts = [("arch", pose(0.0, 0.0, 0.0)), ("rail", pose(0.0, 0.25, 0.0))]
    parts += [("post", pose(x, 0.8, 0.0)) for x in (-0.95, 0.95)]
    places = (np.arange(bars) - (bars - 1) / 2) * BAR_STEP
    for number, x in enumerate(places.tolist()):
        top = float(arch(np.array(abs(x)))) + 0.02
        meshes[f"bar{number}"] = box(BAR_WIDTH, top - 0.3, 0.04)
        parts.append((f"bar{number}", pose(x, (top + 0.3) / 2, 0.0)))
    return models.layout(meshes, parts)


@cache
def sofa(seats: int = 3, unlike: float = 1.03, gap: float = 0.0) -> tuple[Kit, Layout]:
    """A seat between two arms, with cushions on it of nearly one size.

    unlike: how much wider each second cushion is
    gap: distance between two of them
    """
    widths = np.where(np.arange(seats) % 2 == 0, 0.6, 0.6 * unlike)
    ends = np.cumsum(widths + gap)
    meshes = {"base": box(ends[-1] - gap, 0.3, 0.8), "arm": box(0.2, 0.6, 0.8)}
    parts = [("base", pose((ends[-1] - gap) / 2, 0.15, 0.0))]
    parts += [("arm", pose(x, 0.3, 0.0)) for x in (-0.1, ends[-1] - gap + 0.1)]
    for number, (width, end) in enumerate(zip(widths.tolist(), ends.tolist(), strict=True)):
        meshes[f"cushion{number}"] = box(width, 0.15, 0.8)
        parts.append((f"cushion{number}", pose(end - gap - width / 2, 0.375, 0.0)))
    return models.layout(meshes, parts)


def free(layout: Layout) -> np.ndarray:
    return np.zeros(len(layout), dtype=bool)


def only_row(layout: Layout) -> GradedRow:
    ((row,),) = find_graded_rows(layout, free(layout))
    return row


def made_parts(layout: Layout, count: int) -> tuple[Layout, np.ndarray]:
    """Return a layout with another number of parts in its row, and the boxes of these parts."""
    made = respaced(layout, respacing([only_row(layout)], count))
    return made, made.boxes[-count:]


def test_bars_under_an_arch_are_a_graded_row_and_no_other_row() -> None:
    _, layout = headboard()
    assert not find_rows(layout)
    row = only_row(layout)
    assert row.parts == tuple(range(4, 4 + BAR_COUNT))
    assert row.holders.tolist() == [0, 1]
    assert not row.fills


@pytest.mark.parametrize("count", [3, 4, 5, 6, 8, 10, 14])
def test_bars_reach_from_the_rail_into_the_arch_at_equal_gaps(count: int) -> None:
    kit, layout = headboard()
    made, bars = made_parts(layout, count)
    middles = bars[:, :, 0].mean(axis=1)
    np.testing.assert_allclose(np.diff(middles), np.diff(middles)[0])
    np.testing.assert_allclose(bars[:, 1, 0] - bars[:, 0, 0], BAR_WIDTH, atol=1e-9)
    np.testing.assert_allclose(bars[:, 0, 1], 0.3, atol=1e-9)
    np.testing.assert_allclose(bars[:, 1, 1], arch(middles) + 0.02, atol=2e-3)
    assert_sound(kit, made)


def test_posts_that_stand_where_the_next_bar_would_bound_the_row() -> None:
    _, layout = headboard()
    _, bars = made_parts(layout, 4)
    gaps = [bars[0, 0, 0] + 0.9, *(bars[1:, 0, 0] - bars[:-1, 1, 0]), 0.9 - bars[-1, 1, 0]]
    assert max(gaps) < 1.3 * min(gaps), "no wide gap is left at the posts"


def test_bars_need_gaps() -> None:
    _, layout = headboard()
    with pytest.raises(SlabError, match="no room"):
        made_parts(layout, 40)
    with pytest.raises(SlabError, match="no room"):
        made_parts(layout, 1)


@pytest.mark.parametrize("count", [1, 2, 4, 5])
@pytest.mark.parametrize("seats", [2, 3])
def test_cushions_fill_the_seat(seats: int, count: int) -> None:
    if seats == count:
        return
    kit, layout = sofa(seats)
    made, cushions = made_parts(layout, count)
    base = layout.boxes[0]
    assert abs(cushions[:, 0, 0].min() - base[0, 0]) < 0.03
    assert abs(cushions[:, 1, 0].max() - base[1, 0]) < 0.03
    widths = cushions[:, 1, 0] - cushions[:, 0, 0]
    np.testing.assert_allclose(widths, seats * 0.6 / count, rtol=0.08)
    np.testing.assert_allclose(cushions[:, :, 1], [[0.3, 0.45]] * count, atol=1e-9)
    shape = made.shape(kit)
    assert warp_fault(kit, made.assembly(), shape) is None
    assert made.pieces().max() == 0


@pytest.mark.parametrize(
    ("seats", "unlike", "gap", "reason"),
    [
        (2, 1.2, 0.0, "two cushions of unlike size"),
        (2, 1.0, 0.3, "two cushions far from each other"),
        (4, 1.5, 0.0, "cushions of two sizes in turn"),
    ],
)
def test_what_is_no_graded_row(seats: int, unlike: float, gap: float, reason: str) -> None:
    _, layout = sofa(seats, unlike, gap)
    assert not find_graded_rows(layout, free(layout)), reason


def test_parts_that_other_changes_repeat_are_left_to_them() -> None:
    _, layout = headboard()
    repeated = free(layout)
    repeated[5] = True
    (row,), *others = find_graded_rows(layout, repeated)
    assert 5 not in row.parts
    assert not others


def test_a_bar_that_holds_something_alone_keeps_its_row() -> None:
    meshes = {"rail": box(2.0, 0.1, 0.1), "knob": box(0.02, 0.02, 0.02)}
    parts = [("rail", pose(0.0, 0.05, 0.0))]
    for number in range(4):
        height = 0.5 + 0.05 * number
        meshes[f"bar{number}"] = box(0.06, height, 0.04)
        parts.append((f"bar{number}", pose(0.3 * number - 0.45, 0.1 + height / 2, 0.0)))
    _, alone = models.layout(meshes, parts)
    assert find_graded_rows(alone, free(alone))
    _, holding = models.layout(meshes, [*parts, ("knob", pose(-0.15, 0.3, 0.03))])
    assert not find_graded_rows(holding, free(holding)), "the knob would be left in the air"


def test_rows_of_one_step_change_together() -> None:
    meshes = {"rail": box(2.0, 0.1, 0.1)}
    parts = [("rail", pose(0.0, 0.05, z)) for z in (0.0, 1.0)] + [("rail", pose(0.0, 0.05, 0.5))]
    meshes["beam"] = box(0.1, 0.1, 1.1)
    parts[-1] = ("beam", pose(0.95, 0.05, 0.5))
    for z in (0.0, 1.0):
        for number in range(4):
            height = 0.5 + 0.05 * number + 0.2 * z
            meshes[f"bar{number}{z:.0f}"] = box(0.06, height, 0.04)
            parts.append((f"bar{number}{z:.0f}", pose(0.3 * number - 0.45, 0.1 + height / 2, z)))
    _, layout = models.layout(meshes, parts)
    (peers,) = find_graded_rows(layout, free(layout))
    assert sorted(row.parts for row in peers) == [(3, 4, 5, 6), (7, 8, 9, 10)]
    assert len(respaced(layout, respacing(peers, 6))) == len(layout) + 4


def test_its_json_says_what_is_changed_and_makes_it_again() -> None:
    kit, layout = headboard()
    change = respacing([only_row(layout)], 5)
    stated = change_json(change)
    assert stated == {"graded_rows": [list(range(4, 4 + BAR_COUNT))], "count": 5}
    assert read_change(stated) == change
    assert changed(layout, read_change(stated)).key == respaced(layout, change).key
    shapes = ProportionShapes(kit)
    assert len(shapes.unwarped(kit.exemplars[0].name, (change,)).assembly) == len(layout) - 2


@pytest.mark.parametrize("parts", [(0, 1), (4, 6, 5), (4, 4, 5), (4, 5, 99), (4,)])
def test_what_is_no_row_is_refused(parts: tuple[int, ...]) -> None:
    kit, layout = headboard()
    with pytest.raises(SlabError):
        respaced(layout, Respacing((parts,), 5))
    with pytest.raises(ProportionError):
        ProportionShapes(kit).unwarped(kit.exemplars[0].name, (Respacing((parts,), 5),))


@pytest.mark.parametrize(
    "wrong", [{"graded_rows": []}, {"graded_rows": [[]]}, {"graded_rows": [[-1, 2]]}, {"count": 0}]
)
def test_impossible_numbers_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="a graded row has"):
        read_change({"graded_rows": [[4, 5, 6]], "count": 5} | wrong)


def test_numbers_of_parts_are_those_after_others_are_removed() -> None:
    assert renumbered((1, 4, 8), (7, 2, 3)) == (1, 2, 5)


def test_draws_change_graded_rows_and_can_be_made_again() -> None:
    kit, layout = headboard()
    draws = LayoutDraws(layout, RowsConfig(), is_alone=True, up=UP_AXIS)
    assert draws.can_change
    assert not LayoutDraws(layout, RowsConfig(), up=UP_AXIS).graded_rows, "a search exchanges parts instead"
    drawn = [one for seed in range(120) if (one := draws.draw(np.random.default_rng(seed))) is not None]
    counts = {change.count for changes, _ in drawn for change in changes if isinstance(change, Respacing)}
    assert counts == set(range(3, 2 * BAR_COUNT + 1)) - {BAR_COUNT}
    for changes, made in drawn[:12]:
        again = layout
        for change in changes:
            again = changed(again, read_change(change_json(change)))
        assert again.key == made.key
    assert f"{BAR_COUNT} times bar0, along x" in [row.sentence for row in rows_of_kit(kit)]
