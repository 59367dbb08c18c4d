"""The figures of recovery, on stools."""

from __future__ import annotations

from itertools import islice

import numpy as np

from eval.recovery import PUBLISHED, accuracy_chart, floor, held_out, methods, published_chamfer, recovery_table, tried
from stages.programs.program import find_program
from stages.training.recovery.reading import Input
from stages.training.recovery.settings import RecoveryEntry
from stages.training.recovery.shapes import TEST, random_shapes
from stages.training.recovery.trained import TrainedRecovery
from stages.training.recovery.training import new_model
from tests.stages.training.recovery.toy import PROGRAM, SMALL

STOOL = find_program(PROGRAM)


def model() -> TrainedRecovery:
    entry = RecoveryEntry.model_validate({**SMALL, "widths": (8, 8), "channels": (2,) * 8, "decoder": (16, 8)})
    header = {"program": PROGRAM, "figures": {"val_loss": 1.0, "val_chamfer_high": 0.01}}
    return TrainedRecovery(new_model(entry, STOOL, 0).eval(), STOOL, entry, header)


def test_published_chamfer_is_of_the_unit_sphere_and_the_mean_of_both_ways() -> None:
    corners = np.array([[x, y, z] for x in (0.0, 2.0) for y in (0.0, 2.0) for z in (0.0, 2.0)])
    with_centre = np.vstack([corners, [[1.0, 1.0, 1.0]]])
    # the centre is at distance 1 from every corner of the sphere's cube; the corners find themselves
    assert np.isclose(published_chamfer(corners, with_centre), (0.0 + 1.0 / 9.0) / 2.0)
    assert np.isclose(published_chamfer(corners * 50 + 7, with_centre), (0.0 + 1.0 / 9.0) / 2.0)


def test_who_knows_the_truth_is_right_and_who_knows_nothing_is_not() -> None:
    shapes = list(islice(random_shapes(STOOL, TEST, np.random.default_rng(0)), 6))
    inputs = [Input(str(number), points=np.zeros((40, 3))) for number in range(len(shapes))]
    truth = iter([each.values for each in shapes])
    knows = tried("knows", STOOL, lambda _: next(truth), shapes, inputs)
    base = tried("base", STOOL, lambda _: STOOL.schema.base, shapes, inputs)
    assert knows.exact.all()
    assert knows.near[knows.visible].all()
    assert np.allclose(knows.distances, floor(STOOL, shapes))
    assert base.distances.mean() > 3 * knows.distances.mean()
    assert base.exact[base.visible].mean() < 0.6
    assert accuracy_chart([knows, base]).startswith(b"\x89PNG")


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
    assert rows["network"][5] == ""
    assert rows["network, refined"][1] <= rows["network"][1]
    assert {each.name.partition(",")[0] for each in PUBLISHED} == {"chair", "vase", "table", "ceiling lamp"}
