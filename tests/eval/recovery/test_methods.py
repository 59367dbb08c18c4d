"""Recovery methods and their tables, on stools."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np

from eval.recovery.methods import (
    apply_method,
    held_out,
    indistinguishable_parameters,
    methods,
    published_chamfer,
    sampling_floor,
)
from eval.recovery.parameter_chart import parameter_chart
from eval.recovery.tables import PUBLISHED, baselines_table, parameters_table, recovery_table
from stages.programs.program import find_program
from stages.programs.schema import Values
from stages.recovery.inputs import RecoveryInput
from stages.recovery.result import RecoveryResult
from stages.training.recovery.settings import RecoveryModelConfig
from stages.training.recovery.shapes import TEST_INTERVAL, random_training_shapes
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


def test_published_chamfer_is_scaled_to_unit_sphere_and_symmetric() -> None:
    corners = np.array([[x, y, z] for x in (0.0, 2.0) for y in (0.0, 2.0) for z in (0.0, 2.0)])
    with_centre = np.vstack([corners, [[1.0, 1.0, 1.0]]])
    # the centre is at distance 1 from every corner of the sphere's cube; the corners find themselves
    assert np.isclose(published_chamfer(corners, with_centre), (0.0 + 1.0 / 9.0) / 2.0)
    assert np.isclose(published_chamfer(corners * 50 + 7, with_centre), (0.0 + 1.0 / 9.0) / 2.0)


def test_true_values_are_exact_and_base_values_are_not() -> None:
    shapes = list(islice(random_training_shapes(STOOL, TEST_INTERVAL, np.random.default_rng(0)), 6))
    inputs = [RecoveryInput(str(number), points=np.zeros((40, 3))) for number in range(len(shapes))]
    truth = iter([shape.values for shape in shapes])
    true = apply_method("true", STOOL, lambda _: result(next(truth)), shapes, inputs)
    base = apply_method("base", STOOL, lambda _: result(STOOL.schema.base), shapes, inputs)
    assert true.exact.all()
    assert true.near[true.visible].all()
    assert np.allclose(true.distances, sampling_floor(STOOL, shapes))
    assert base.distances.mean() > 3 * true.distances.mean()
    assert base.exact[base.visible].mean() < 0.6
    assert parameter_chart([true, base], indistinguishable_parameters(true, shapes)).startswith(b"\x89PNG")


def test_table_has_a_row_per_method_and_references_of_its_programs() -> None:
    trained = model()
    ((name, shapes, inputs),) = held_out(trained, 2, np.random.default_rng(1))
    assert [given.points.shape for given in inputs if given.points is not None] == [(2048, 3)] * 2
    by_name = methods(trained, 20, 0)
    results = [apply_method(f"{name}: {method}", STOOL, by_name[method], shapes, inputs) for method in by_name]
    table = recovery_table(results, {"true shape": 0.0}, 20)
    assert [row[0] for row in table.rows] == [*(f"points: {method}" for method in by_name), "true shape"]
    assert not table.reference_rows
    rows = dict(zip(by_name, table.rows, strict=False))
    assert rows["network"][6] == ""
    assert rows["network, refined"][2] <= rows["network"][2]
    assert rows["network, refined"][7] == rows["network"][2]


def test_baselines_are_compared_with_the_first_model() -> None:
    shapes = list(islice(random_training_shapes(STOOL, TEST_INTERVAL, np.random.default_rng(0)), 5))
    inputs = [RecoveryInput(str(number), points=np.zeros((40, 3))) for number in range(len(shapes))]
    truth = iter([shape.values for shape in shapes])
    true = apply_method("classes, points", STOOL, lambda _: result(next(truth)), shapes, inputs)
    base = apply_method("values, points", STOOL, lambda _: result(STOOL.schema.base), shapes, inputs)
    table = baselines_table([true, base], {"classes, points": 7, "values, points": 8})
    assert [row[:2] for row in table.rows] == [("classes, points", 7), ("values, points", 8)]
    assert table.rows[0][4] == 100.0
    assert table.rows[0][6] == ""
    assert 0.0 < float(table.rows[1][6]) < 1.0
    assert {row.source.partition(", point")[0].partition(", sketch")[0] for row in table.reference_rows} == {
        "geocode, Table 3"
    }


def test_values_that_hardly_move_the_surface_are_indistinguishable() -> None:
    shape = next(
        candidate
        for candidate in random_training_shapes(STOOL, TEST_INTERVAL, np.random.default_rng(0))
        if candidate.values["height"] < 0.8
    )
    given = [RecoveryInput("one", points=np.zeros((40, 3)))]
    for offset, is_alike in ((0.0005, True), (0.05, False)):
        values = {**shape.values, "height": shape.values["height"] + offset}
        results = apply_method("off", STOOL, lambda _, values=values: result(values), [shape], given)
        forced = replace(results, exact=np.zeros_like(results.exact))
        same = indistinguishable_parameters(forced, [shape])
        height = list(STOOL.schema.by_name).index("height")
        assert bool(same[0, height]) == is_alike
        # the other parameters have their true values, and hidden ones do not count
        assert (same | ~results.visible)[0].sum() == same.shape[1] - (not is_alike)
        ((_, count, _, _, share, _),) = parameters_table({"stool": (forced, same)}).rows
        assert count == 1
        assert (share == 100.0) == is_alike
    assert {row.name.partition(",")[0] for row in PUBLISHED} == {"chair", "vase", "table", "ceiling lamp"}
