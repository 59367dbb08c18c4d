"""The figures of recovery, on stools."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np

from eval.recovery.accuracy import (
    PUBLISHED,
    accuracy_chart,
    alike,
    baselines_table,
    floor,
    held_out,
    methods,
    parameters_table,
    published_chamfer,
    recovery_table,
    tried,
)
from stages.programs.program import find_program
from stages.programs.schema import Values
from stages.recovery.inputs import RecoveryInput
from stages.recovery.result import RecoveryResult
from stages.training.recovery.settings import RecoveryModelConfig
from stages.training.recovery.shapes import TEST_INTERVAL, random_shapes
from stages.training.recovery.trained import TrainedRecovery
from stages.training.recovery.training import new_network
from tests.stages.training.recovery.toy import PROGRAM, SMALL

STOOL = find_program(PROGRAM)


def model(**settings: str) -> TrainedRecovery:
    small = {**SMALL, "widths": (8, 8), "channels": (2,) * 8, "decoder": (16, 8)}
    entry = RecoveryModelConfig.model_validate({**small, **settings})
    header = {"program": PROGRAM, "figures": {"val_loss": 1.0, "val_chamfer_p95": 0.01}}
    return TrainedRecovery(new_network(entry, STOOL, 0).eval(), STOOL, entry, header)


def result(values: Values) -> RecoveryResult:
    return RecoveryResult(STOOL, values, 0.0, 0.0, 0.0, None, None, None, "y", 1, ())


def test_published_chamfer_is_of_the_unit_sphere_and_the_mean_of_both_ways() -> None:
    corners = np.array([[x, y, z] for x in (0.0, 2.0) for y in (0.0, 2.0) for z in (0.0, 2.0)])
    with_centre = np.vstack([corners, [[1.0, 1.0, 1.0]]])
    # the centre is at distance 1 from every corner of the sphere's cube; the corners find themselves
    assert np.isclose(published_chamfer(corners, with_centre), (0.0 + 1.0 / 9.0) / 2.0)
    assert np.isclose(published_chamfer(corners * 50 + 7, with_centre), (0.0 + 1.0 / 9.0) / 2.0)


def test_who_knows_the_truth_is_right_and_who_knows_nothing_is_not() -> None:
    shapes = list(islice(random_shapes(STOOL, TEST_INTERVAL, np.random.default_rng(0)), 6))
    inputs = [RecoveryInput(str(number), points=np.zeros((40, 3))) for number in range(len(shapes))]
    truth = iter([each.values for each in shapes])
    knows = tried("knows", STOOL, lambda _: result(next(truth)), shapes, inputs)
    base = tried("base", STOOL, lambda _: result(STOOL.schema.base), shapes, inputs)
    assert knows.exact.all()
    assert knows.near[knows.visible].all()
    assert np.allclose(knows.distances, floor(STOOL, shapes))
    assert base.distances.mean() > 3 * knows.distances.mean()
    assert base.exact[base.visible].mean() < 0.6
    assert accuracy_chart([knows, base], alike(knows, shapes)).startswith(b"\x89PNG")


def test_table_has_a_row_for_each_method_and_the_published_ones_of_its_programs() -> None:
    trained = model()
    ((name, shapes, inputs),) = held_out(trained, 2, np.random.default_rng(1))
    assert [each.points.shape for each in inputs if each.points is not None] == [(2048, 3)] * 2
    ways = methods(trained, 20, 0)
    found = [tried(f"{name}: {way}", STOOL, ways[way], shapes, inputs) for way in ways]
    table = recovery_table(found, {"true shape": 0.0}, 20)
    assert [row[0] for row in table.rows] == [*(f"points: {way}" for way in ways), "true shape"]
    assert not table.published
    rows = dict(zip(ways, table.rows, strict=False))
    assert rows["network"][6] == ""
    assert rows["network, refined"][2] <= rows["network"][2]
    assert rows["network, refined"][7] == rows["network"][2]


def test_ways_to_answer_are_compared_with_the_first() -> None:
    shapes = list(islice(random_shapes(STOOL, TEST_INTERVAL, np.random.default_rng(0)), 5))
    inputs = [RecoveryInput(str(number), points=np.zeros((40, 3))) for number in range(len(shapes))]
    truth = iter([each.values for each in shapes])
    knows = tried("classes, points", STOOL, lambda _: result(next(truth)), shapes, inputs)
    base = tried("values, points", STOOL, lambda _: result(STOOL.schema.base), shapes, inputs)
    table = baselines_table([knows, base], {"classes, points": 7, "values, points": 8})
    assert [row[:2] for row in table.rows] == [("classes, points", 7), ("values, points", 8)]
    assert table.rows[0][4] == 100.0
    assert table.rows[0][6] == ""
    assert 0.0 < float(table.rows[1][6]) < 1.0
    assert {each.source.partition(", point")[0].partition(", sketch")[0] for each in table.published} == {
        "geocode, Table 3"
    }


def test_what_moves_the_surface_by_next_to_nothing_is_as_good_as_right() -> None:
    shape = next(
        each for each in random_shapes(STOOL, TEST_INTERVAL, np.random.default_rng(0)) if each.values["height"] < 0.8
    )
    given = [RecoveryInput("one", points=np.zeros((40, 3)))]
    for off, good in ((0.0005, True), (0.05, False)):
        values = {**shape.values, "height": shape.values["height"] + off}
        found = tried("off", STOOL, lambda _, values=values: result(values), [shape], given)
        forced = replace(found, exact=np.zeros_like(found.exact))
        same = alike(forced, [shape])
        height = list(STOOL.schema.by_name).index("height")
        assert bool(same[0, height]) == good
        # the others are as they are in the truth, and what is hidden is not asked
        assert (same | ~found.visible)[0].sum() == same.shape[1] - (not good)
        ((_, count, _, _, share, _),) = parameters_table({"stool": (forced, same)}).rows
        assert count == 1
        assert (share == 100.0) == good
    assert {each.name.partition(",")[0] for each in PUBLISHED} == {"chair", "vase", "table", "ceiling lamp"}
