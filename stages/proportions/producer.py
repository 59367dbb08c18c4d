"""Stage `proportions` as a producer of samples."""

from __future__ import annotations

from stages.exemplars.origins import exemplar_origins
from stages.exemplars.resolved_table import resolved_table
from stages.proportions.settings import ProportionsConfig
from stages.shape.collection.producer import Producer

PRODUCER = Producer(
    language="proportions",
    keys="proportions.samples_per_kit",
    is_requested=lambda config: config.section(ProportionsConfig).samples_per_kit > 0,
    sentence="exemplars are resized: along each axis the lengths between the ends of their parts are multiplied, equal "
    "lengths by equal factors. One map moves all of space, so parts that touch keep touching. Where the exemplars have "
    "rows, periods of these may be inserted or removed before. The `txt` of a shape holds its changes and its factors.",
    splits="No two samples are equal: at equal size some end of a part differs. All splits have shapes of the same "
    "exemplars. They measure generalisation to unseen sizes and, where there are 20 layouts of rows or more, to unseen "
    "lengths of rows: samples with equal shape graphs are then in one split.",
    graphs_share_split=False,
    origins=lambda plan: exemplar_origins(plan.config),
    card=resolved_table,
    limits=(
        "All shapes have the parts of an exemplar with the same contacts; only sizes and the lengths of rows differ.",
        "Round parts become oval, and slopes change.",
    ),
)
