"""Which shards of a dataset hold samples, and which stage made them."""

from __future__ import annotations

from pipeline.config import Config
from pipeline.errors import ConfigError
from pipeline.stage import Plan, Shard
from stages.shape.collection.discovery import language_of, producers

PRODUCERS = "*/producer.py"
"""What a stage that reads samples names as an input: every stage that makes samples."""
MEMBERS = "*/members.py"
"""What packaging names as an input: every stage that adds to samples."""


def collection_shards(plan: Plan, *also: str) -> list[Shard]:
    """Return one shard for each shard of the collection, of the same name, `<dataset>-<split>-<index>`.

    Its `params` are `producer`, `split` and `samples`. Its inputs are the collection's shard, what the language of its
    samples reads, and the shard of the same name of each stage in `also`.
    """
    producer = planned_producer(plan)
    if producer is None:
        return []
    read = language_of(producer).reads(plan)
    shards = []
    for name in plan.shards(producer):
        summary = plan.summary(producer, name)
        if summary is not None and "split" in summary:
            params = {"producer": producer, "split": summary["split"], "samples": summary["samples"]}
            inputs = (f"{producer}/{name}", *read, *(f"{stage}/{name}" for stage in also))
            shards.append(Shard(name, params, inputs))
    return shards


def sample_count(plan: Plan) -> int:
    """Return the number of samples of the collection, as far as it is known."""
    return sum(int(shard.params["samples"]) for shard in collection_shards(plan))


def planned_producer(plan: Plan) -> str | None:
    """Return the stage that makes the samples of a dataset, or None while no producer has a plan."""
    return next((producer for producer in producers() if plan.shards(producer)), None)


def check_producers(config: Config) -> None:
    """Raise ConfigError for a config that asks for no shapes, or for more than one kind of producer."""
    known = producers().values()
    used = [producer.keys for producer in known if producer.is_requested(config)]
    if len(used) != 1:
        named = f"has {' and '.join(used)}" if used else "has none"
        keys = ", ".join(producer.keys for producer in known)
        raise ConfigError(f"{config.path}: a dataset needs exactly one of {keys}; this config {named}")
