"""`make eval TABLE=shapeassembly_clouds`: programs of point clouds (shapeassembly §7.3, Table 7, figure 13)."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, Requirement, TableResult
from eval.engine.requirements import PROGRAMS
from stages.training.checkpoint import weights_of_kind

KINDS = ("program_vae", "part_graph_vae")
DENSE = 8
"""So many times as many points as a cloud has say where its surface is, when F1 is measured."""
DRAWN = 5
"""Clouds that figure 13 shows."""


def _spaces(subject: DatasetRun) -> str:
    there = any(weights_of_kind(subject.models, kind) for kind in KINDS)
    return "" if there else f"no trained {' or '.join(KINDS)} in {subject.models}; make train"


def _answer(subject: DatasetRun, asked: Namespace) -> TableResult:
    from eval.engine.pictures import cloud_portrait
    from eval.programs.cloud_reconstruction import Rebuilt, clouds_table, described, reconstructions, trained_encoder
    from eval.programs.figures import drawn, sheet_of
    from eval.programs.models import program_models, read_by_all, told_without
    from eval.programs.quality import boxes_of_programs, clouds_of
    from eval.programs.two_sample_test import POINTS
    from pipeline.randomness import decision_rng
    from stages.shapeassembly.execution.interpreter import execute_all
    from stages.training.part_graph_vae.trained import TrainedPartGraphVae

    models = [each for each in program_models(subject, asked.top_p) if told_without(each) == "nothing"]
    models = [each for each in models if each.model.header["kind"] in KINDS]
    rows: dict[str, Rebuilt] = {}
    sheets = []
    for category in sorted({each.kit for each in models} & set(asked.categories.split(","))):
        rng = decision_rng(subject.config.seed, "shapeassembly_clouds", category)
        train = read_by_all(subject, category, "train", asked.learnt, rng)
        val = read_by_all(subject, category, "val", asked.clouds, rng)
        seen = described(clouds_of(boxes_of_programs(train), POINTS))
        dense = clouds_of(boxes_of_programs(val), DENSE * POINTS)
        clouds = dense[:, ::DENSE]
        targets = described(clouds)
        shown = [[("input points", cloud_portrait(cloud))] for cloud in clouds[:DRAWN]]
        for each in models:
            if each.kit != category:
                continue
            learnt = execute_all(train) if isinstance(each.model, TrainedPartGraphVae) else train
            places = trained_encoder(seen, each.model.encode(learnt), subject.config.seed)(targets)
            for number, (place, cloud) in enumerate(zip(places, clouds, strict=True)):
                for name, boxes in reconstructions(each.model, place, cloud, rng, asked.descent):
                    row = rows.setdefault(f"{each.folder}{name}", Rebuilt([], []))
                    row.boxes.append(boxes)
                    row.clouds.append(dense[number])
                    if number < DRAWN:
                        shown[number].append((f"{each.folder}{name}", drawn(boxes)))
        title = f"Figure 13, {category}: from clouds to cuboids and programs, shapes not chosen"
        sheets.append(sheet_of(f"figure13_{category}", title, {f"{n}.": row for n, row in enumerate(shown, 1)}))
    return TableResult([clouds_table(rows)], sheets=sheets)


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("--categories", default="chair", help="categories whose clouds are looked at, with commas")
    parser.add_argument("--clouds", type=int, default=60, help="clouds of each category")
    parser.add_argument(
        "--learnt", type=int, default=10_000, help="programs at most that encoders of clouds learn from"
    )
    parser.add_argument("--descent", type=int, default=200, help="steps of each fit")


TABLE = Evaluation(
    question="What programs do models find of point clouds, and how near do fits of cuboids or of programs come?",
    needs=(Requirement("a trained model of programs, or of their cuboids, with a latent space", _spaces), PROGRAMS),
    seconds=lambda subject: 1200.0,
    answer=_answer,
    options=_options,
)
