"""`make eval TABLE=recovery_robustness`: recovery out of the distribution (geocode §4.4)."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, ImageRow, TableResult
from eval.engine.requirements import CURVE_PROGRAM
from eval.engine.results_cache import TableSection, cached_sections
from stages.training.checkpoint import weights_of_kind

if TYPE_CHECKING:
    from stages.recovery.inputs import RecoveryInput
    from stages.recovery.result import RecoveryResult
    from stages.training.recovery.trained import TrainedRecovery

SHOWN = 8
"""Recoveries of each kind that the report shows."""


def _parts(subject: DatasetRun, asked: Namespace) -> Iterator[TableSection]:
    """One for each program and way to spoil, and one for each program and folder from elsewhere."""
    from eval.recovery.accuracy import usable_models
    from eval.recovery.robustness import foreign_inputs, ways_to_spoil
    from stages.programs.program import program_module
    from stages.training.recovery.trained import PRETRAINED_FOLDER

    weights = [*weights_of_kind(subject.models, "recovery"), *weights_of_kind(PRETRAINED_FOLDER, "recovery")]
    models, seed = usable_models(subject.models, asked.programs), subject.config.seed
    brought = {(folder, kind): foreign_inputs(folder, kind) for folder in asked.foreign for _, kind in models}
    for (program, kind), model in sorted(models.items()):
        code = (program_module(program),)
        for how in ways_to_spoil(kind) if asked.spoilt else ():
            make = partial(_of_spoilt, model, how, asked, seed)
            yield TableSection(f"{program}, {kind}, {how}", weights, make, code, ("spoilt", "tries"))
        for folder in asked.foreign:
            if brought[folder, kind]:
                make = partial(_of_folder, model, folder.name, brought[folder, kind], asked, seed)
                reads = [*weights, *sorted(each for each in (folder, *folder.glob("*")) if each.is_file())]
                yield TableSection(f"{program}, {kind}, from {folder.name}", reads, make, code, ("tries",))


def _of_spoilt(model: TrainedRecovery, how: str, asked: Namespace, seed: int) -> TableResult:
    from eval.recovery.accuracy import held_out, methods, tried
    from eval.recovery.robustness import WAYS, spoilt_inputs, spoilt_table
    from pipeline.randomness import decision_rng

    ways, rng = methods(model, asked.tries, seed), decision_rng(seed, "recovery", model.header["program"])
    # the novel angle comes after the trained ones
    name, shapes, inputs = next(held_out(model, asked.spoilt, rng))
    given = spoilt_inputs(model, how, shapes, inputs, seed)
    label = f"{model.program.name}, {name}, {how}"
    found = [tried(f"{label}: {way}", model.program, ways[way], shapes, given) for way in WAYS]
    return TableResult([spoilt_table(found)], strips=[_strip(label, given, found[-1].results)])


def _of_folder(
    model: TrainedRecovery, folder: str, inputs: Sequence[RecoveryInput], asked: Namespace, seed: int
) -> TableResult:
    from eval.recovery.robustness import foreign_rows, foreign_table

    label, found = f"{model.program.name}, {folder}", foreign_rows(model, inputs, asked.tries, seed)
    table = foreign_table([(f"{label}: {way}", distances, results) for way, distances, results in found])
    return TableResult([table], strips=[_strip(label, inputs, found[-1][2])])


def _strip(label: str, inputs: Sequence[RecoveryInput], results: Sequence[RecoveryResult]) -> ImageRow:
    from stages.recovery.files import recovery_picture
    from stages.shape.views.sheet import picture_png

    pairs = list(zip(inputs, results, strict=True))[:SHOWN]
    pictures = [(given.name, picture_png(recovery_picture(given, result))) for given, result in pairs]
    return ImageRow(f"Input and result, {label}", pictures)


def _options(parser: ArgumentParser) -> None:
    parser.add_argument(
        "--spoilt", type=int, default=4, help="shapes that are recovered, of each kind of input; 0: foreign ones alone"
    )
    parser.add_argument("--tries", type=int, default=300, help="shapes that a refinement of them makes at most")
    parser.add_argument(
        "--foreign",
        type=Path,
        nargs="*",
        default=[],
        metavar="FOLDER",
        help="clouds, meshes and drawings from elsewhere",
    )


TABLE = Evaluation(
    question="How near does recovery come where inputs are noisy, torn, drawn otherwise, or of no program at all?",
    needs=(CURVE_PROGRAM,),
    seconds=lambda subject: 900.0,
    answer=cached_sections(_parts, _options),
    options=_options,
)
