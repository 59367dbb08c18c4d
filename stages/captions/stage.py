"""Stage `captions`: each sample in words, by a grammar, from facts about its parts and its statics."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.captions.members import CAPTION
from stages.captions.settings import CaptionsConfig
from stages.shape.collection.collection import Collection, add_members, stage_members
from stages.shape.collection.pairs import CONTACTS, pairs_of
from stages.shape.collection.shards import PRODUCERS, collection_shards, sample_count
from stages.shape.sample import Sample

BYTES_A_CAPTION = 600


def plan(plan: Plan) -> list[Shard]:
    """Plan one shard for each shard of the collection, if the config asks for captions."""
    return collection_shards(plan, "validity") if plan.config.section(CaptionsConfig).lengths else []


def run_shard(task: Task) -> Outcome:
    """Make the member of each sample that `members.py` declares. A sample that statics rejects is rejected."""
    from stages.captions.compose import captions
    from stages.captions.facts import ShapeFacts
    from stages.captions.placement import placement_of
    from stages.captions.words import label_nouns, source_noun

    config = task.config.section(CaptionsConfig)
    judged = stage_members(task, "validity")

    def written(collection: Collection, sample: Sample) -> Mapping[str, bytes]:
        members = judged(sample.key)
        shape = collection.shape(sample)
        placement = placement_of(sample.producer, sample.kit)
        physics = json.loads(members["json"])["physics"]
        facts = ShapeFacts.of(shape, pairs_of(members[CONTACTS]), physics, label_nouns(shape.used_labels), placement)
        noun = source_noun(sample.kit, shape.used_labels, config.nouns)
        texts = captions(facts, noun, config.lengths, task.rng(sample.key))
        return {"json": json_bytes({}), CAPTION: json_bytes(texts)}

    return Outcome(add_members(task, written), {"split": task.shard.params["split"]})


def report(plan: Plan) -> Sequence[str]:
    """Return the lengths of captions."""
    lengths = plan.config.section(CaptionsConfig).lengths
    return [f"captions of {len(lengths)} lengths: {', '.join(lengths)}"] if lengths and plan.shards("captions") else []


def estimate_bytes(plan: Plan) -> int:
    """Return the bytes of all captions, and of the tar's headers and padding."""
    config: Any = plan.config.section(CaptionsConfig)
    return sample_count(plan) * (BYTES_A_CAPTION * len(config.lengths) + 2048) if config.lengths else 0


STAGE = Stage(
    name="captions",
    module=__name__,
    config=CaptionsConfig,
    inputs=(PRODUCERS, "validity"),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=estimate_bytes,
    report=report,
)
