"""`make eval TABLE=shapeassembly_figures`: what models of ShapeAssembly programs write, in pictures (shapeassembly §7,
figures 7, 8, 9, 11 and 12)."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, Figure, TableResult
from eval.engine.requirements import PROGRAM_WRITERS, PROGRAMS
from stages.training.checkpoint import weights_of_kind

CURVES = ("chair", "table")
"""Categories that are called as a curve program is, from whose parts surfaces are learnt."""

SECONDS = {"program_vae": 90.0, "program_lm": 60.0, "cuboid_rnn": 20.0, "part_graph_vae": 30.0}


def _answer(subject: DatasetRun, asked: Namespace) -> TableResult:
    from eval.programs.figures import beside_sheet, edits_sheet, journey_sheet, neighbours, neighbours_table
    from eval.programs.models import PROGRAM_KINDS, category_programs, program_models, read_by_all, told_without
    from eval.programs.part_surfaces import curve_parts, surfaces_sheet, trained_surfaces
    from eval.programs.quality import boxes_of_programs, clouds_of
    from pipeline.randomness import decision_rng
    from stages.training.part_graph_vae.trained import TrainedPartGraphVae
    from stages.training.program_vae.trained import TrainedProgramVae

    models = [each for each in program_models(subject, asked.top_p) if told_without(each) == "nothing"]
    sheets: list[Figure] = []
    rows = []
    for category in sorted({each.kit for each in models}):
        train = category_programs(subject, category, "train")
        clouds = clouds_of(boxes_of_programs(train))
        rng = decision_rng(subject.config.seed, "shapeassembly_figures", category)
        surfaces = None
        if category in CURVES:
            surfaces = trained_surfaces(
                curve_parts(category, asked.curves, rng), asked.surface_steps, subject.config.seed
            )
        samples = {}
        for each in models:
            if each.kit != category:
                continue
            rng = decision_rng(subject.config.seed, "shapeassembly_figures", each.folder)
            try:
                found, _ = each.model.sample(asked.shown, rng, asked.temperature)
            except ValueError:
                continue  # it writes next to nothing, which TABLE=shapeassembly tells
            if each.model.header["kind"] in PROGRAM_KINDS:
                sheet, row = neighbours(each.folder, category, found, train, clouds)
                rows.append(row)
                sheets += [sheet, edits_sheet(each.folder, category, found, rng)]
                found = boxes_of_programs(found)
                if surfaces is not None:
                    sheets.append(surfaces_sheet(each.folder, category, surfaces, found, rng))
            samples[each.folder] = found
        if samples:
            sheets.append(beside_sheet(category, samples))
        spaces = [each for each in models if isinstance(each.model, TrainedProgramVae | TrainedPartGraphVae)]
        if spaces := [each for each in spaces if each.kit == category]:
            rng = decision_rng(subject.config.seed, "shapeassembly_figures", category)
            ends = read_by_all(subject, category, "val", 2 * asked.pairs, rng)
            sheets.append(journey_sheet(category, spaces, list(zip(ends[::2], ends[1::2], strict=False))))
    return TableResult([neighbours_table(rows)], sheets=sorted(sheets, key=_number))


def _number(sheet: Figure) -> int:
    """The number of the figure, as the paper counts."""
    return int(sheet.name.partition("_")[0].removeprefix("figure"))


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("--curves", type=int, default=100, help="curve shapes whose parts surfaces are learnt from")
    parser.add_argument("--surface-steps", type=int, default=1000, help="steps in which surfaces are learnt")
    parser.add_argument("--shown", type=int, default=6, help="samples of each model in a figure")
    parser.add_argument("--pairs", type=int, default=3, help="pairs of shapes between which models find ways")


TABLE = Evaluation(
    question="What do shapes look like whose programs or cuboids a model writes, beside those that it has learnt from?",
    needs=(PROGRAM_WRITERS, PROGRAMS),
    seconds=lambda subject: sum(each * len(weights_of_kind(subject.models, kind)) for kind, each in SECONDS.items()),
    answer=_answer,
    options=_options,
)
