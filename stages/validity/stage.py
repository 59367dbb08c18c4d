"""Stage `validity`: the physical validity of each sample of the collection, and which of its parts touch."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from pipeline.shards import ShardWriter, json_bytes
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.shape.collection.shapes import Collection
from stages.shape.collection.shards import KIT_PRODUCER, PRODUCERS, collection_shards
from stages.shape.physics.judge import judge_of, physical_fields
from stages.shape.physics.settings import PhysicsConfig

__all__ = ["STAGE"]

COUNTED = ("rooted", "stable")
BYTES_A_SAMPLE = 4096


def plan(plan: Plan) -> list[Shard]:
    """One shard for each shard of the collection."""
    return collection_shards(plan)


def run_shard(task: Task) -> Outcome:
    """The member `json` of each sample: `physics`, the fields of its validity, and `contacts`, the pairs of parts that
    touch. A sample without extent or weight is refused. The summary counts the rooted and the stable samples."""
    config = task.config.section(PhysicsConfig)
    collection = Collection(task)
    total = int(task.shard.params["samples"])
    counts: Counter[str] = Counter()
    with task.output(f"{task.shard.name}.tar") as stream, ShardWriter(stream) as writer:
        for sample in collection.samples():
            shape = collection.shape(sample)
            judge = judge_of(shape.meshes, shape.up, config)
            # a kit says itself what counts as contact; of parts made from a text nobody has asked yet
            known = shape.assembly.edges if collection.producer == KIT_PRODUCER else judge.contacts(shape.assembly)
            try:
                fields = physical_fields(judge.validity(shape.assembly))
            except ValueError as error:
                task.reject(sample.key, "no body to judge", str(error))
                continue
            writer.write(sample.key, {"json": json_bytes({"physics": fields, "contacts": known.tolist()})})
            counts.update(each for each in COUNTED if fields[each])
            task.progress(writer.samples, total)
    summary = {"split": task.shard.params["split"], **{each: counts[each] for each in COUNTED}}
    return Outcome(samples=writer.samples, summary={**summary, "samples": writer.samples})


def report(plan: Plan) -> Sequence[str]:
    """How many samples are rooted and stable."""
    found = [plan.summary("validity", name) for name in plan.shards("validity")]
    done = [each for each in found if each is not None]
    judged = sum(each["samples"] for each in done)
    if not judged:
        return []
    shares = [f"{sum(each[name] for each in done) / judged:.1%} {name}" for name in COUNTED]
    return [f"{judged:,} judged: {', '.join(shares)}"]


STAGE = Stage(
    name="validity",
    module=__name__,
    config=PhysicsConfig,
    inputs=("exemplars", *PRODUCERS),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=lambda plan: BYTES_A_SAMPLE * sum(int(each.params["samples"]) for each in collection_shards(plan)),
    report=report,
)
