"""`make eval TABLE=recovery_robustness`: recovery outside the training distribution (geocode §4.4)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import Field

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, ImageRow, TableResult
from eval.engine.requirements import CURVE_PROGRAM
from eval.engine.results_cache import TableSection, cached_sections
from pipeline.config import StrictModel
from stages.training.checkpoint import weights_of_kind

if TYPE_CHECKING:
    from stages.recovery.inputs import RecoveryInput
    from stages.recovery.result import RecoveryResult
    from stages.training.recovery.trained import TrainedRecovery

RESULTS_SHOWN = 8
"""Of each kind of input."""


class RecoveryRobustnessOptions(StrictModel):
    """What is recovered, and how long the search is."""

    programs: tuple[str, ...] = Field((), description="programs whose models are measured; all unless given")
    corrupted: int = Field(4, ge=0, description="held-out shapes for each corruption; 0 for external ones alone")
    search_budget: int = Field(300, ge=1, description="shapes that a search evaluates")
    external: tuple[Path, ...] = Field((), description="folders with clouds, meshes and drawings from other sources")


def _sections(run: DatasetRun, options: RecoveryRobustnessOptions) -> Iterator[TableSection]:
    """Yield a section for each program and corruption, and for each program and external folder."""
    from eval.recovery.methods import usable_models
    from eval.recovery.robustness import corruption_names, external_inputs
    from stages.programs.program import program_module
    from stages.training.recovery.trained import PRETRAINED_FOLDER

    weights = [*weights_of_kind(run.models, "recovery"), *weights_of_kind(PRETRAINED_FOLDER, "recovery")]
    models, seed = usable_models(run.models, options.programs), run.config.seed
    external = {(folder, kind): external_inputs(folder, kind) for folder in options.external for _, kind in models}
    for (program, kind), model in sorted(models.items()):
        modules = (program_module(program),)
        for corruption in corruption_names(kind) if options.corrupted else ():
            compute = partial(_of_corruption, model, corruption, options, seed)
            names = ("corrupted", "search_budget")
            yield TableSection(f"{program}, {kind}, {corruption}", weights, compute, modules, names)
        for folder in options.external:
            if inputs := external[folder, kind]:
                compute = partial(_of_folder, model, folder.name, inputs, options, seed)
                files = [*weights, *sorted(path for path in (folder, *folder.glob("*")) if path.is_file())]
                name = f"{program}, {kind}, from {folder.name}"
                yield TableSection(name, files, compute, modules, ("search_budget",))


def _of_corruption(
    model: TrainedRecovery, corruption: str, options: RecoveryRobustnessOptions, seed: int
) -> TableResult:
    from eval.recovery.methods import apply_method, held_out, methods
    from eval.recovery.robustness import METHOD_NAMES, corrupted_inputs, corruption_table
    from pipeline.randomness import decision_rng

    by_name, rng = methods(model, options.search_budget, seed), decision_rng(seed, "recovery", model.header["program"])
    # trained views come first
    name, shapes, inputs = next(held_out(model, options.corrupted, rng))
    given = corrupted_inputs(model, corruption, shapes, inputs, seed)
    label = f"{model.program.name}, {name}, {corruption}"
    results = [
        apply_method(f"{label}: {method}", model.program, by_name[method], shapes, given) for method in METHOD_NAMES
    ]
    return TableResult([corruption_table(results)], image_rows=[_image_row(label, given, results[-1].results)])


def _of_folder(
    model: TrainedRecovery, folder: str, inputs: Sequence[RecoveryInput], options: RecoveryRobustnessOptions, seed: int
) -> TableResult:
    from eval.recovery.robustness import external_rows, external_table

    label, rows = f"{model.program.name}, {folder}", external_rows(model, inputs, options.search_budget, seed)
    table = external_table([(f"{label}: {method}", distances, results) for method, distances, results in rows])
    return TableResult([table], image_rows=[_image_row(label, inputs, rows[-1][2])])


def _image_row(label: str, inputs: Sequence[RecoveryInput], results: Sequence[RecoveryResult]) -> ImageRow:
    from stages.recovery.files import recovery_picture
    from stages.shape.views.sheet import picture_png

    pairs = list(zip(inputs, results, strict=True))[:RESULTS_SHOWN]
    pictures = [(given.name, picture_png(recovery_picture(given, result))) for given, result in pairs]
    return ImageRow(f"Input and result, {label}", pictures)


TABLE = Evaluation(
    question="How close does recovery come for noisy, partial or redrawn inputs, and for shapes from other sources?",
    requirements=(CURVE_PROGRAM,),
    estimate_seconds=lambda run: 900.0,
    compute=cached_sections(_sections),
    options=RecoveryRobustnessOptions,
)
