"""`make eval TABLE=categories`: how well are the poses of parts predicted from a string? (strings §6)"""

from __future__ import annotations

from pydantic import Field

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Chart, Evaluation, ImageRow, TableResult
from eval.engine.requirements import EDGE_CATEGORIES, KITS
from pipeline.config import StrictModel
from stages.training.checkpoint import weights_of_kind

DRAWS_PER_GRAPH = 3
"""Random instantiations of each graph that measure its ambiguity."""
SHAPES_SHOWN = 3


class CategoriesOptions(StrictModel):
    """How many shapes and strings are measured."""

    graphs: int = Field(100, ge=1, description="shapes of each kit and split")
    voters: int = Field(7, ge=0, description="random strings of each shape, besides its canonical one")


def _compute(run: DatasetRun, options: CategoriesOptions) -> TableResult:
    from itertools import islice

    from eval.engine.models import training_curve
    from eval.engine.pictures import rendered_png
    from eval.generated.edge_categories import (
        categories_table,
        category_models,
        clusters_table,
        reconstruct_shape,
        score_model,
        split_assemblies,
    )
    from eval.generated.instantiation import instantiator_of
    from eval.generated.pose_clusters import cluster_poses
    from eval.strings.ambiguity import ambiguity, ambiguity_table
    from pipeline.randomness import decision_rng
    from stages.exemplars.language import dataset_kits
    from stages.shape.shape import kit_shape
    from stages.strings.categories import CategorySpace
    from stages.strings.kit_strings import KitStrings
    from stages.strings.settings import StringsConfig

    kits = dataset_kits(run.paths)
    edges = run.config.section(StringsConfig).edges
    writers = {name: KitStrings(kit, edges) for name, kit in kits.items()}
    scores, clusters, ambiguities, lines, image_rows = [], [], [], {}, []
    for trained in category_models(run.models, kits):
        kit, writer = trained.kit, writers[trained.kit]
        for split in ("val", "test"):
            rng = decision_rng(run.config.seed, "eval", "categories", kit, split)
            shapes = islice(split_assemblies(run, kit, split), options.graphs)
            scores.append((trained, split, score_model(trained.model, writer, shapes, options.voters, rng)))
        pictures = []
        for number, shape in enumerate(islice(split_assemblies(run, kit, "test"), SHAPES_SHOWN)):
            rng = decision_rng(run.config.seed, "eval", "categories", kit, "shown", number)
            predicted = reconstruct_shape(trained.model, writer, shape, options.voters, rng)
            pictures.append((f"{kit}, {len(shape)} parts", rendered_png(kit_shape(kits[kit], shape))))
            if predicted is not None:
                pictures.append((f"as predicted by {trained.folder}", rendered_png(kit_shape(kits[kit], predicted))))
        image_rows.append(ImageRow(f"Test shapes, and what {trained.folder} predicts from their strings", pictures))
        curve = training_curve(run.models / trained.folder, "val_tokens")
        lines[trained.folder] = [(step, 100 * share) for step, share in curve]
    for name in dict.fromkeys(trained.kit for trained, _, _ in scores):
        train = list(islice(split_assemblies(run, name, "train"), options.graphs))
        clusters.append((name, len(train), cluster_poses(CategorySpace(kits[name]), train)))
        rng = decision_rng(run.config.seed, "eval", "categories", name, "ambiguity")
        test = islice(split_assemblies(run, name, "test"), options.graphs)
        instantiator = instantiator_of(run, kits[name])
        ambiguities.append((name, ambiguity(instantiator, writers[name], test, DRAWS_PER_GRAPH, rng)))
    return TableResult(
        [categories_table(scores), ambiguity_table(ambiguities), clusters_table(clusters)],
        [Chart("Validation tokens with the right category, given the true ones before them", "steps", "%", lines)],
        image_rows,
    )


TABLE = Evaluation(
    question="How often are the poses of parts predicted right from a string, and does a vote of several strings help?",
    requirements=(KITS, EDGE_CATEGORIES),
    estimate_seconds=lambda run: 5 + 110.0 * len(weights_of_kind(run.models, "edge_categories")),
    compute=_compute,
    options=CategoriesOptions,
)
