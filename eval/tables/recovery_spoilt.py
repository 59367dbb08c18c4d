"""`make eval TABLE=recovery_spoilt`: recovery out of the distribution (geocode §4.4)."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

from eval.evaluation import Answer, Evaluation, Strip
from eval.needs import CURVE_PROGRAM
from eval.subject import Subject

__all__ = ["TABLE"]

SHOWN = 8
"""Recoveries of each kind that the report shows."""


def _answer(subject: Subject, asked: Namespace) -> Answer:
    from eval.recovery import held_out, methods, tried, usable_models
    from eval.spoilt import WAYS, foreign_inputs, foreign_rows, foreign_table, other_views, spoilt_inputs, spoilt_table
    from pipeline.randomness import decision_rng
    from stages.shape.views.sheet import picture_png
    from stages.training.recovery.files import recovery_picture

    models = usable_models(subject.models, asked.programs)
    rows, foreign, strips, seed = [], [], [], subject.config.seed
    brought = {(folder, kind): foreign_inputs(folder, kind) for folder in asked.foreign for _, kind in models}
    for (program, kind), model in sorted(models.items()):
        ways = methods(model, asked.tries, seed)
        for name, shapes, inputs in held_out(model, asked.spoilt, decision_rng(seed, "recovery", program)):
            if "novel" in name:
                continue
            spoilt = {**spoilt_inputs(kind, inputs, seed), **other_views(model, shapes, seed)}
            for how, given in spoilt.items():
                label = f"{model.program.name}, {name}, {how}"
                found = [tried(f"{label}: {way}", model.program, ways[way], shapes, given) for way in WAYS]
                rows += found
                pairs = list(zip(given, found[-1].results, strict=True))[:SHOWN]
                pictures = [(each.name, picture_png(recovery_picture(each, result))) for each, result in pairs]
                strips.append(Strip(f"Input and result, {label}", pictures))
        for folder in asked.foreign:
            strangers = brought[folder, kind]
            if not strangers:
                continue
            label = f"{model.program.name}, {folder.name}"
            found_there = foreign_rows(model, strangers, asked.tries, seed)
            foreign += [(f"{label}: {way}", distances, results) for way, distances, results in found_there]
            _, _, last = found_there[-1]
            pairs = list(zip(strangers, last, strict=True))[:SHOWN]
            pictures = [(each.name, picture_png(recovery_picture(each, result))) for each, result in pairs]
            strips.append(Strip(f"Input and result, {label}", pictures))
    tables = [spoilt_table(rows), *([foreign_table(foreign)] if foreign else [])]
    return Answer(tables, strips=strips)


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("--spoilt", type=int, default=4, help="shapes that are recovered, of each kind of input")
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
    answer=_answer,
    options=_options,
)
