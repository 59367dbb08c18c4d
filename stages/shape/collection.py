"""The collection of a dataset as the stages after its producer see it: which shards hold samples, and their kits."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from pipeline.stage import Plan, Shard, Task
from stages.shape.kit import Kit
from stages.shape.kit_files import load_kit

__all__ = ["collection_kits", "collection_shards", "input_kit"]

PRODUCER = "variations"


def collection_shards(plan: Plan, *also: str) -> list[Shard]:
    """One shard for each shard of the collection, of the same name, `<dataset>-<split>-<index>`.

    Its `params` are `split` and `samples`; its inputs are the collection's shard, every kit, and the shard of the
    same name of each stage in `also`.
    """
    kits = tuple(f"exemplars/{name}" for name in plan.shards("exemplars"))
    shards = []
    for name in plan.shards(PRODUCER):
        summary = plan.summary(PRODUCER, name)
        if summary is not None and "split" in summary:
            params = {"split": summary["split"], "samples": summary["samples"]}
            inputs = (f"{PRODUCER}/{name}", *kits, *(f"{stage}/{name}" for stage in also))
            shards.append(Shard(name, params, inputs))
    return shards


def collection_kits(task: Task) -> dict[str, Kit]:
    """The kits among the inputs of a shard, by name."""
    names = [each.partition("/")[2] for each in task.shard.inputs if each.startswith("exemplars/")]
    return {name: input_kit(task, name) for name in names}


def input_kit(task: Task, name: str) -> Kit:
    """One kit among the inputs of a shard; read once for each process."""
    return _load(task.input("exemplars", f"{name}.json"), task.input("exemplars", f"{name}.tar"))


@lru_cache(maxsize=32)
def _load(text: Path, arrays: Path) -> Kit:
    return load_kit(text, arrays)
