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

    Its `params` are `producer`, `split` and `samples`, and `joined` where the producer joins the samples of others. Its
    inputs are the collection's shard, what the languages of its samples read, and the shard of the same name of each
    stage in `also`.
    """
    producer = planned_producer(plan)
    if producer is None:
        return []
    read = language_of(producer).reads(plan)
    joined = {"joined": list(sample_producers(plan))} if producers()[producer].joins else {}
    shards = []
    for name in plan.shards(producer):
        summary = plan.summary(producer, name)
        if summary is not None and "split" in summary:
            params = {"producer": producer, "split": summary["split"], "samples": summary["samples"], **joined}
            inputs = (f"{producer}/{name}", *read, *(f"{stage}/{name}" for stage in also))
            shards.append(Shard(name, params, inputs))
    return shards


def sample_count(plan: Plan) -> int:
    """Return the number of samples of the collection, as far as it is known."""
    return sum(int(shard.params["samples"]) for shard in collection_shards(plan))


def planned_producer(plan: Plan) -> str | None:
    """Return the stage whose shards hold the samples of a dataset, or None while no producer has a plan.

    It is the one that joins the samples of others, if there is one.
    """
    planned = [name for name in producers() if plan.shards(name)]
    return max(planned, key=lambda name: producers()[name].joins, default=None)


def sample_producers(plan: Plan) -> tuple[str, ...]:
    """Return the stages that made the samples: one, or all whose samples are joined, last the one that adds some."""
    producer = planned_producer(plan)
    if producer is None or not producers()[producer].joins:
        return () if producer is None else (producer,)
    makers = [name for name, declared in producers().items() if not declared.joins and plan.shards(name)]
    return (*makers, producer) if producers()[producer].adds_samples(plan.config) else tuple(makers)


def check_producers(config: Config) -> None:
    """Raise ConfigError for a config that asks for no shapes, or for several producers and does not mix them."""
    used = [producer for producer in producers().values() if producer.is_requested(config)]
    makers = [producer.keys for producer in used if not producer.joins]
    if len(makers) == 1 or (makers and len(used) > len(makers)):
        return
    known = ", ".join(producer.keys for producer in producers().values() if not producer.joins)
    if not makers:
        raise ConfigError(f"{config.path}: a dataset needs one of {known}; this config has none")
    remedy = (
        "mix their samples with `mixture: true`, or ask for one; `variations.samples_per_kit: 0` leaves out variations"
    )
    raise ConfigError(f"{config.path}: this config has {' and '.join(makers)}; {remedy}")
