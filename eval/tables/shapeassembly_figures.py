"""`make eval TABLE=shapeassembly_figures`: generated ShapeAssembly programs in pictures (shapeassembly §7, figures 7
to 12)."""

from __future__ import annotations

from pydantic import Field

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, Figure, TableResult
from eval.engine.requirements import PROGRAM_MODELS, PROGRAMS
from pipeline.config import StrictModel
from stages.shapeassembly.settings import DEFAULT_TOP_P
from stages.training.checkpoint import weights_of_kind

CURVE_CATEGORIES = ("chair", "table")
"""Categories with the name of a curve program, on whose parts surfaces are trained."""

SECONDS_PER_MODEL = {"program_vae": 90.0, "program_lm": 60.0, "cuboid_rnn": 20.0, "part_graph_vae": 30.0}


class ShapeassemblyFiguresOptions(StrictModel):
    """How much is shown."""

    curve_shapes: int = Field(100, ge=1, description="curve shapes on whose parts surfaces are trained")
    surface_steps: int = Field(1000, ge=0, description="training steps of surfaces")
    shown: int = Field(6, ge=1, description="samples of each model in a figure")
    pairs: int = Field(3, ge=1, description="pairs of shapes for interpolation")
    temperature: float = Field(1.0, gt=0, description="as shapeassembly.sampled.temperature")
    top_p: float = Field(DEFAULT_TOP_P, gt=0, le=1, description="as shapeassembly.sampled.top_p")


def _compute(run: DatasetRun, options: ShapeassemblyFiguresOptions) -> TableResult:
    from eval.programs.figures import (
        edits_figure,
        interpolation_figure,
        neighbours_figure,
        neighbours_table,
        samples_figure,
    )
    from eval.programs.models import (
        PROGRAM_KINDS,
        ablation_of,
        commonly_readable_programs,
        program_models,
        read_category_programs,
    )
    from eval.programs.part_surfaces import curve_parts, surfaces_figure, train_surfaces
    from eval.programs.quality import boxes_of_programs, clouds_of
    from eval.programs.structure_clusters import clusters
    from pipeline.randomness import decision_rng
    from stages.training.part_graph_vae.trained import TrainedPartGraphVae
    from stages.training.program_vae.trained import TrainedProgramVae

    models = [model for model in program_models(run, options.top_p) if ablation_of(model) == "nothing"]
    seed = run.config.seed
    figures: list[Figure] = []
    rows = []
    by_category = {kit: read_category_programs(run, kit, "train") for kit in sorted({model.kit for model in models})}
    for category, train in by_category.items():
        clouds = clouds_of(boxes_of_programs(train))
        rng = decision_rng(seed, "shapeassembly_figures", category)
        surfaces = None
        if category in CURVE_CATEGORIES:
            surfaces = train_surfaces(curve_parts(category, options.curve_shapes, rng), options.surface_steps, seed)
        samples = {}
        of_category = [model for model in models if model.kit == category]
        for model in of_category:
            rng = decision_rng(seed, "shapeassembly_figures", model.folder)
            try:
                generated, _ = model.model.sample(options.shown, rng, options.temperature)
            except ValueError:
                continue  # it generates almost nothing, which TABLE=shapeassembly reports
            if model.model.header["kind"] in PROGRAM_KINDS:
                figure, row = neighbours_figure(model.folder, category, generated, train, clouds)
                rows.append(row)
                figures += [figure, edits_figure(model.folder, category, generated, rng)]
                generated = boxes_of_programs(generated)
                if surfaces is not None:
                    figures.append(surfaces_figure(model.folder, category, surfaces, generated, rng))
            samples[model.folder] = generated
        if samples:
            figures.append(samples_figure(category, samples))
        latent = [model for model in of_category if isinstance(model.model, TrainedProgramVae | TrainedPartGraphVae)]
        if latent:
            rng = decision_rng(seed, "shapeassembly_figures", category)
            ends = commonly_readable_programs(run, category, "val", 2 * options.pairs, rng)
            pairs = list(zip(ends[::2], ends[1::2], strict=False))
            figures.append(interpolation_figure(category, latent, pairs))
    clusters_table, charts = clusters(by_category)
    return TableResult([neighbours_table(rows), clusters_table], charts, figures=sorted(figures, key=_number))


def _number(figure: Figure) -> int:
    """Return the number of the figure in the paper."""
    return int(figure.name.partition("_")[0].removeprefix("figure"))


TABLE = Evaluation(
    question="What do generated programs look like, compared with their nearest training shapes?",
    requirements=(PROGRAM_MODELS, PROGRAMS),
    estimate_seconds=lambda run: sum(
        seconds * len(weights_of_kind(run.models, kind)) for kind, seconds in SECONDS_PER_MODEL.items()
    ),
    compute=_compute,
    options=ShapeassemblyFiguresOptions,
)
