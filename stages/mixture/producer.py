"""Stage `mixture` as a producer of samples: it joins those of all others."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from pipeline.config import Config
from pipeline.stage import Plan
from stages.mixture.contrast import (
    EDIT_KINDS,
    MAX_FALLING_DEGREES,
    MAX_PARTS_TRIED,
    MIN_STANDING_DEGREES,
    SHORTENED_SHARE,
    TIPS_OVER,
    UNSUPPORTED,
)
from stages.mixture.settings import MixtureConfig
from stages.shape.collection.members import RecordField, object_schema
from stages.shape.collection.producer import Producer


def _lineage(config: Config) -> Mapping[str, RecordField]:
    text = "what else its producer says of it, as JSON; the fields are those of a dataset of this producer alone"
    details = RecordField({"type": "string", "minLength": 2, "description": text})
    pairs = {"contrast": RecordField(_contrast_schema())} if config.section(MixtureConfig).contrast else {}
    return {"details": details, **pairs}


def _contrast_schema() -> dict[str, Any]:
    place = {"type": "integer", "minimum": -1}
    return object_schema(
        "the pair that the sample is in: a sample that stands, and one that differs in one part and falls",
        {
            "role": {"enum": ["stands", "falls", "alone"], "description": "alone: it is in no pair"},
            "partner": {"type": "string", "minLength": 1, "description": "key of the other sample; none without one"},
            "edit": {
                "enum": [*EDIT_KINDS, "none"],
                "description": f"what was done to a part of the sample that stands: it is missing, has "
                f"{SHORTENED_SHARE:.0%} of its height, or was moved sideways",
            },
            "part": {**place, "description": "the edited part; -1: none, or it is missing in this sample"},
            "part_name": {"type": "string", "minLength": 1, "description": "name of the edited part; none without one"},
            "cause": {
                "enum": [UNSUPPORTED, TIPS_OVER, "none"],
                "description": "why the edited sample falls: no chain of joints connects a part to the ground, or a "
                "piece of it tips over",
            },
            "gives_way": {**place, "description": "first part of the piece that falls; -1: none"},
        },
    )


def _sentence(config: Config) -> str:
    if not config.section(MixtureConfig).contrast:
        return ""
    return (
        f"Samples that stand at a tilt of {MIN_STANDING_DEGREES:g}° get a partner with one part removed, shortened or "
        f"moved, which falls at {MAX_FALLING_DEGREES:g}°, where one of {MAX_PARTS_TRIED * len(EDIT_KINDS)} tried edits "
        "makes it fall. `lineage.contrast` names partner, edit and cause in both."
    )


def _card(plan: Plan) -> Sequence[str]:
    summaries = [plan.summary("mixture", shard) or {} for shard in plan.shards("mixture")]
    pairs = sum((Counter(summary.get("pairs", {})) for summary in summaries), Counter[str]())
    if not pairs:
        return ()
    rows = [f"| {kind} | {count:,} |" for kind, count in sorted(pairs.items())]
    return ("\n".join(["| pairs of a shape that stands and one that falls | number |", "|---|---:|", *rows]),)


PRODUCER = Producer(
    language="mixture",
    keys="mixture",
    is_requested=lambda config: config.section(MixtureConfig).enabled,
    sentence=_sentence,
    splits=lambda config: (
        "A sample keeps the split that its producer gave it. Samples of two producers share a split if they are of "
        "one kit and have equal shape graphs, or if their surfaces are as near to each other as two point clouds of "
        "one surface are, up to size, position and quarter turns; those that would be in two splits are left out."
        + " Both samples of a pair are in one split."
        * config.section(MixtureConfig).contrast
    ),
    graphs_share_split=lambda _: False,
    joins=True,
    adds_samples=lambda config: config.section(MixtureConfig).contrast,
    lineage=_lineage,
    card=_card,
)
