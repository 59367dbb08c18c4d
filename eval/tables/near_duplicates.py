"""`make eval TABLE=near_duplicates`: are the splits apart?"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Chart, Evaluation, ImageRow, TableResult
from eval.engine.requirements import FINISHED_DATASET

SHOWN = 3
"""So many pairs of nearest shapes are drawn."""


def _answer(subject: DatasetRun, _: Namespace) -> TableResult:
    from eval.dataset.near_duplicates import dataset_clouds, near_twins_table, nearest_by_split
    from eval.engine.pictures import cloud_picture

    clouds = dataset_clouds(subject.folder, subject.config.seed)
    found = nearest_by_split(clouds)
    lines = {f"{kit}, {split}": _rising([each.distance for each in near]) for (kit, split), near in found.items()}
    pairs = sorted(
        (each.distance, kit, split, place, each.place)
        for (kit, split), nearest in found.items()
        for place, each in enumerate(nearest)
    )[:SHOWN]
    pictures = []
    for distance, kit, split, place, there in pairs:
        pictures.append((f"{kit}, {split}, at {distance:.2f}", cloud_picture(clouds[kit, split][place][0])))
        pictures.append((f"nearest in {kit}, train", cloud_picture(clouds[kit, "train"][there][0])))
    return TableResult(
        [near_twins_table(found)],
        [Chart("How far the nearest of train is", "resampling distances", "% of shapes at most so far", lines)],
        [ImageRow("The nearest pairs, as clouds", pictures)] if pictures else [],
    )


def _rising(distances: Sequence[float]) -> list[tuple[float, float]]:
    """The share of distances, in percent, that are at most so large, at each of them."""
    count = len(distances)
    return [(each, 100 * (place + 1) / count) for place, each in enumerate(sorted(distances))]


TABLE = Evaluation(
    question="How many shapes of val and test are as near to train as two samplings of one shape?",
    needs=(FINISHED_DATASET,),
    seconds=lambda subject: 10 + 0.05 * subject.samples,
    answer=_answer,
)
