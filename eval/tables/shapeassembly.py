"""`make eval TABLE=shapeassembly`: what models write ShapeAssembly programs like (shapeassembly §7, Tables 2 to 6)."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from eval.evaluation import Answer, Curve, Evaluation, Strip
from eval.models import Trained, training_curve
from eval.needs import PROGRAM_WRITERS, PROGRAMS
from eval.subject import Subject
from stages.shapeassembly.settings import NUCLEUS
from stages.training.checkpoint import weights_of_kind

if TYPE_CHECKING:
    import numpy as np

    from stages.shapeassembly.extraction.hierarchy import Box
    from stages.shapeassembly.program import Program

__all__ = ["TABLE"]

SHOWN = 16
SECONDS = {"program_vae": 900.0, "program_lm": 300.0, "cuboid_rnn": 120.0, "part_graph_vae": 120.0}


def _answer(subject: Subject, asked: Namespace) -> Answer:
    from eval.program_models import category_programs, program_models, told_without
    from eval.program_tables import editability_table, quality_table, smoothness_table, variability_table
    from eval.programs import boxes_of_programs, clouds_of, novelty, physics_of, smoothness, variability
    from eval.realism import POINTS, realism
    from pipeline.randomness import decision_rng
    from stages.training.part_graph_vae.trained import TrainedPartGraphVae
    from stages.training.program_vae.trained import TrainedProgramVae

    quality, seen, told, varied, novel, rejected, smooth, curves, strips = {}, {}, {}, {}, {}, {}, {}, {}, []
    silent: dict[str, str] = {}
    category = ""
    for each in program_models(subject, asked.nucleus):
        if each.kit != category:  # thousands of programs: one category at a time
            category = each.kit
            train, val = (category_programs(subject, category, split) for split in ("train", "val"))
            learnt = boxes_of_programs(train)
            clouds = {"train": clouds_of(learnt), "val": clouds_of(boxes_of_programs(val))}
        rng = decision_rng(subject.config.seed, "shapeassembly", each.folder)
        without = told_without(each)
        curves[each.folder] = training_curve(subject.models / each.folder, "val_loss")
        try:
            rows = list(_written(each, asked, rng))
        except ValueError as error:
            silent[each.folder] = str(error)
            continue
        real = Written(f"{each.kit}, val", boxes_of_programs(val[: asked.samples]), val[: asked.samples])
        for row in (*rows, real):
            if row.name not in quality:
                count = len(row.samples)
                quality[row.name] = physics_of(row.samples)
                if judged := min(count, len(learnt), asked.judged):
                    shown = clouds_of(row.samples[:judged], POINTS), clouds_of(learnt[:judged], POINTS)
                    seen[row.name] = realism(*shown, subject.config.seed)
                varied[row.name] = variability(row.samples, clouds["train"], None if row is real else clouds["val"])
                if row.begun:
                    rejected[row.name] = 100 * (1 - count / row.begun)
                if row.programs:
                    told[row.name] = row.programs
                    # What is told in another way is new whatever it is.
                    if row is real or without == "nothing":
                        novel[row.name] = novelty(row.programs, train)
                if row is not real:
                    strips.append(Strip(f"Samples of {row.name}", _pictures(row.samples[:SHOWN])))
        if isinstance(each.model, TrainedProgramVae | TrainedPartGraphVae) and without == "nothing":
            smooth[each.folder] = smoothness(each.model, asked.sequences, asked.steps, rng)
    return Answer(
        [
            quality_table(quality, seen, rejected, silent),
            editability_table(told),
            variability_table(varied, novel),
            smoothness_table(smooth),
        ],
        [Curve("How well shapes that were not learnt are written", "steps of training", "loss", curves)],
        strips,
    )


@dataclass(frozen=True)
class Written:
    """What a row of the tables is about: the cuboids of each shape, and the programs that made them, if any. begun: how
    many were begun, or 0 where none is given up."""

    name: str
    samples: Sequence[Sequence[Box]]
    programs: Sequence[Program] = ()
    begun: int = 0


def _written(trained: Trained[Any], asked: Namespace, rng: np.random.Generator) -> Iterator[Written]:
    """What a model writes; and, of one of whole programs, what it writes where nothing is rejected. Raises ValueError
    for a model that writes next to nothing."""
    from eval.program_models import PROGRAM_KINDS, told_without
    from eval.programs import boxes_of_programs, unrejected
    from stages.training.program_vae.trained import TrainedProgramVae

    found, begun = trained.model.sample(asked.samples, rng, asked.temperature)
    if trained.model.header["kind"] not in PROGRAM_KINDS:
        yield Written(trained.folder, found, begun=begun)
        return
    without = told_without(trained)
    name = trained.folder if without == "nothing" else f"{trained.folder}, without {without}"
    yield Written(name, boxes_of_programs(found), found, begun)
    if isinstance(trained.model, TrainedProgramVae) and without == "nothing":
        programs = unrejected(trained.model, asked.samples, rng, asked.temperature)
        yield Written(f"{trained.folder}, no reject", boxes_of_programs(programs), programs)


def _pictures(samples: Sequence[Sequence[Box]]) -> list[tuple[str, bytes]]:
    from eval.pictures import shape_picture
    from eval.programs import shape_of_boxes

    return [("", shape_picture(shape_of_boxes(boxes))) for boxes in samples]


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("--samples", type=int, default=1000, help="programs that each model writes")
    parser.add_argument(
        "--judged",
        type=int,
        default=1000,
        help="of these, how many networks look at, for fool and FD, which takes longest",
    )
    parser.add_argument("--temperature", type=float, default=1.0, help="as in shapeassembly.written")
    parser.add_argument("--nucleus", type=float, default=NUCLEUS, help="as in shapeassembly.written")
    parser.add_argument("--sequences", type=int, default=100, help="straight ways in the latent space of each model")
    parser.add_argument("--steps", type=int, default=100, help="points of each way")


TABLE = Evaluation(
    question="Do shapes stand whose programs or cuboids a model writes, how much do they vary, can programs be edited?",
    needs=(PROGRAM_WRITERS, PROGRAMS),
    seconds=lambda subject: sum(each * len(weights_of_kind(subject.models, kind)) for kind, each in SECONDS.items()),
    answer=_answer,
    options=_options,
)
