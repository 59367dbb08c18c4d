"""Parts lose support if what is close above or below them in exemplars, without any contact, is gone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from stages.autoconfig.contact_analysis import Setting
from stages.autoconfig.lost_support import lost_support
from stages.autoconfig.setting_search import CandidateSetting
from stages.autoconfig.trial_search import TrialResult
from stages.exemplars.settings import ContactConfig
from stages.shape.kit import Assembly, Kit
from tests.toy_kits.chains_and_rings import Placed, box, kit_of, pose

HALL = {
    "floor": box(1, 0.1, 1),
    "wall": box(1, 1, 0.2),
    "column": box(0.2, 0.96, 0.2),
    "roof": box(1, 0.12, 1),
    "lamp": box(0.1, 0.3, 0.1),
}
"""A column ends 0.04 below a roof on walls, without contact."""

LOOSE = ContactConfig(tolerance=0.05, kinds=("face",))


def hall(bays: int, storeys: int = 1, columns: bool = True) -> list[Placed]:
    """Return bays with a floor, a wall of some storeys at the back, a roof, and a one-storey column in front."""
    placed: list[Placed] = []
    for k in range(bays):
        placed += [("floor", pose(k, -0.05, 0)), ("roof", pose(k, storeys + 0.06, 0))]
        placed += [("wall", pose(k, 0.5 + storey, -0.4)) for storey in range(storeys)]
        placed += [("column", pose(k, 0.48, 0.4))] if columns else []
    return placed


def put(kit: Kit, shape: Sequence[Placed]) -> Assembly:
    names = [kind.name for kind in kit.types]
    types = np.array([names.index(name) for name, _ in shape], dtype=np.int16)
    return Assembly(types, np.array([at for _, at in shape]), np.empty((0, 2), dtype=np.int32))


def test_columns_lose_support_if_the_walls_grow_past_them() -> None:
    kit = kit_of(HALL, [hall(4)])
    low, high = put(kit, hall(6)), put(kit, hall(4, 2))
    assert lost_support(kit, [high, high, low]) == ("column",)
    assert lost_support(kit, [low, low, high]) == ()  # most of the shapes are whole
    assert lost_support(kit, [put(kit, hall(4, 2, columns=False))]) == ()  # absent columns lose nothing
    assert lost_support(kit, []) == ()


def test_support_from_above_and_from_below_counts() -> None:
    shelf = {"board": box(1, 0.1, 1), "jar": box(0.3, 0.6, 0.3), "side": box(0.1, 2, 1)}
    row = [("board", pose(1.5 * k, 0, 0)) for k in range(4)] + [("jar", pose(1.5 * k, 0.36, 0)) for k in range(4)]
    lifted = [(name, pose(0, 3.0, 0) @ at if name == "jar" else at) for name, at in row]
    kit = kit_of(shelf, [row], disconnected="largest", contact=LOOSE)
    assert lost_support(kit, [put(kit, row)]) == ()
    assert set(lost_support(kit, [put(kit, lifted)])) == {"jar", "board"}


def test_single_part_among_many_does_not_count() -> None:
    lamp: Placed = ("lamp", pose(0, 0.85, 0.2))
    kit = kit_of(HALL, [[*hall(8), lamp]])
    lower: Placed = ("lamp", pose(0, 0.5, 0.2))
    assert lost_support(kit, [put(kit, [*hall(8), lower])]) == ()


@pytest.mark.parametrize(("names", "sufficient"), [((), True), (("column",), False)])
def test_shapes_that_look_broken_do_not_suffice_and_hardly_count(names: tuple[str, ...], sufficient: bool) -> None:
    setting = Setting(("face",), "multiset")
    candidate = CandidateSetting(setting, TrialResult(2500, 100, 90, 0.2, 0.1, 0.5, 1.0), 1.0, (), names)
    nothing, few = (
        CandidateSetting(setting, TrialResult(2500, 0, 0, 0.0, 0.0), 1.0),
        CandidateSetting(setting, TrialResult(2500, 3, 3, 0.1, 0.1), 1.0),
    )
    assert candidate.is_sufficient == sufficient
    assert candidate.score > nothing.score
    assert (candidate.score > few.score) == sufficient
