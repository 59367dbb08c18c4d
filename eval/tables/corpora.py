"""`make eval TABLE=corpora`: how long are the strings that a model has to learn? (strings §7)"""

from __future__ import annotations

from typing import get_args

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, NoOptions, TableResult
from eval.engine.requirements import KITS

MAX_VARIANTS = 100
"""Variants of a kit that are measured."""


def _compute(run: DatasetRun, _: NoOptions) -> TableResult:
    from eval.strings.corpora import corpora_table, corpus_row
    from eval.strings.growth import read_kept_variants
    from pipeline.randomness import decision_rng
    from stages.exemplars.language import dataset_kits
    from stages.strings.settings import Edges

    folder = run.paths.stage("variations").root
    rows = []
    for name, kit in dataset_kits(run.paths).items():
        variants = read_kept_variants(folder, name)
        step = -(-len(variants) // MAX_VARIANTS) or 1
        groups = {
            f"{name}, inputs": [exemplar.assembly for exemplar in kit.exemplars],
            f"{name}, variants": [variant.assembly for variant in variants[::step]],
        }
        for group, shapes in groups.items():
            for edges in get_args(Edges) if shapes else ():
                rng = decision_rng(run.config.seed, "corpora", group, edges)
                rows.append(corpus_row(group, kit, shapes, edges, rng))
    return TableResult([corpora_table(rows)])


TABLE = Evaluation(
    question="How many tokens and cycles do strings have with all contacts, with faces only, or with a spanning tree?",
    requirements=(KITS,),
    estimate_seconds=lambda run: 20,
    compute=_compute,
)
