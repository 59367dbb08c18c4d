"""`make eval TABLE=recovery`: recovery of shapes from clouds and drawings (geocode §4.2, Tables 2 and 3)."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

from pydantic import Field

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, ImageRow, TableResult
from eval.engine.requirements import CURVE_PROGRAM
from eval.engine.results_cache import TableSection, cached_sections
from pipeline.config import StrictModel
from stages.training.checkpoint import weights_of_kind

if TYPE_CHECKING:
    from stages.training.recovery.trained import TrainedRecovery

RESULTS_SHOWN = 16
"""Of each kind of input."""
SHAPES_COMPARED = 8
"""Shapes whose parameters are changed one by one, to find errors that do not show."""


class RecoveryOptions(StrictModel):
    """What is recovered, and how long the search is."""

    programs: tuple[str, ...] = Field((), description="programs whose models are measured; all unless given")
    shapes: int = Field(16, ge=1, description="shapes of each kind of input")
    refined: int = Field(4, ge=0, description="of these, how many also by search")
    budget: int = Field(300, ge=1, description="shapes that a search evaluates")


def _sections(run: DatasetRun, options: RecoveryOptions) -> Iterator[TableSection]:
    """Yield a section for each program and kind of input."""
    from eval.recovery.methods import usable_models
    from stages.programs.program import program_module
    from stages.training.recovery.trained import PRETRAINED_FOLDER

    files = [*weights_of_kind(run.models, "recovery"), *weights_of_kind(PRETRAINED_FOLDER, "recovery")]
    for (program, kind), model in sorted(usable_models(run.models, options.programs).items()):
        compute = partial(_of_model, model, options, run.config.seed)
        own_options = ("shapes", "refined", "budget")
        yield TableSection(f"{program}, {kind}", files, compute, (program_module(program),), own_options)


def _of_model(model: TrainedRecovery, options: RecoveryOptions, seed: int) -> TableResult:
    from eval.recovery.methods import (
        MethodResults,
        apply_method,
        held_out,
        indistinguishable_parameters,
        methods,
        sampling_floor,
    )
    from eval.recovery.parameter_chart import parameter_chart
    from eval.recovery.tables import parameters_table, recovery_table
    from pipeline.randomness import decision_rng
    from stages.recovery.files import recovery_picture
    from stages.shape.views.sheet import picture_png

    rows: list[MethodResults] = []
    image_rows, parameters = [], {}
    by_name = methods(model, options.budget, seed)
    rng = decision_rng(seed, "recovery", model.header["program"])
    for name, shapes, inputs in held_out(model, options.shapes, rng):
        label = f"{model.program.name}, {name}"
        results = {}
        for method_name, method in by_name.items():
            # a search from the base shape takes as long for drawings from any view
            if method_name == "base shape, refined" and "novel" in name:
                continue
            count = options.refined if method_name.endswith("refined") else options.shapes
            results[method_name] = apply_method(
                f"{label}: {method_name}", model.program, method, shapes[:count], inputs[:count]
            )
        rows += results.values()
        estimated, refined = results["network"], results["network, refined"]
        same = indistinguishable_parameters(estimated, shapes[:SHAPES_COMPARED])
        parameters[label] = estimated, same
        image_rows.append(ImageRow(f"Right parameters, {label}", [("", parameter_chart([estimated, refined], same))]))
        best = [*refined.results, *estimated.results[len(refined.results) :]]
        pictures = [
            (
                f"{given.name}, {'refined' if number < options.refined else 'network'}",
                picture_png(recovery_picture(given, result)),
            )
            for number, (given, result) in enumerate(zip(inputs[:RESULTS_SHOWN], best, strict=False))
        ]
        image_rows.append(ImageRow(f"Input and result, {label}", pictures))
    floors = {
        f"{model.program.name}, {model.entry.input}: true shape": float(sampling_floor(model.program, shapes).mean())
    }
    tables = [recovery_table(rows, floors, options.budget), parameters_table(parameters)]
    return TableResult(tables, image_rows=image_rows)


TABLE = Evaluation(
    question="How close are shapes recovered from clouds and drawings, and which parameters are right?",
    requirements=(CURVE_PROGRAM,),
    estimate_seconds=lambda run: 750.0,
    compute=cached_sections(_sections),
    options=RecoveryOptions,
)
