"""Stage `validity`: which parts of each sample touch, and whether it stands."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

from pipeline.errors import Rejected
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Plan, Stage, Task
from stages.shape.collection.collection import Collection, add_members
from stages.shape.collection.discovery import language_of
from stages.shape.collection.pairs import CONTACTS, JOINTS, pair_bytes
from stages.shape.collection.shards import PRODUCERS, collection_shards, sample_count
from stages.shape.geometry.pose import rounded
from stages.shape.sample import Sample
from stages.validity.settings import ValidityConfig

COUNTED_FIELDS = ("rooted", "stable", "falls")
SAID = {"falls": "fall"}
BYTES_A_SAMPLE = 4096


def run_shard(task: Task) -> Outcome:
    """Make the fields of each sample's record that `members.py` declares.

    A sample without extent or weight is rejected. The summary counts the rooted and the stable samples, and
    those that fall where that is asked for.
    """
    from stages.shape.physics.judge import fall_fields, judge_of, physical_fields

    config = task.config.section(ValidityConfig)
    counts: Counter[str] = Counter()

    def judged(collection: Collection, sample: Sample) -> Mapping[str, bytes]:
        shape = collection.shape(sample)
        # as in the record: the last digits of a pose may decide ties of statics
        assembly = replace(shape.assembly, poses=rounded(shape.assembly.poses))
        judge = judge_of(shape.meshes, shape.up, config)
        # a shape graph defines its contacts; those of a shape made from a text are computed here
        known, touching = shape.assembly.edges, collection.decoder.sources[sample.kit].contact_tolerance
        if not language_of(sample.producer).graphs:
            known, touching = judge.kept_contacts(assembly, touching)
        try:
            validity = judge.validity(assembly)
        except ValueError as error:
            raise Rejected("no body to judge", str(error)) from error
        physics = physical_fields(validity)
        if config.falls:
            physics |= fall_fields(judge.fall(assembly, validity.joints))
        fields = {
            "physics": physics,
            "contact_tolerance": _short(touching),
            "joint_tolerance": _short(judge.joint_tolerance(assembly)),
        }
        counts.update(name for name in COUNTED_FIELDS if physics.get(name))
        return {
            CONTACTS: pair_bytes(known),
            JOINTS: pair_bytes(validity.joints),
            "json": json_bytes(fields),
        }

    samples = add_members(task, judged)
    counted = [name for name in COUNTED_FIELDS if name != "falls" or config.falls]
    summary = {"split": task.shard.params["split"], **{name: counts[name] for name in counted}}
    return Outcome(samples, {**summary, "samples": samples})


def _short(length: float) -> float:
    """Return a length without the noise of its last digits."""
    return float(f"{length:.9g}")


def report(plan: Plan) -> Sequence[str]:
    """Return how many samples are rooted and stable, and how many fall where that is asked for."""
    summaries = [plan.summary("validity", name) for name in plan.shards("validity")]
    done = [summary for summary in summaries if summary is not None]
    judged = sum(summary["samples"] for summary in done)
    if not judged:
        return []
    counted = [name for name in COUNTED_FIELDS if name in done[0]]
    shares = [f"{sum(summary[name] for summary in done) / judged:.1%} {SAID.get(name, name)}" for name in counted]
    return [f"{judged:,} judged: {', '.join(shares)}"]


STAGE = Stage(
    name="validity",
    module=__name__,
    config=ValidityConfig,
    inputs=(PRODUCERS,),
    plan=collection_shards,
    run_shard=run_shard,
    estimate_bytes=lambda plan: BYTES_A_SAMPLE * sample_count(plan),
    report=report,
)
