"""`make eval TABLE=compression`: how few bytes does a shape take as a string with categories? (strings §7)"""

from __future__ import annotations

import json

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, ImageRow, NoOptions, TableResult
from eval.engine.requirements import FINISHED_DATASET, KITS
from stages.strings.settings import Edges

EDGES: tuple[Edges, ...] = ("all", "tree")


def _compute(run: DatasetRun, _: NoOptions) -> TableResult:
    from eval.engine.pictures import rendered_png
    from eval.strings.compression import StoredSample, compression_row, compression_table, round_trip
    from pipeline.shards import read_shard
    from stages.exemplars.language import LANGUAGE, dataset_kits
    from stages.shape.collection.pairs import CONTACTS, pairs_of
    from stages.shape.shape import Shape
    from stages.strings.compression import Codebook

    shape_of, samples = LANGUAGE.rebuild(run.paths), dict[str, list[StoredSample]]()
    for shard in sorted((run.folder / "data").glob("*/*.tar")):
        for _key, members in read_shard(shard):
            record = json.loads(members["json"])
            if record["language"] != LANGUAGE.name:
                continue
            shape = shape_of(record, pairs_of(members[CONTACTS]))
            if not shape.is_stretched:
                sample = StoredSample(shape.assembly, members["json"], members["glb"])
                samples.setdefault(record["kit"], []).append(sample)
    rows, pictures = [], []
    for name, kit in dataset_kits(run.paths).items():
        stored = samples.get(name, [])
        for edges in EDGES if stored else ():
            book = Codebook(kit, edges)
            trips = [round_trip(book, sample.assembly) for sample in stored]
            rows.append(compression_row(name, kit, edges, stored, trips))
        if stored:
            ranked = sorted(trips, key=lambda trip: (len(trip.packed), trip.text))
            for trip in (ranked[0], ranked[len(ranked) // 2], ranked[-1]):
                caption = f"{name}, {len(trip.restored)} parts from {len(trip.packed)} bytes"
                pictures.append((caption, rendered_png(Shape(kit.types, trip.restored, "y", kit.labels))))
    row = ImageRow("The smallest, median and largest shape of each kit, restored from its bytes", pictures)
    return TableResult([compression_table(rows)], image_rows=[row])


TABLE = Evaluation(
    question="How few bytes does a shape take as a string with categories, and is it restored exactly?",
    requirements=(FINISHED_DATASET, KITS),
    estimate_seconds=lambda run: 10 + 0.025 * run.samples,
    compute=_compute,
)
