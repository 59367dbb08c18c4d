"""`make eval TABLE=categories`: how well is it read from a string where its parts stand? (strings §6)"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Chart, Evaluation, ImageRow, TableResult
from eval.engine.requirements import EDGE_CATEGORIES, KITS
from stages.training.checkpoint import weights_of_kind

DRAWS = 3
"""How often each graph is put together by chance, to see what it leaves open."""
SHOWN = 3
"""So many shapes are drawn beside what was read of them."""


def _answer(subject: DatasetRun, asked: Namespace) -> TableResult:
    from itertools import islice

    from eval.engine.models import training_curve
    from eval.engine.pictures import shape_picture
    from eval.generated.edge_categories import (
        categories_table,
        category_models,
        clusters_table,
        judge,
        made_shapes,
        read_back,
    )
    from eval.generated.instantiation import instantiator_of
    from eval.generated.pose_clusters import clusters_of
    from eval.strings.ambiguity import ambiguity, ambiguity_table
    from pipeline.randomness import decision_rng
    from stages.exemplars.language import dataset_kits
    from stages.shape.shape import kit_shape
    from stages.strings.categories import CategorySpace
    from stages.strings.kit_strings import KitStrings
    from stages.strings.settings import StringsConfig

    kits = dataset_kits(subject.paths)
    edges = subject.config.section(StringsConfig).edges
    writers = {name: KitStrings(kit, edges) for name, kit in kits.items()}
    judged, clusters, open_graphs, lines, strips = [], [], [], {}, []
    for each in category_models(subject.models, kits):
        for split in ("val", "test"):
            rng = decision_rng(subject.config.seed, "eval", "categories", each.kit, split)
            shapes = islice(made_shapes(subject, each.kit, split), asked.graphs)
            judged.append((each, split, judge(each.model, writers[each.kit], shapes, asked.voters, rng)))
        pictures = []
        for number, shape in enumerate(islice(made_shapes(subject, each.kit, "test"), SHOWN)):
            rng = decision_rng(subject.config.seed, "eval", "categories", each.kit, "shown", number)
            found = read_back(each.model, writers[each.kit], shape, asked.voters, rng)
            pictures.append((f"{each.kit}, {len(shape)} parts", shape_picture(kit_shape(kits[each.kit], shape))))
            if found is not None:
                pictures.append((f"as {each.folder} reads it", shape_picture(kit_shape(kits[each.kit], found))))
        strips.append(ImageRow(f"Shapes of test, and what {each.folder} reads from their strings", pictures))
        lines[each.folder] = [
            (step, 100 * share) for step, share in training_curve(subject.models / each.folder, "val_tokens")
        ]
    for name in dict.fromkeys(each.kit for each, _, _ in judged):
        learnt = list(islice(made_shapes(subject, name, "train"), asked.graphs))
        clusters.append((name, len(learnt), clusters_of(CategorySpace(kits[name]), learnt)))
        rng = decision_rng(subject.config.seed, "eval", "categories", name, "ambiguity")
        unseen = islice(made_shapes(subject, name, "test"), asked.graphs)
        maker = instantiator_of(subject, kits[name])
        open_graphs.append((name, ambiguity(maker, writers[name], unseen, DRAWS, rng)))
    return TableResult(
        [categories_table(judged), ambiguity_table(open_graphs), clusters_table(clusters)],
        [Chart("Tokens with the right category, each after the right ones before it", "steps", "% of val", lines)],
        strips,
    )


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("--graphs", type=int, default=100, help="shapes of a kit and split that are looked at")
    parser.add_argument("--voters", type=int, default=7, help="strings of a shape beside its canonical one")


TABLE = Evaluation(
    question="How often is it read from a string where each of its parts stands, and does it help to ask several?",
    needs=(KITS, EDGE_CATEGORIES),
    seconds=lambda subject: 5 + 110.0 * len(weights_of_kind(subject.models, "edge_categories")),
    answer=_answer,
    options=_options,
)
