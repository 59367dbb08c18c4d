"""Ceiling lamps hang from the ceiling; their bulbs fit and protrude from their arms."""

from __future__ import annotations

import numpy as np
import pytest

from stages.programs.draws import draw
from stages.programs.intersection import intersecting_labels
from stages.programs.library.ceiling_lamp import PROGRAM
from stages.programs.schema import Values


def test_lamps_hang_from_the_ceiling_with_a_bulb_per_arm() -> None:
    columns = draw(PROGRAM.schema, 300, np.random.default_rng(22), off_grid=True).columns
    for column in columns.T:
        values: Values = PROGRAM.schema.from_vector(column)
        parts = PROGRAM.parts(values)
        assert max(part.mesh.bounds[1, 1] for part in parts) == pytest.approx(0.0, abs=1e-9)
        count = values["light_frame_count"]
        assert [part.label for part in parts] == ["base"] + count * ["light_frame", "lightbulb"]
        base = parts[0].mesh
        np.testing.assert_allclose(
            np.ptp(base.bounds, axis=0)[[0, 2]], [0.1 + values["base_x"], 0.1 + values["base_y"]]
        )
        for arm, bulb in zip(parts[1::2], parts[2::2], strict=True):
            assert arm.mesh.bounds[1, 1] == pytest.approx(base.bounds[0, 1] / 2.0)
            assert (np.ptp(bulb.mesh.bounds, axis=0) >= 2.0 * values["lightbulb_ radius"] - 1e-9).all()


def test_large_bulbs_on_short_arms_do_not_intersect() -> None:
    for count in range(1, 9):
        values = {"light_frame_count": count, "lightbulb_ radius": 0.1, "light_frame_end_point_y": 0.0, "base_x": 0.03}
        assert intersecting_labels(PROGRAM, PROGRAM.parts(PROGRAM.schema.complete(values))) is None
