"""`make eval TABLE=shapeassembly_clouds`: programs of point clouds (shapeassembly §7.3, Table 7, figure 13)."""

from __future__ import annotations

from pydantic import Field

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, TableResult
from eval.engine.requirements import PROGRAMS, trained
from pipeline.config import StrictModel
from stages.shapeassembly.settings import DEFAULT_TOP_P

LATENT_KINDS = ("program_vae", "part_graph_vae")
DENSITY_FACTOR = 8
"""Points of the surface, for F1, per point of a cloud."""
CLOUDS_SHOWN = 5


class ShapeassemblyCloudsOptions(StrictModel):
    """Which clouds are reconstructed, and how."""

    categories: tuple[str, ...] = Field(("chair",), description="categories of the clouds")
    clouds: int = Field(60, ge=1, description="clouds of each category")
    training_programs: int = Field(10_000, ge=1, description="programs at most that encoders are trained on")
    descent_steps: int = Field(200, ge=0, description="steps of each fit")
    top_p: float = Field(DEFAULT_TOP_P, gt=0, le=1, description="as shapeassembly.sampled.top_p")


def _compute(run: DatasetRun, options: ShapeassemblyCloudsOptions) -> TableResult:
    from eval.engine.pictures import cloud_portrait
    from eval.programs.cloud_reconstruction import (
        ReconstructedShapes,
        cloud_descriptors,
        clouds_table,
        reconstructions,
        train_cloud_encoder,
    )
    from eval.programs.figures import boxes_portrait, picture_figure
    from eval.programs.models import ablation_of, commonly_readable_programs, program_models
    from eval.programs.quality import boxes_of_programs, clouds_of
    from eval.programs.two_sample_test import POINTS_PER_CLOUD
    from pipeline.randomness import decision_rng
    from stages.shapeassembly.execution.interpreter import execute_all
    from stages.training.part_graph_vae.trained import TrainedPartGraphVae

    models = [
        model
        for model in program_models(run, options.top_p)
        if ablation_of(model) == "nothing" and model.model.header["kind"] in LATENT_KINDS
    ]
    rows: dict[str, ReconstructedShapes] = {}
    figures = []
    for category in sorted({model.kit for model in models} & set(options.categories)):
        rng = decision_rng(run.config.seed, "shapeassembly_clouds", category)
        train = commonly_readable_programs(run, category, "train", options.training_programs, rng)
        val = commonly_readable_programs(run, category, "val", options.clouds, rng)
        descriptors = cloud_descriptors(clouds_of(boxes_of_programs(train), POINTS_PER_CLOUD))
        dense = clouds_of(boxes_of_programs(val), DENSITY_FACTOR * POINTS_PER_CLOUD)
        clouds = dense[:, ::DENSITY_FACTOR]
        targets = cloud_descriptors(clouds)
        shown = [[("input points", cloud_portrait(cloud))] for cloud in clouds[:CLOUDS_SHOWN]]
        for model in models:
            if model.kit != category:
                continue
            inputs = execute_all(train) if isinstance(model.model, TrainedPartGraphVae) else train
            encoder = train_cloud_encoder(descriptors, model.model.encode(inputs), run.config.seed)
            for number, (point, cloud) in enumerate(zip(encoder(targets), clouds, strict=True)):
                for suffix, boxes in reconstructions(model.model, point, cloud, rng, options.descent_steps):
                    name = f"{model.folder}{suffix}"
                    row = rows.setdefault(name, ReconstructedShapes([], []))
                    row.boxes.append(boxes)
                    row.clouds.append(dense[number])
                    if number < CLOUDS_SHOWN:
                        shown[number].append((name, boxes_portrait(boxes)))
        title = f"Figure 13, {category}: from clouds to cuboids and programs, random shapes"
        of_clouds = {f"{number}.": row for number, row in enumerate(shown, 1)}
        figures.append(picture_figure(f"figure13_{category}", title, of_clouds))
    return TableResult([clouds_table(rows)], figures=figures)


TABLE = Evaluation(
    question="Which programs do models find for point clouds, and how close do fits of cuboids or programs come?",
    requirements=(trained("model of programs or of their cuboids with a latent space", *LATENT_KINDS), PROGRAMS),
    estimate_seconds=lambda run: 1200.0,
    compute=_compute,
    options=ShapeassemblyCloudsOptions,
)
