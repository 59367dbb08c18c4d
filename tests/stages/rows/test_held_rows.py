"""Which shapes are frames with rows in them, and which consist of pieces that an exchange can move."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from stages.rows.held_rows import is_held_together
from stages.rows.layout import Layout, layout_of
from stages.shape.kit import Kit
from tests.stages.rows import models
from tests.toy_kits.chains_and_rings import CHAIN, chain, kit_of


@pytest.mark.parametrize("build", [models.shelf, models.wall, models.truss, models.stair])
def test_uprights_walls_and_beams_hold_their_rows(build: Callable[[], tuple[Kit, Layout]]) -> None:
    assert is_held_together(build()[1])


def test_links_are_held_by_no_part() -> None:
    kit = kit_of(CHAIN, [chain(4)])
    assert not is_held_together(layout_of(kit, kit.exemplars[0]))
