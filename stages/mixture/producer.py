"""Stage `mixture` as a producer of samples: it joins those of all others."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.config import Config
from stages.mixture.settings import MixtureConfig
from stages.shape.collection.members import RecordField
from stages.shape.collection.producer import Producer


def _lineage(_: Config) -> Mapping[str, RecordField]:
    text = "what else its producer says of it, as JSON; the fields are those of a dataset of this producer alone"
    return {"details": RecordField({"type": "string", "minLength": 2, "description": text})}


PRODUCER = Producer(
    language="mixture",
    keys="mixture",
    is_requested=lambda config: config.section(MixtureConfig).enabled,
    sentence=lambda _: "",
    splits=lambda _: (
        "A sample keeps the split that its producer gave it. Samples of two producers share a split if they are of "
        "one kit and have equal shape graphs, or if their surfaces are as near to each other as two point clouds of "
        "one surface are, up to size, position and quarter turns; those that would be in two splits are left out."
    ),
    graphs_share_split=lambda _: False,
    joins=True,
    lineage=_lineage,
)
