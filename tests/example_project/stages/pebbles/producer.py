"""What stage `pebbles` says of itself."""

from __future__ import annotations

from stages.pebbles.stage import PebblesConfig
from stages.shape.collection.members import RecordField
from stages.shape.collection.producer import Producer

PRODUCER = Producer(
    language="heap",
    keys="pebbles.heaps",
    is_requested=lambda config: config.section(PebblesConfig).heaps > 0,
    sentence=lambda _: "pebbles are thrown on a heap.",
    splits=lambda _: "Every heap is thrown separately.",
    graphs_share_split=lambda _: False,
    lineage=lambda _: {"drawn": RecordField({"type": "integer", "minimum": 0, "description": "which throw it was"})},
    card=lambda _: ["No pebble was harmed."],
)
