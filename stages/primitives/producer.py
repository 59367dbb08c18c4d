"""Stage `primitives` as a producer of samples."""

from __future__ import annotations

from stages.primitives.settings import PrimitivesConfig
from stages.shape.collection.producer import Producer

PRODUCER = Producer(
    language="composition",
    keys="primitives.samples",
    is_requested=lambda config: config.section(PrimitivesConfig).samples > 0,
    sentence=lambda config: (
        "solids of random kinds and sizes are put together at random ("
        f"{', '.join(dict.fromkeys(config.section(PrimitivesConfig).compositions))}); the `txt` of a shape lists them."
    ),
    splits=lambda _: "Shapes of the same composition and the same kinds of solids in the same order are in one split.",
    graphs_share_split=lambda _: True,
    limits=lambda _: ("Part labels are kinds of solids, without a meaning.",),
)
