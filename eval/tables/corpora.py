"""`make eval TABLE=corpora`: how long are the strings that a model would have to learn? (strings §7)"""

from __future__ import annotations

from argparse import Namespace
from typing import get_args

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, TableResult
from eval.engine.requirements import KITS

MOST = 100
"""So many variants of a kit are measured at most."""


def _answer(subject: DatasetRun, _: Namespace) -> TableResult:
    from eval.strings.corpora import corpora_table, corpus_row
    from eval.strings.growth import read_finds
    from pipeline.randomness import decision_rng
    from stages.exemplars.language import dataset_kits
    from stages.strings.settings import Edges

    folder = subject.paths.stage("variations").root
    rows = []
    for name, kit in dataset_kits(subject.paths).items():
        finds = read_finds(folder, name)
        groups = {
            f"{name}, inputs": [each.assembly for each in kit.exemplars],
            f"{name}, variants": [each.assembly for each in finds[:: -(-len(finds) // MOST) or 1]],
        }
        for group, shapes in groups.items():
            for edges in get_args(Edges) if shapes else ():
                rng = decision_rng(subject.config.seed, "corpora", group, edges)
                rows.append(corpus_row(group, kit, shapes, edges, rng))
    return TableResult([corpora_table(rows)])


TABLE = Evaluation(
    question="How many tokens and cycles do strings have, if they tell of all contacts, of faces, or of a tree?",
    needs=(KITS,),
    seconds=lambda subject: 20,
    answer=_answer,
)
