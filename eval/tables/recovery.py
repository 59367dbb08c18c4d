"""`make eval TABLE=recovery`: programs recovered from clouds and drawings (geocode §4.2, Tables 2 and 3)."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, ImageRow, TableResult
from eval.engine.requirements import CURVE_PROGRAM
from eval.engine.results_cache import TableSection, cached_sections
from stages.training.checkpoint import weights_of_kind

if TYPE_CHECKING:
    from stages.training.recovery.trained import TrainedRecovery

SHOWN = 16
"""Recoveries of each kind of input that the report shows."""
LOOKED_AT = 8
"""Shapes whose parameters are changed one by one, to see how much each error is."""


def _parts(subject: DatasetRun, asked: Namespace) -> Iterator[TableSection]:
    """One for each program and kind of input."""
    from eval.recovery.accuracy import usable_models
    from stages.programs.program import program_module
    from stages.training.recovery.trained import PRETRAINED_FOLDER

    reads = [*weights_of_kind(subject.models, "recovery"), *weights_of_kind(PRETRAINED_FOLDER, "recovery")]
    for (program, kind), model in sorted(usable_models(subject.models, asked.programs).items()):
        make = partial(_of_model, model, asked, subject.config.seed)
        options = ("shapes", "refined", "budget")
        yield TableSection(f"{program}, {kind}", reads, make, (program_module(program),), options)


def _of_model(model: TrainedRecovery, asked: Namespace, seed: int) -> TableResult:
    from eval.recovery.accuracy import (
        Found,
        accuracy_chart,
        alike,
        floor,
        held_out,
        methods,
        parameters_table,
        recovery_table,
        tried,
    )
    from pipeline.randomness import decision_rng
    from stages.recovery.files import recovery_picture
    from stages.shape.views.sheet import picture_png

    rows: list[Found] = []
    strips, shares = [], {}
    ways = methods(model, asked.budget, seed)
    rng = decision_rng(seed, "recovery", model.header["program"])
    for name, shapes, inputs in held_out(model, asked.shapes, rng):
        of_input = f"{model.program.name}, {name}"
        found = {}
        for way, method in ways.items():
            # searching from the base shape is as long for drawings of any angle
            if way == "base shape, refined" and "novel" in name:
                continue
            many = asked.refined if way.endswith("refined") else asked.shapes
            found[way] = tried(f"{of_input}: {way}", model.program, method, shapes[:many], inputs[:many])
        rows += found.values()
        guessed, refined = found["network"], found["network, refined"]
        shares[of_input] = guessed, alike(guessed, shapes[:LOOKED_AT])
        chart = accuracy_chart([guessed, refined], shares[of_input][1])
        strips.append(ImageRow(f"Parameters that are right, {of_input}", [("", chart)]))
        best = [*refined.results, *guessed.results[len(refined.results) :]]
        captions = [f"{each.name}, {'refined' if at < asked.refined else 'network'}" for at, each in enumerate(inputs)]
        pictures = [
            (caption, picture_png(recovery_picture(given, result)))
            for caption, given, result in zip(captions[:SHOWN], inputs, best, strict=False)
        ]
        strips.append(ImageRow(f"Input and result, {of_input}", pictures))
    floors = {f"{model.program.name}, {model.entry.input}: true shape": float(floor(model.program, shapes).mean())}
    return TableResult([recovery_table(rows, floors, asked.budget), parameters_table(shares)], strips=strips)


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("--programs", nargs="*", default=[], metavar="PROGRAM", help="which; all unless you say")
    parser.add_argument("--shapes", type=int, default=16, help="shapes that are recovered, of each kind of input")
    parser.add_argument("--refined", type=int, default=4, help="of these, how many by search")
    parser.add_argument("--budget", type=int, default=300, help="shapes that a refinement makes at most")


TABLE = Evaluation(
    question="How near do shapes come that are recovered from clouds and drawings, and which parameters are right?",
    needs=(CURVE_PROGRAM,),
    seconds=lambda subject: 750.0,
    answer=cached_sections(_parts, _options),
    options=_options,
)
