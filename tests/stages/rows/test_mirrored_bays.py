"""Bays between mirrored ends: they are inserted whole, every contact stays, and what would not fit is refused."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from stages.api import read_kit
from stages.proportions.text import ProportionError, Proportions, ProportionShapes, proportion_text, read_proportions
from stages.rows.changes import change_json, changed, read_change
from stages.rows.draws import LayoutDraws
from stages.rows.kit_rows import rows_of_kit
from stages.rows.layout import Layout, layout_of
from stages.rows.mirrored_bays import find_mirrored_bays, with_mirrored_bays
from stages.rows.rows import BARE_PLACE, find_rows
from stages.rows.settings import RowsConfig
from stages.rows.slabs import RowChange, SlabError
from stages.shape.kit import Kit
from tests.stages.rows import models
from tests.stages.rows.soundness import assert_sound
from tests.toy_kits.chains_and_rings import ROAD, box, kit_of, pose, ring

ROOT = Path(__file__).resolve().parents[3]
UP_AXIS = 1
MODELS: dict[str, Callable[[], tuple[Kit, Layout]]] = {"table": models.table_on_frames, "casement": models.casement}


def shipped_kit(name: str) -> Kit:
    """Return a kit of configs/rows.yaml; nothing is left to choose."""
    return read_kit(
        ROOT / f"datasets/exemplars/rows/{name}.glb",
        up="y",
        contact={"tolerance": 0.001, "kinds": ["point", "line", "face"]},
        grammar="multiset",
        hubs={"types": "none"},
        disconnected="error",
    )


def counts(kit: Kit, layout: Layout) -> Counter[str]:
    return Counter(kit.types[kind].label for kind in layout.types.tolist())


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("times", [1, 2, 4])
def test_every_contact_is_one_of_the_meshes_and_every_part_is_held(name: str, times: int) -> None:
    kit, layout = MODELS[name]()
    (bay,) = find_mirrored_bays(layout, UP_AXIS)
    longer = with_mirrored_bays(layout, bay.insertion(times))
    assert_sound(kit, longer)
    np.testing.assert_allclose(longer.extent[0], layout.extent[0] + times * (bay.end - bay.start))


def test_a_table_gets_middle_frames_and_a_longer_top() -> None:
    kit, layout = models.table_on_frames()
    (bay,) = find_mirrored_bays(layout, UP_AXIS)
    longer = with_mirrored_bays(layout, bay.insertion(2))
    assert counts(kit, longer) == {"top": 1, "frame": 4, "bar": 3}
    frames = np.array([kit.types[kind].label == "frame" for kind in longer.types.tolist()])
    lows = np.sort(longer.boxes[frames, 0, 0])
    np.testing.assert_allclose(np.diff(lows), bay.end - bay.start)


def test_leaves_that_meet_in_the_middle_are_inserted_as_a_pair() -> None:
    kit, layout = models.casement()
    (bay,) = find_mirrored_bays(layout, UP_AXIS)
    assert bay.end - bay.start == pytest.approx(1.8)
    longer = with_mirrored_bays(layout, bay.insertion(1))
    assert counts(kit, longer) == {"rail": 2, "leaf": 4, "hinge": 2, "other_hinge": 2}
    hinges = np.array([kit.types[kind].label.endswith("hinge") for kind in longer.types.tolist()])
    order = np.argsort(longer.boxes[hinges, 0, 0])
    names = [kit.types[kind].label for kind in longer.types[hinges][order].tolist()]
    assert names == ["hinge", "other_hinge", "hinge", "other_hinge"]


def test_ends_that_are_translates_are_left_to_other_bays() -> None:
    _, layout = models.cabinet()
    assert not find_mirrored_bays(layout, UP_AXIS)


def test_a_top_that_is_no_prism_allows_no_bay() -> None:
    _, layout = models.table_on_frames(step=0.2)
    assert not find_mirrored_bays(layout, UP_AXIS)


def test_nothing_is_doubled_across_its_shorter_side_or_upwards() -> None:
    sides = {"low": models.slanted(0.1, 1.0, 1.0, -0.1), "body": box(0.8, 1.0, 3.0)}
    placed = [("low", pose(-0.45, 0.5, 0.0)), ("body", pose(0.0, 0.5, 0.0)), ("high", pose(0.45, 0.5, 0.0))]
    _, wide = models.layout(sides | {"high": models.mirrored(sides["low"])}, placed)
    assert not find_mirrored_bays(wide, UP_AXIS), "it would stand twice side by side"
    _, layout = models.table_on_frames()
    assert not find_mirrored_bays(layout, 0)


def test_a_closed_road_gets_no_road_across() -> None:
    kit = kit_of(ROAD, [ring(3, 2)])
    assert not find_mirrored_bays(layout_of(kit, kit.exemplars[0]), UP_AXIS)


def test_a_bay_that_would_leave_a_part_without_hold_is_refused() -> None:
    kit, layout = models.table_on_frames()
    (bay,) = find_mirrored_bays(layout, UP_AXIS)
    loose = kit.types[layout.types[0]].label
    kept = [edge for edge in layout.edges.tolist() if 0 not in edge]
    assert loose == "frame"
    with pytest.raises(SlabError, match="held by nothing"):
        with_mirrored_bays(replace(layout, edges=np.array(kept, dtype=np.int32)), bay.insertion(1))


def test_draws_are_deterministic_and_within_the_settings_and_json_keeps_them() -> None:
    kit, layout = models.table_on_frames()
    draws = LayoutDraws(layout, RowsConfig(max_count=3.0), is_alone=True, up=UP_AXIS)
    drawn = [draws.draw(np.random.default_rng(seed)) for seed in range(30)]
    again = [LayoutDraws(layout, RowsConfig(max_count=3.0), is_alone=True, up=UP_AXIS).draw(np.random.default_rng(seed))
             for seed in range(3)]  # fmt: skip
    found = [result for result in drawn if result is not None]
    assert [made and made[1].key for made in drawn[:3]] == [made and made[1].key for made in again]
    assert {counts(kit, longer)["frame"] for _, longer in found} <= {3, 4, 5, 6}
    assert len({longer.key for _, longer in found}) > 1
    made, longer = found[0]
    read = layout
    for change in made:
        read = changed(read, read_change(change_json(change)))
    assert read.key == longer.key
    assert not LayoutDraws(layout, RowsConfig()).mirrored_bays


def test_rows_along_inserted_bays_stay_as_they_are() -> None:
    """A row of windows that became longer in one house of a terrace left a blank wall in another."""
    kit = shipped_kit("dresser")
    draws = LayoutDraws(layout_of(kit, kit.exemplars[0]), RowsConfig(), is_alone=True, up=UP_AXIS)
    assert len(draws.mirrored_bays) == 1
    drawn = [draws.draw(np.random.default_rng(seed)) for seed in range(40)]
    made = [[change for change in result[0] if isinstance(change, RowChange)] for result in drawn if result]
    longer = [changes for changes in made if changes[0].is_mirrored]
    assert any(len(changes) > 1 for changes in longer), "rows across the bays change"
    assert all(not change.shift @ changes[0].normal for changes in longer for change in changes[1:])


def test_every_storey_above_the_first_keeps_all_its_windows() -> None:
    """Three storeys without one show no more that a window belongs over the door, which a fourth would then lack."""
    kit = shipped_kit("house")
    draws = LayoutDraws(layout_of(kit, kit.exemplars[0]), RowsConfig(), is_alone=True, up=UP_AXIS)
    drawn = [draws.draw(np.random.default_rng(seed)) for seed in range(30)]
    made = [layout for _, layout in filter(None, drawn)]
    assert len({layout.key for layout in made}) > 15
    for layout in made:
        windows = np.array([kit.types[kind].label == "window" for kind in layout.types.tolist()])
        storeys = Counter(layout.boxes[windows, 0, 1].round(1).tolist())
        first, *others = (storeys[height] for height in sorted(storeys))
        assert len(set(others)) <= 1
        assert all(count > first for count in others)


def test_no_wall_gets_a_blank_stretch_beside_its_door() -> None:
    """A period at the door has windows above only; elsewhere the same wall has one on the ground floor, too.

    Two columns at once, over twice the step, would lack one, too.
    """
    kit = shipped_kit("house")
    refused = Counter[str]()
    rows = find_rows(layout_of(kit, kit.exemplars[0]), refuse=lambda reason: refused.update([reason]))
    windows = [sum(kit.types[kind].label == "window" for kind in row.copied) for row in rows if row.shift[0] > 0]
    assert windows == [3]
    assert refused[BARE_PLACE]


def test_a_text_says_the_bays_and_a_wrong_one_is_refused() -> None:
    kit, layout = models.table_on_frames()
    (bay,) = find_mirrored_bays(layout, UP_AXIS)
    shapes = ProportionShapes(kit)
    name = kit.exemplars[0].name
    unwarped = shapes.unwarped(name, (bay.insertion(1),))
    factors = tuple(np.ones(len(knots) - 1) for knots in unwarped.lattice.knots)
    text = proportion_text(Proportions(name, (factors[0], factors[1], factors[2]), (bay.insertion(1),)))
    assert '"is_mirrored": true' in text
    read = read_proportions(text)
    assert shapes.unwarped(name, read.changes).assembly.edges.tolist() == unwarped.assembly.edges.tolist()
    wrong = replace(bay.insertion(1), at=bay.end - 0.3)
    with pytest.raises(ProportionError, match="no mirrored ends"):
        shapes.unwarped(name, (wrong,))
    with pytest.raises(ProportionError, match="not valid"):
        shapes.unwarped(name, (replace(bay.insertion(1), times=-1),))


def test_inspect_says_what_is_between_mirrored_ends() -> None:
    kit, _ = models.table_on_frames()
    assert [row.sentence for row in rows_of_kit(kit)] == ["bays between mirrored frame, along x"]
