"""`make eval TABLE=recovery`: programs recovered from clouds and drawings (geocode §4.2, Tables 2 and 3)."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from eval.evaluation import Answer, Evaluation, Strip
from eval.needs import RECOVERY
from eval.subject import Subject
from stages.training.checkpoint import weights_of_kind

__all__ = ["TABLE"]

SHOWN = 8
"""Recoveries of each kind of input that the report shows."""


def _answer(subject: Subject, asked: Namespace) -> Answer:
    from eval.recovery import accuracy_chart, floor, held_out, methods, recovery_table, tried, usable_models
    from pipeline.randomness import decision_rng
    from stages.shape.views.sheet import picture_png
    from stages.training.recovery.files import recovery_picture
    from stages.training.recovery.recover import recover_input

    models = usable_models(subject.models)
    rows, floors, strips, seed = [], {}, [], subject.config.seed
    for (program, kind), model in sorted(models.items()):
        ways = methods(model, asked.budget, seed)
        for name, shapes, inputs in held_out(model, asked.shapes, decision_rng(seed, "recovery", program)):
            of_input = f"{model.program.name}, {name}"
            found = [tried(f"{of_input}: {way}", model.program, ways[way], shapes, inputs) for way in ways]
            rows += found
            charts = [each for each in found if ": network" in each.label]
            strips.append(Strip(f"Parameters that are right, {of_input}", [("", accuracy_chart(charts))]))
            pictures = []
            for given in inputs[:SHOWN]:
                recovered = recover_input(given, program, {(program, kind): model}, "y", asked.budget, seed, False)
                pictures.append((given.name, picture_png(recovery_picture(given, recovered))))
            strips.append(Strip(f"Input and result, {of_input}", pictures))
        floors[f"{model.program.name}, {kind}: true shape"] = float(floor(model.program, shapes).mean())
    return Answer([recovery_table(rows, floors, asked.budget)], strips=strips)


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("--shapes", type=int, default=30, help="shapes that are recovered, of each kind of input")
    parser.add_argument("--budget", type=int, default=600, help="shapes that a refinement makes at most")


TABLE = Evaluation(
    question="How near do shapes come that are recovered from clouds and drawings, and which parameters are right?",
    needs=(RECOVERY,),
    seconds=lambda subject: 400.0 * len(weights_of_kind(subject.models, "recovery")),
    answer=_answer,
    options=_options,
)
