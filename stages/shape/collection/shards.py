"""Which shards of a dataset hold samples, and which stage made them."""

from __future__ import annotations

from pipeline.config import Config
from pipeline.errors import ConfigError
from pipeline.stage import Plan, Shard

__all__ = ["KIT_PRODUCER", "PRODUCERS", "check_producers", "collection_shards", "planned_producer", "producer_of"]

KIT_PRODUCER = "variations"
PRODUCERS = (KIT_PRODUCER, "programs", "shapeassembly")
"""The stages that make samples, the first of them out of kits. A dataset has one of them."""


def collection_shards(plan: Plan, *also: str) -> list[Shard]:
    """One shard for each shard of the collection, of the same name, `<dataset>-<split>-<index>`.

    Its `params` are `split` and `samples`; its inputs are the collection's shard, every kit, and the shard of the
    same name of each stage in `also`.
    """
    producer = planned_producer(plan)
    if producer is None:
        return []
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


def planned_producer(plan: Plan) -> str | None:
    """The stage that makes the samples of a dataset, or None while none of them has a plan."""
    return next((producer for producer in PRODUCERS if plan.shards(producer)), None)


def check_producers(config: Config) -> None:
    """Raises ConfigError for a config that makes no shapes, or makes them in more than one way."""
    from stages.exemplars.settings import ExemplarsConfig
    from stages.programs.settings import ProgramsConfig
    from stages.shapeassembly.settings import ShapeAssemblyConfig

    ways = {
        "exemplars.kits": bool(config.section(ExemplarsConfig).kits),
        "programs.program": bool(config.section(ProgramsConfig).program),
        "shapeassembly.programs or hierarchies": config.section(ShapeAssemblyConfig).has_sources,
    }
    used = [key for key, use in ways.items() if use]
    if len(used) != 1:
        found = f"has {' and '.join(used)}" if used else "has none"
        raise ConfigError(f"{config.path}: a dataset needs one of {', '.join(ways)}, and only one; this {found}")
