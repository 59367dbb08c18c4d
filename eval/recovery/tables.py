"""Tables of recovery: distances to the true shapes, and right parameters (geocode §4.2, Tables 2 and 3)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from eval.engine.table import Cell, ReferenceRow, Table
from eval.recovery.methods import POINTS_PER_SHAPE, MethodResults
from stages.programs.movement import MIN_CLASS_MOVEMENT
from stages.shape.arrays import BoolArray, FloatArray

PUBLISHED = (
    *(
        ReferenceRow(f"{program}, {method}", f"geocode, Table 2, sketch, {angle}", {"chamfer": figure})
        for program, method, trained, novel in (
            ("chair", "Huang et al.", 2.142e-3, 8.030e-3),
            ("chair", "GeoCode", 1.057e-3, 8.075e-3),
            ("vase", "Huang et al.", 4.328e-3, 9.271e-3),
            ("vase", "GeoCode", 4.875e-3, 9.788e-3),
            ("table", "Huang et al.", 4.051e-3, 9.667e-3),
            ("table", "GeoCode", 2.497e-3, 8.533e-3),
            ("ceiling lamp", "Huang et al.", 1.361e-2, 2.236e-2),
            ("ceiling lamp", "GeoCode", 1.403e-2, 2.272e-2),
        )
        for angle, figure in (("trained angles", trained), ("novel angle", novel))
    ),
    *(
        ReferenceRow(f"chair, {method}", f"geocode, Table 3, {given}", {"chamfer": figure})
        for method, points, sketch in (("classification", 4.0e-4, 1.06e-3), ("regression", 1.98e-3, 3.64e-3))
        for given, figure in (("point cloud", points), ("sketch", sketch))
    ),
)


def recovery_table(results: Sequence[MethodResults], floors: Mapping[str, float], budget: int) -> Table:
    """Return one row for each method and kind of input; the results of each kind of input include `network`."""
    rows: list[tuple[Cell, ...]] = []
    programs = {result.program.name for result in results}
    first = {_input_of(result): result for result in results if result.label.endswith(": network")}
    for result in results:
        estimate = first[_input_of(result)]
        count = len(result.distances)
        rows.append(
            (
                result.label,
                count,
                *_accuracy(result),
                "" if result is estimate else _significance(result.distances, estimate.distances[:count]),
                float(estimate.distances[:count].mean()),
                result.seconds,
            )
        )
    rows += [(name, "", value) + ("",) * 6 for name, value in floors.items()]
    return Table(
        "Recovery of held-out shapes",
        ("input", "shapes", "chamfer", "median", "exact %", "near %", "p", "network on these", "seconds"),
        tuple(rows),
        notes=(
            f"chamfer: mean squared distance to the nearest of {POINTS_PER_SHAPE:,} points, the mean of both "
            "directions, in the unit sphere around the centre of the box, as in the published code. exact, near: right "
            "parameters, and parameters within one class, of those that the true shape shows. p: of a paired t-test "
            "against the "
            "network's estimate of the same shapes, whose mean is in the next column. Seconds: of one core. Refined: "
            f"search with {budget} shapes at most, for the first few inputs. True shape: two samples of one shape.",
            "Published values are for the published programs, shapes and drawings. The published out-of-distribution "
            "sets (AmateurSketch, ProSketch, ScanNet, ShapeNet) are not available.",
        ),
        reference_rows=[row for row in PUBLISHED if row.name.partition(",")[0].replace(" ", "_") in programs],
    )


def _input_of(result: MethodResults) -> str:
    return result.label.partition(": ")[0]


def _accuracy(result: MethodResults) -> tuple[float, float, float, float]:
    """Return mean and median distance, and percentages of exact and near parameters."""
    return (
        float(result.distances.mean()),
        float(np.median(result.distances)),
        100.0 * float(result.exact[result.visible].mean()),
        100.0 * float(result.near[result.visible].mean()),
    )


def baselines_table(results: Sequence[MethodResults], steps: Mapping[str, int]) -> Table:
    """Return one row for each model; the others are compared with the first. `steps`: of its training, by label."""
    rows: list[tuple[Cell, ...]] = [
        (
            result.label,
            steps[result.label],
            *_accuracy(result),
            _significance(result.distances, results[0].distances),
        )
        for result in results
    ]
    notes = (
        f"Network estimates, without search, of {len(results[0].distances)} held-out shapes, the same for all models. "
        "chamfer, exact, near: as in the table of recovery. p: of a paired t-test against the first row. classes: one "
        "class for each value. values: continuous parameters are regressed. apart: regressed by a network of their own "
        "(Huang et al. 2017). unmarked: hidden parameters are not trained, and there is no existence label.",
    )
    published = [row for row in PUBLISHED if "Table 3" in row.source]
    columns = ("model", "steps", "chamfer", "median", "exact %", "near %", "p")
    return Table("Kinds of outputs, at equal training", columns, tuple(rows), notes, published)


def parameters_table(results: Mapping[str, tuple[MethodResults, BoolArray]]) -> Table:
    """Return one row for each kind of input: its results, and `indistinguishable_parameters` of its first shapes."""
    rows: list[tuple[Cell, ...]] = []
    for name, (result, same) in results.items():
        visible = result.visible[: len(same)]
        counts = visible.sum(axis=0)
        # parameters that are visible in a single shape are not ranked
        wrong = (visible & ~same).sum(axis=0) / np.maximum(counts, 1) * (counts > 1)
        worst = [result.program.parameters[index].name for index in np.argsort(-wrong, kind="stable")[:4].tolist()]
        shares = (100.0 * float(right[: len(same)][visible].mean()) for right in (result.exact, result.near, same))
        rows.append((name, len(same), *shares, ", ".join(worst)))
    notes = (
        "Of the network alone; of parameters that the true shape shows. alike: right, or moving no point of the true "
        f"surface by more than {MIN_CLASS_MOVEMENT:.2%} of the diagonal, which no cloud or drawing shows. Most "
        "often unlike: the parameters that are rarest alike. Inputs have no size: a change of scale, such as "
        "height and widths together, shows only in parameters that do not scale with it.",
    )
    columns = ("input", "shapes", "exact %", "near %", "alike %", "most often unlike")
    return Table("Right and indistinguishable parameters", columns, tuple(rows), notes)


def _significance(distances: FloatArray, others: FloatArray) -> Cell:
    from scipy.stats import ttest_rel

    if len(distances) < 2 or np.array_equal(distances, others):
        return ""
    return float(ttest_rel(distances, others).pvalue)
