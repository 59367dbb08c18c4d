"""What stage `proportions` says of itself as a producer of samples."""

from __future__ import annotations

from stages.exemplars.origins import exemplar_origins
from stages.exemplars.resolved_table import resolved_table
from stages.proportions.settings import ProportionsConfig
from stages.shape.collection.producer import Producer

PRODUCER = Producer(
    language="proportions",
    keys="proportions.samples_per_kit",
    asked=lambda config: config.section(ProportionsConfig).samples_per_kit > 0,
    sentence="exemplars are made anew in other proportions: along each axis the lengths between the ends of their "
    "parts are multiplied, equal ones alike, by one map of all of space, so that what touches goes on touching; "
    "a shape's factors are its `txt`.",
    splits="No two samples are alike: at equal size some end of a part lies elsewhere. All splits have shapes of the "
    "same exemplars: they tell whether a model knows sizes that it has not seen, not layouts.",
    graphs_share_split=False,
    origins=lambda plan: exemplar_origins(plan.config),
    card=resolved_table,
    limits=(
        "All shapes have the parts of an exemplar, in the same order and with the same contacts; only sizes differ.",
        "What is round becomes oval, and what stands aslant leans otherwise.",
    ),
)
