"""Inferred dockings of parts that never met, and their slack."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stages.shape.geometry.contact import ContactTest
from stages.shape.geometry.docking import DockingTable
from stages.shape.geometry.pose import invert
from stages.shape.kit import Docking, Kit
from tests.toy_kits.chains_and_rings import pose
from tests.toy_kits.tables import ROUND, SHORT, SQUARE, THICK, THIN, table, table_kit


@pytest.fixture(scope="module")
def kit() -> Kit:
    return table_kit(table(THIN, SQUARE), table(THICK, ROUND))


def fits(kit: Kit) -> dict[tuple[str, str], Docking]:
    inferred = [docking for docking in kit.grammar.dockings if docking.slack]
    by_names = {(kit.types[part_type.a].name, kit.types[part_type.b].name): part_type for part_type in inferred}
    assert len(by_names) == len(inferred)
    return by_names


def test_every_leg_fits_under_every_corner_of_every_top(kit: Kit) -> None:
    # turned about their axes, and the tops about theirs, the four corners look alike: one fit for each pair
    inferred = fits(kit)
    assert set(inferred) == {("top", "leg"), ("top", "leg_2"), ("leg", "top_2"), ("top_2", "leg_2")}
    under_thin = inferred["top", "leg_2"].pose[:3, 3]
    assert np.abs(under_thin) == pytest.approx([0.8, 0.1 + 0.5, 0.8])
    over_square = inferred["leg", "top_2"].pose[:3, 3]
    assert np.abs(over_square) == pytest.approx([0.8, 0.15 + 0.5, 0.8])
    assert all(docking.count == 0 and docking.kind == "face" and docking.depth == 0 for docking in inferred.values())


def test_shorter_leg_hangs_from_the_top() -> None:
    kit = table_kit(table(THIN, SQUARE), table(THICK, SHORT))
    assert np.abs(fits(kit)["top", "leg_2"].pose[:3, 3]) == pytest.approx([0.8, 0.1 + 0.25, 0.8])


def test_slack_is_a_share_of_the_median_part_and_no_more_than_a_quarter_of_the_contact() -> None:
    tables = table(THIN, SQUARE), table(THICK, ROUND)
    small = table_kit(*tables, fit_tolerance=0.01)
    diagonals = [small.types[index].diagonal for exemplar in small.exemplars for index in exemplar.assembly.types]
    assert [docking.slack for docking in fits(small).values()] == pytest.approx([0.01 * np.median(diagonals)] * 4)
    large = fits(table_kit(*tables, fit_tolerance=0.2))
    assert large["top", "leg"].slack == pytest.approx(0.25 * np.hypot(0.2, 0.2), rel=0.05)


def test_labels_of_one_surface_or_without_contact_infer_nothing() -> None:
    assert not fits(table_kit(table(THIN, SQUARE), table(THIN, SQUARE, reach=0.7)))
    kit = table_kit(table(THIN, SQUARE), table(THICK, ROUND))
    assert not any(kit.types[part_type.a].label == kit.types[part_type.b].label for part_type in fits(kit).values())


def test_parts_touch_at_inferred_dockings(kit: Kit) -> None:
    contact = ContactTest(kit.types, kit.contact_tolerance)
    for docking in fits(kit).values():
        assert contact.touches(docking.a, docking.b, docking.pose)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 3), st.floats(0, 2), st.tuples(*[st.floats(-1, 1)] * 3), st.booleans())
def test_inferred_docking_holds_within_its_slack_at_every_image_and_from_both_sides(
    quarter_turns: int, share: float, direction: tuple[float, float, float], is_back: bool
) -> None:
    kit = table_kit_of_both()
    fit = fits(kit)["top", "leg_2"]
    table = DockingTable.of(kit)
    index = kit.grammar.dockings.index(fit)
    way = np.array(direction) / max(np.linalg.norm(direction), 1e-9)
    moved = pose(0, 0, 0, quarter_turns) @ fit.pose
    moved[:3, 3] += way * share * fit.slack
    fitting = table.fit(fit.b, fit.a, invert(moved)) if is_back else table.fit(fit.a, fit.b, moved)
    expected = (2 * index + is_back, 2 * index + 1 - is_back)
    distance = np.linalg.norm(way) * share
    if distance < 0.99:
        assert fitting == expected
    elif distance > 1.01:
        assert fitting is None


_KITS: list[Kit] = []


def table_kit_of_both() -> Kit:
    if not _KITS:
        _KITS.append(table_kit(table(THIN, SQUARE), table(THICK, ROUND)))
    return _KITS[0]


def test_poses_of_a_pair_are_observed_and_inferred_ones(kit: Kit) -> None:
    table = DockingTable.of(kit)
    corners = {(x, z) for x in (-0.8, 0.8) for z in (-0.8, 0.8)}
    for top in (0, 2):
        for leg in (1, 3):
            places = np.round(table.poses(top, leg)[:, :3, 3], 6)
            assert {(x, z) for x, y, z in places.tolist() if y < 0} == corners
            assert np.allclose(np.sort(invert(table.poses(leg, top))[:, 1, 3]), np.sort(places[:, 1]))
    near = pose(0.8, -0.61, 0.8) @ table.poses(0, 1)[0]
    near[:3, 3] = (0.8, -0.61, 0.8)
    ((gap, nearest),) = table.nearest(0, 1, near)
    assert gap == pytest.approx(0.01, abs=1e-6)
    assert nearest[:3, 3] == pytest.approx([0.8, -0.6, 0.8])
