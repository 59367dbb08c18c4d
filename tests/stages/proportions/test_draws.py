"""Random proportions of an exemplar and of its layouts with other rows."""

from __future__ import annotations

import numpy as np

from stages.proportions.draws import draw_proportions, drawn_layouts
from stages.proportions.settings import ProportionsConfig
from stages.proportions.text import ProportionShapes
from stages.rows.settings import RowsConfig
from tests.stages.rows import models


def test_exemplar_stays_round_where_a_row_about_an_axis_changes() -> None:
    kit, _ = models.fan()
    name, shapes, config, rows = kit.exemplars[0].name, ProportionShapes(kit), ProportionsConfig(), RowsConfig()
    layouts = drawn_layouts(shapes, name, config, rows, 4, np.random.default_rng, lambda *_: None)
    assert len(layouts) > 1
    assert not layouts[0].changes
    drawn = draw_proportions(name, layouts[0], np.ones(3), np.random.default_rng(0), config, rows)
    x, y, z = (set(factors.tolist()) for factors in drawn.warp)
    assert x == z == {1.0}
    assert y != {1.0}
