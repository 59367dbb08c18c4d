"""`make eval TABLE=shapeassembly`: what models write ShapeAssembly programs like (shapeassembly §7, Tables 2 to 6)."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from functools import partial
from typing import TYPE_CHECKING, Any

from eval.evaluation import Answer, Curve, Evaluation, Strip
from eval.needs import PROGRAM_WRITERS, PROGRAMS
from eval.subject import Subject
from stages.shapeassembly.settings import NUCLEUS
from stages.training.checkpoint import weights_of_kind

if TYPE_CHECKING:
    from stages.shapeassembly.program import Program

__all__ = ["TABLE"]

SHOWN = 16


def _answer(subject: Subject, asked: Namespace) -> Answer:
    from eval.models import Trained, trained_models, training_curve
    from eval.programs import (
        clouds_of,
        editability_table,
        novelty,
        physics_of,
        quality_table,
        smoothness,
        smoothness_table,
        variability,
        variability_table,
    )
    from eval.realism import POINTS, realism
    from pipeline.randomness import decision_rng
    from stages.training.program_lm.trained import load_program_lm
    from stages.training.program_vae.trained import TrainedProgramVae, load_program_vae

    models: list[Trained[Any]] = [
        *trained_models(subject.models, "program_vae", load_program_vae),
        *trained_models(subject.models, "program_lm", partial(load_program_lm, nucleus=asked.nucleus)),
    ]
    quality, seen, written, varied, novel, rejected, smooth, curves, strips = {}, {}, {}, {}, {}, {}, {}, {}, []
    for each in models:
        train, val = (_programs(subject, each.kit, split) for split in ("train", "val"))
        clouds = {split: clouds_of(programs) for split, programs in (("train", train), ("val", val))}
        rng = decision_rng(subject.config.seed, "shapeassembly", each.folder)
        samples, drawn = each.model.sample(asked.samples, rng, asked.temperature)
        real = f"{each.kit}, val"
        for name, programs in ((each.folder, samples), (real, val[: asked.samples])):
            if name not in quality:
                quality[name] = physics_of(programs)
                shown, learnt = clouds_of(programs, POINTS), clouds_of(train[: len(programs)], POINTS)
                seen[name] = realism(shown, learnt, subject.config.seed)
                written[name] = programs
                varied[name] = variability(programs, clouds["train"], None if name == real else clouds["val"])
                novel[name] = novelty(programs, train)
        rejected[each.folder] = 100 * (1 - len(samples) / drawn)
        if isinstance(each.model, TrainedProgramVae):
            smooth[each.folder] = smoothness(each.model, asked.sequences, asked.steps, rng)
        curves[each.folder] = training_curve(subject.models / each.folder, "val_loss")
        strips.append(Strip(f"Samples of {each.folder}", _pictures(samples[:SHOWN])))
    return Answer(
        [
            quality_table(quality, seen, rejected),
            editability_table(written),
            variability_table(varied, novel),
            smoothness_table(smooth),
        ],
        [Curve("How well programs that were not learnt are written", "steps of training", "loss", curves)],
        strips,
    )


def _programs(subject: Subject, category: str, split: str) -> list[Program]:
    """The programs of a category in a split of the dataset."""
    from stages.shape.sample import read_samples
    from stages.shapeassembly.parser import parse

    shards = sorted(subject.places.stage("shapeassembly").root.glob(f"{subject.config.name}-{split}-*.tar"))
    return [parse(each.text) for shard in shards for each in read_samples(shard) if each.kit == category]


def _pictures(programs: list[Program]) -> list[tuple[str, bytes]]:
    from eval.pictures import shape_picture
    from stages.shapeassembly.interpreter import execute
    from stages.shapeassembly.shape import shape_of_execution

    return [("", shape_picture(shape_of_execution(execute(each)))) for each in programs]


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("--samples", type=int, default=1000, help="programs that each model writes")
    parser.add_argument("--temperature", type=float, default=1.0, help="as in shapeassembly.written")
    parser.add_argument("--nucleus", type=float, default=NUCLEUS, help="as in shapeassembly.written")
    parser.add_argument("--sequences", type=int, default=100, help="straight ways in the latent space of each model")
    parser.add_argument("--steps", type=int, default=100, help="points of each way")


TABLE = Evaluation(
    question="Do programs that a model writes stand, can they be edited, how much do they vary, and how smoothly?",
    needs=(PROGRAM_WRITERS, PROGRAMS),
    seconds=lambda subject: sum(
        each * len(weights_of_kind(subject.models, kind))
        for kind, each in (("program_vae", 900.0), ("program_lm", 300.0))
    ),
    answer=_answer,
    options=_options,
)
