"""`make eval TABLE=compression`: how few bytes does a shape take as string and categories? (strings §7)"""

from __future__ import annotations

import json
from argparse import Namespace

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, ImageRow, TableResult
from eval.engine.requirements import FINISHED_DATASET, KITS
from stages.strings.settings import Edges

EDGES: tuple[Edges, ...] = ("all", "tree")


def _answer(subject: DatasetRun, _: Namespace) -> TableResult:
    from eval.engine.pictures import shape_picture
    from eval.strings.compression import Stored, compression_row, compression_table, round_trip
    from pipeline.shards import read_shard
    from stages.exemplars.language import LANGUAGE, dataset_kits
    from stages.shape.collection.pairs import CONTACTS, pairs_of
    from stages.shape.shape import Shape
    from stages.strings.compression import Codebook

    anew, samples = LANGUAGE.rebuild(subject.paths), dict[str, list[Stored]]()
    for shard in sorted((subject.folder / "data").glob("*/*.tar")):
        for _key, members in read_shard(shard):
            record = json.loads(members["json"])
            shape = anew(record, pairs_of(members[CONTACTS]))
            if not shape.is_stretched:
                samples.setdefault(record["kit"], []).append(Stored(shape.assembly, members["json"], members["glb"]))
    rows, pictures = [], []
    for name, kit in dataset_kits(subject.paths).items():
        stored = samples.get(name, [])
        for edges in EDGES if stored else ():
            book = Codebook(kit, edges)
            trips = [round_trip(book, each.assembly) for each in stored]
            rows.append(compression_row(name, kit, edges, stored, trips))
        if stored:
            ranked = sorted(trips, key=lambda trip: (len(trip.packed), trip.text))
            for trip in (ranked[0], ranked[len(ranked) // 2], ranked[-1]):
                shape = Shape(kit.types, trip.restored, "y", kit.labels)
                pictures.append(
                    (f"{name}, {len(trip.restored)} parts of {len(trip.packed)} bytes", shape_picture(shape))
                )
    strip = ImageRow("The smallest, the median and the largest of each kit, restored from their bytes", pictures)
    return TableResult([compression_table(rows)], strips=[strip])


TABLE = Evaluation(
    question="How few bytes does a shape take as string and categories, and does it come back exactly?",
    needs=(FINISHED_DATASET, KITS),
    seconds=lambda subject: 10 + 0.025 * subject.samples,
    answer=_answer,
)
