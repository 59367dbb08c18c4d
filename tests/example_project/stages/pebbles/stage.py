"""Stage `pebbles`: random heights in; samples out."""

from __future__ import annotations

from pydantic import Field

from pipeline.config import StrictModel
from pipeline.shards import ShardWriter
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.shape.collection.assignment import SPLITS
from stages.shape.sample import Sample, write_sample


class PebblesConfig(StrictModel):
    """How many heaps are made."""

    heaps: int = Field(0, ge=0, description="heaps in each shard; 0: none are made")


def plan(plan: Plan) -> list[Shard]:
    """Two shards a split."""
    count = plan.config.section(PebblesConfig).heaps
    names = [(split, number) for split in SPLITS for number in range(2)] if count else []
    return [Shard(f"{plan.config.name}-{split}-{number:06d}", {"split": split}) for split, number in names]


def run_shard(task: Task) -> Outcome:
    """Heaps of two to five pebbles."""
    count, split = task.config.section(PebblesConfig).heaps, str(task.shard.params["split"])
    with task.output(f"{task.shard.name}.tar") as stream, ShardWriter(stream) as writer:
        for number in range(count):
            rng = task.rng(number)
            heights = rng.uniform(0.5, 1.5, int(rng.integers(2, 6)))
            text = " ".join(f"{height:.3f}" for height in heights)
            key = f"heap-{split}-{task.shard.name[-1]}{number:03d}"
            graph = f"{len(heights):064x}"
            write_sample(writer, Sample(key, split, "pebbles", "heap", graph, {"drawn": number}, text=text))
    return Outcome(count, {"split": split, "samples": count})


STAGE = Stage("pebbles", __name__, PebblesConfig, (), plan, run_shard, lambda _: 1000)
