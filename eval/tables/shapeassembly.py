"""`make eval TABLE=shapeassembly`: what models write ShapeAssembly programs like (shapeassembly §7, Tables 2 to 6)."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import groupby
from typing import TYPE_CHECKING, Any

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Chart, Evaluation, ImageRow, TableResult
from eval.engine.models import TrainedModel, training_curve
from eval.engine.requirements import PROGRAM_WRITERS, PROGRAMS
from eval.engine.results_cache import TableSection, cached_sections
from stages.shapeassembly.settings import DEFAULT_TOP_P
from stages.training.checkpoint import weights_of_kind

if TYPE_CHECKING:
    import numpy as np

    from eval.engine.table import Table
    from eval.programs.reference import Reference
    from stages.shapeassembly.extraction.hierarchy import Box
    from stages.shapeassembly.syntax.program import AssemblyProgram

SHOWN = 16
SECONDS = {"program_vae": 900.0, "program_lm": 300.0, "cuboid_rnn": 120.0, "part_graph_vae": 120.0}


def _parts(subject: DatasetRun, asked: Namespace) -> Iterator[TableSection]:
    """One for each model, and one for the shapes of val of each category; what a category's share is read once."""
    from eval.programs.models import program_models, program_shards
    from eval.programs.reference import read_reference
    from stages.training.recovery.trained import PRETRAINED_FOLDER

    reads = [*program_shards(subject, "train"), *program_shards(subject, "val")]
    reads += weights_of_kind(PRETRAINED_FOLDER, "recovery")  # one of them is the network whose features are compared
    reference = lru_cache(1)(partial(read_reference, subject, judged=asked.judged))
    for category, models in groupby(program_models(subject, asked.top_p), key=lambda each: each.kit):
        for each in models:
            folder = subject.models / each.folder
            of_model = partial(_of_model, subject, asked, each, reference)
            yield TableSection(each.folder, [folder / "weights.safetensors", folder / "curves.csv", *reads], of_model)
        yield TableSection(f"{category}, val", reads, partial(_of_val, subject, asked, category, reference))


def _of_model(
    subject: DatasetRun, asked: Namespace, trained: TrainedModel[Any], reference: Callable[[str], Reference]
) -> TableResult:
    from eval.programs.models import told_without
    from eval.programs.quality import smoothness
    from eval.programs.tables import quality_table, smoothness_table
    from pipeline.randomness import decision_rng
    from stages.training.part_graph_vae.trained import TrainedPartGraphVae
    from stages.training.program_vae.trained import TrainedProgramVae

    rng = decision_rng(subject.config.seed, "shapeassembly", trained.folder)
    learning = {trained.folder: training_curve(subject.models / trained.folder, "val_loss")}
    curve = Chart("How well shapes that were not learnt are written", "steps of training", "loss", learning)
    rows, silent = _written(trained, asked, rng)
    if not rows:
        return TableResult([quality_table({}, {}, {}, silent)], [curve])
    # What is told in another way is new whatever it is.
    whole = told_without(trained) == "nothing"
    tables = _tables(rows, reference(trained.kit), subject.config.seed, silent, novel=whole)
    if isinstance(trained.model, TrainedProgramVae | TrainedPartGraphVae) and whole:
        tables.append(smoothness_table({trained.folder: smoothness(trained.model, asked.sequences, asked.steps, rng)}))
    strips = [ImageRow(f"Samples of {row.name}", _pictures(row.samples[:SHOWN])) for row in rows]
    return TableResult(tables, [curve], strips)


def _of_val(subject: DatasetRun, asked: Namespace, category: str, reference: Callable[[str], Reference]) -> TableResult:
    from eval.programs.quality import boxes_of_programs

    programs = reference(category).val[: asked.samples]
    row = Written(f"{category}, val", boxes_of_programs(programs), programs, of_val=True)
    return TableResult(_tables([row], reference(category), subject.config.seed, {}, novel=True))


def _tables(
    rows: Sequence[Written], reference: Reference, seed: int, silent: Mapping[str, str], *, novel: bool
) -> list[Table]:
    """The tables of shapes; silent: which models write nothing, and why; novel: whether structures that train has not
    are counted."""
    from eval.programs.quality import clouds_of, novelty, physics_of, variability
    from eval.programs.tables import editability_table, quality_table, variability_table
    from eval.programs.two_sample_test import POINTS, Realism, realism

    seen: dict[str, Realism] = {}
    for row in rows:
        if judged := min(len(row.samples), len(reference.shown)):
            clouds, features = clouds_of(row.samples[:judged], POINTS), reference.features
            real = reference.shown[:judged], None if features is None else features[:judged]
            seen[row.name] = realism(clouds, *real, seed)
    varied = {
        row.name: variability(row.samples, reference.learnt, None if row.of_val else reference.unseen) for row in rows
    }
    told = {row.name: row.programs for row in rows if row.programs}
    rejected = {row.name: 100 * (1 - len(row.samples) / row.begun) for row in rows if row.begun}
    new = {name: novelty(programs, reference.train) for name, programs in told.items()} if novel else {}
    return [
        quality_table({row.name: physics_of(row.samples) for row in rows}, seen, rejected, silent),
        editability_table(told),
        variability_table(varied, new),
    ]


@dataclass(frozen=True)
class Written:
    """What a row of the tables is about: the cuboids of each shape, and the programs that made them, if any. begun: how
    many were begun, or 0 where none is given up; of_val: whether they are the shapes of val themselves."""

    name: str
    samples: Sequence[Sequence[Box]]
    programs: Sequence[AssemblyProgram] = ()
    begun: int = 0
    of_val: bool = False


def _written(
    trained: TrainedModel[Any], asked: Namespace, rng: np.random.Generator
) -> tuple[list[Written], dict[str, str]]:
    """What a model writes; and, of one of whole programs, what it writes where nothing is rejected. Beside it why one
    that writes next to nothing is silent, by name."""
    from eval.programs.models import PROGRAM_KINDS, told_without
    from eval.programs.quality import boxes_of_programs, unrejected
    from stages.training.program_vae.trained import TrainedProgramVae

    rows: list[Written] = []
    silent: dict[str, str] = {}
    without = told_without(trained)
    try:
        found, begun = trained.model.sample(asked.samples, rng, asked.temperature)
    except ValueError as error:
        silent[trained.folder] = str(error)
    else:
        if trained.model.header["kind"] in PROGRAM_KINDS:
            name = trained.folder if without == "nothing" else f"{trained.folder}, without {without}"
            rows.append(Written(name, boxes_of_programs(found), found, begun))
        else:
            rows.append(Written(trained.folder, found, begun=begun))
    if isinstance(trained.model, TrainedProgramVae) and without == "nothing":
        name = f"{trained.folder}, no reject"
        try:
            programs = unrejected(trained.model, asked.samples, rng, asked.temperature)
        except ValueError as error:
            silent[name] = str(error)
        else:
            rows.append(Written(name, boxes_of_programs(programs), programs))
    return rows, silent


def _pictures(samples: Sequence[Sequence[Box]]) -> list[tuple[str, bytes]]:
    from eval.engine.pictures import shape_picture
    from eval.programs.quality import shape_of_boxes

    return [("", shape_picture(shape_of_boxes(boxes))) for boxes in samples]


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("--samples", type=int, default=1000, help="programs that each model writes")
    parser.add_argument(
        "--judged",
        type=int,
        default=1000,
        help="of these, how many networks look at, for fool and FD, which takes longest",
    )
    parser.add_argument("--temperature", type=float, default=1.0, help="as in shapeassembly.sampled")
    parser.add_argument("--top_p", type=float, default=DEFAULT_TOP_P, help="as in shapeassembly.sampled")
    parser.add_argument("--sequences", type=int, default=100, help="straight ways in the latent space of each model")
    parser.add_argument("--steps", type=int, default=100, help="points of each way")


TABLE = Evaluation(
    question="Do shapes stand whose programs or cuboids a model writes, how much do they vary, can programs be edited?",
    needs=(PROGRAM_WRITERS, PROGRAMS),
    seconds=lambda subject: sum(each * len(weights_of_kind(subject.models, kind)) for kind, each in SECONDS.items()),
    answer=cached_sections(_parts, _options),
    options=_options,
)
