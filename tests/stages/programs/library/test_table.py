"""Tables are on the ground and carry their tops; `test_every_program.py` has what holds for all."""

from __future__ import annotations

import numpy as np
import pytest

from stages.programs.draws import draw
from stages.programs.library.table import PROGRAM, build
from stages.programs.library.table_dimensions import TableDimensions
from stages.programs.schema import Values


def tables(count: int, **fixed: float) -> list[Values]:
    """Random tables with some values fixed, all valid."""
    schema = PROGRAM.schema
    columns = draw(schema, 2 * count, np.random.default_rng(3), True).columns
    candidates = [schema.canonical({**schema.from_vector(column), **fixed})[0] for column in columns.T]
    return [values for values in candidates if not PROGRAM.violated(values)][:count]


def test_table_has_the_published_number_of_parameters_and_values() -> None:
    assert len(PROGRAM.parameters) == 36
    assert sum(len(parameter.values) for parameter in PROGRAM.parameters) == 209
    assert sum(parameter.classes for parameter in PROGRAM.parameters) == 238


def test_tables_are_on_the_ground_and_no_part_pierces_their_tops() -> None:
    for values in tables(300):
        parts, table = build(values), TableDimensions(values)
        assert min(part.mesh.bounds[0, 1] for part in parts) == pytest.approx(0.0, abs=1e-9)
        assert parts[0].mesh.bounds[:, 1] == pytest.approx([table.under, table.height])
        assert parts[0].mesh.bounds[1, [0, 2]] == pytest.approx(table.half)
        for part in parts[1:]:
            assert part.mesh.bounds[1, 1] < table.height - 0.3 * table.thickness


def test_four_legs_begin_under_the_top_without_crossing() -> None:
    for values in tables(200, is_monoleg=False):
        table = TableDimensions(values)
        legs = [part.mesh for part in build(values) if part.label == "leg"]
        assert len(legs) == 4
        for leg in legs:
            head = leg.vertices[leg.vertices[:, 1] > table.under - 1e-9][:, [0, 2]]
            outline = table.outline * (table.bearing / table.half)
            sides = np.roll(outline, -1, axis=0) - outline
            offsets = head[:, None] - outline
            assert (sides[:, 0] * offsets[..., 1] - sides[:, 1] * offsets[..., 0] > -1e-9).all()
        assert legs[0].bounds[0, 0] > 0.0
        assert legs[0].bounds[0, 2] > 0.0


def test_tent_has_its_legs_and_a_glide_under_every_leg() -> None:
    for values in tables(60, is_monoleg=True, is_monoleg_tent=True):
        labels = [part.label for part in build(values)]
        assert labels.count("leg") == labels.count("glide") == values["monoleg_tent_count"]
        assert ("pedestal" in labels) == (values["monoleg_tent_pct"] < 0.4)


def test_tops_range_from_a_rectangle_to_an_ellipse() -> None:
    base = PROGRAM.schema.base
    square, round_ = (
        TableDimensions({**base, "table_top_shape": 0.0}),
        TableDimensions({**base, "table_top_shape": 1.0}),
    )
    assert len(square.outline) == 4
    assert ((round_.outline / round_.half) ** 2).sum(axis=1) == pytest.approx(1.0)


@pytest.mark.parametrize("state", range(4))
def test_edge_keeps_the_size_of_the_top(state: int) -> None:
    for values in tables(20, table_top_profile_state=state):
        edge = TableDimensions(values).edge
        assert edge[:, 0].min() == pytest.approx(0.0, abs=1e-12)
        assert edge[[0, -1], 1] == pytest.approx([0.0, TableDimensions(values).thickness])
        assert (np.diff(edge[:, 1]) > 0.0).all()
