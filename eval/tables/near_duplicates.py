"""`make eval TABLE=near_duplicates`: do shapes leak between splits?"""

from __future__ import annotations

from collections.abc import Sequence

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Chart, Evaluation, ImageRow, NoOptions, TableResult
from eval.engine.requirements import FINISHED_DATASET

PAIRS_SHOWN = 3


def _compute(run: DatasetRun, _: NoOptions) -> TableResult:
    from eval.dataset.near_duplicates import dataset_clouds, near_duplicates_table, nearest_by_split
    from eval.engine.pictures import cloud_picture

    clouds = dataset_clouds(run.folder, run.config.seed)
    nearest = nearest_by_split(clouds)
    lines = {
        f"{kit}, {split}": _cumulative([shape.distance for shape in shapes]) for (kit, split), shapes in nearest.items()
    }
    pairs = sorted(
        (shape.distance, kit, split, index, shape.index)
        for (kit, split), shapes in nearest.items()
        for index, shape in enumerate(shapes)
    )[:PAIRS_SHOWN]
    pictures = []
    for distance, kit, split, index, train_index in pairs:
        pictures.append((f"{kit}, {split}, at {distance:.2f}", cloud_picture(clouds[kit, split][index][0])))
        pictures.append((f"nearest in {kit}, train", cloud_picture(clouds[kit, "train"][train_index][0])))
    return TableResult(
        [near_duplicates_table(nearest)],
        [Chart("Distance to the nearest training shape", "resampling distances", "% of shapes, cumulative", lines)],
        [ImageRow("The nearest pairs, as clouds", pictures)] if pictures else [],
    )


def _cumulative(distances: Sequence[float]) -> list[tuple[float, float]]:
    """Return, at each distance, the percentage of distances up to it."""
    count = len(distances)
    return [(distance, 100 * number / count) for number, distance in enumerate(sorted(distances), 1)]


TABLE = Evaluation(
    question="How many validation and test shapes are near-duplicates of training shapes?",
    requirements=(FINISHED_DATASET,),
    estimate_seconds=lambda run: 10 + 0.05 * run.samples,
    compute=_compute,
)
