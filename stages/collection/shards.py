"""Which shards of a dataset hold samples, and which stage made them."""

from __future__ import annotations

from pipeline.errors import ConfigError
from pipeline.stage import Plan, Shard

__all__ = ["KIT_PRODUCER", "PRODUCERS", "collection_shards", "planned_producer", "producer_of"]

KIT_PRODUCER = "variations"
PRODUCERS = (KIT_PRODUCER,)
"""The stages that make samples, the first of them out of kits. A dataset has one of them."""


def collection_shards(plan: Plan, *also: str) -> list[Shard]:
    """One shard for each shard of the collection, of the same name, `<dataset>-<split>-<index>`.

    Its `params` are `split` and `samples`; its inputs are the collection's shard, every kit, and the shard of the
    same name of each stage in `also`. Raises ConfigError for a config that makes no samples, or in two ways.
    """
    producer = planned_producer(plan)
    kits = tuple(f"exemplars/{name}" for name in plan.shards("exemplars"))
    shards = []
    for name in plan.shards(producer):
        summary = plan.summary(producer, name)
        if summary is not None and "split" in summary:
            params = {"split": summary["split"], "samples": summary["samples"]}
            inputs = (f"{producer}/{name}", *kits, *(f"{stage}/{name}" for stage in also))
            shards.append(Shard(name, params, inputs))
    return shards


def producer_of(shard: Shard) -> str:
    """The stage that made the samples of a shard of `collection_shards`."""
    return next(stage for stage in (each.partition("/")[0] for each in shard.inputs) if stage in PRODUCERS)


def planned_producer(plan: Plan) -> str:
    """The stage that makes the samples of a dataset. Raises ConfigError where none does, or more than one."""
    found = [producer for producer in PRODUCERS if plan.shards(producer)]
    if not found:
        raise ConfigError(
            f"{plan.config.path}: nothing here makes shapes; give it one of the sections exemplars (with kits), "
            "programs, shapeassembly"
        )
    if len(found) > 1:
        raise ConfigError(f"{plan.config.path}: a dataset has one producer, and this has {' and '.join(found)}")
    return found[0]
