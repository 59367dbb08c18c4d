"""Cabinets have the size, fronts and shelves of their parameters; `test_every_program.py` has what holds for all."""

from __future__ import annotations

import itertools
from collections import Counter

import numpy as np
import pytest

from stages.programs.curves import mesh_defects
from stages.programs.draws import draw
from stages.programs.library.cabinet import PROGRAM, build
from stages.programs.library.cabinet_dimensions import CabinetDimensions
from stages.programs.schema import Values


def cabinets(count: int, **fixed: float) -> list[Values]:
    """Random cabinets with some values fixed, all valid."""
    schema = PROGRAM.schema
    columns = draw(schema, 2 * count, np.random.default_rng(4), True).columns
    candidates = [schema.canonical({**schema.from_vector(column), **fixed})[0] for column in columns.T]
    return [values for values in candidates if not PROGRAM.violated(values)][:count]


def test_cabinet_has_the_published_number_of_parameters() -> None:
    assert len(PROGRAM.parameters) == 25


def test_cabinets_have_their_height_and_depth_on_the_ground() -> None:
    for values in cabinets(200):
        bounds = np.array([part.mesh.bounds for part in build(values)])
        assert bounds[:, 0, 1].min() == pytest.approx(0.0, abs=1e-9)
        assert bounds[:, 1, 1].max() == pytest.approx(values["height"])
        assert bounds[:, 0, 2].min() == pytest.approx(-values["depth"] / 2.0)


def test_columns_have_shelves_or_drawers_and_doors() -> None:
    for values in cabinets(150):
        labels = Counter(part.label for part in build(values))
        opened, closed = values["open_columns"], values["column_count"] - values["open_columns"]
        leaves = closed * (2 if values["column_width"] > 0.55 else 1)
        assert labels["shelf"] == (values["shelf_count"] if opened else 0) * opened
        assert labels["door"] == leaves
        assert labels["drawer"] == closed * values["drawer_rows"]
        assert labels["handle"] == labels["door"] + labels["drawer"]
        assert labels["glass"] == (leaves if values["door_style"] == 3 else 0)


def test_open_columns_are_in_the_middle() -> None:
    base = PROGRAM.schema.base
    kept = {
        (count, opened): CabinetDimensions({**base, "column_count": count, "open_columns": opened}).is_open
        for count, opened in ((3, 1), (4, 2), (2, 1), (3, 3))
    }
    assert kept == {
        (3, 1): [False, True, False],
        (4, 2): [False, True, True, False],
        (2, 1): [False, True],
        (3, 3): [True, True, True],
    }


def test_fronts_are_disjoint_and_within_the_case() -> None:
    for values in cabinets(150, open_columns=0):
        cabinet = CabinetDimensions(values)
        fronts = [part.mesh.bounds for part in build(values) if part.label in {"door", "drawer"}]
        for index, front in enumerate(fronts):
            assert -cabinet.half < front[0, 0] < front[1, 0] < cabinet.half
            assert cabinet.floor < front[0, 1] < front[1, 1] < cabinet.ceiling
            for other in fronts[:index]:
                gap = np.maximum(front[0, :2], other[0, :2]) - np.minimum(front[1, :2], other[1, :2])
                assert gap.max() > 0.0015


def test_handles_are_on_their_fronts() -> None:
    for values in cabinets(150, open_columns=0):
        parts = build(values)
        fronts = [part.mesh.bounds for part in parts if part.label in {"door", "drawer"}]
        for part in parts:
            if part.label == "handle":
                low, high = part.mesh.bounds
                holding = [a for a, b in fronts if (a[:2] < low[:2]).all() and (high[:2] < b[:2]).all()]
                assert len(holding) == 1, PROGRAM.schema.to_text(values)


@pytest.mark.parametrize("kind", range(3))
def test_handles_of_the_lowest_doors_have_no_defects(kind: int) -> None:
    low = {"height": 0.7, "base_height": 0.24, "drawer_rows": 4, "drawer_share": 1.0, "open_columns": 0}
    for values in cabinets(20, **low, handle_type=kind, handle_size=0.0):
        for part in build(values):
            assert part.label != "handle" or not mesh_defects(part.mesh), PROGRAM.schema.to_text(values)


def test_handles_of_framed_drawers_reach_the_panel() -> None:
    for values in cabinets(40, open_columns=0, door_style=1, drawer_rows=2):
        parts = build(values)
        for drawer, handle in itertools.pairwise(parts):
            if drawer.label == "drawer":
                panel = drawer.mesh.vertices[-4:, 2].max()
                assert panel < CabinetDimensions(values).face - 0.005
                assert handle.mesh.bounds[0, 2] < panel
