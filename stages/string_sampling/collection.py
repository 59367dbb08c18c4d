"""The collection: generated shapes become samples, each in a split and a shard."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from pipeline.errors import ConfigError
from pipeline.shards import ShardWriter, json_bytes
from pipeline.stage import Outcome, Plan, Shard, Task
from stages.shape.collection.assignment import SPLITS, SplitConfig, assign_shards, assign_splits
from stages.shape.sample import read_samples, write_sample
from stages.string_sampling.rounds import ModelRounds, read_pool
from stages.string_sampling.settings import StringSamplingConfig


def assignment_shard(plan: Plan, models: Sequence[ModelRounds]) -> Shard:
    """Return the shard that assigns the shapes of all models to splits, once they have ended."""
    sources = plan.config.section(StringSamplingConfig).sources
    pools = [[shard.name for shard in model.shards if shard.params["job"] == "pool"] for model in models]
    params = {
        "job": "assignment",
        "models": [
            {"kit": source.kit, "samples": source.samples, "pools": own}
            for source, own in zip(sources, pools, strict=True)
        ],
        "splits": plan.config.section(StringSamplingConfig).splits.model_dump(mode="json"),
    }
    inputs = tuple(f"string_sampling/{pool}" for own in pools for pool in own)
    return Shard(f"{plan.config.name}-assignment", params, inputs)


def planned_collection(plan: Plan, assignment: Shard) -> list[Shard]:
    """Return the shards of the collection, `<dataset>-<split>-<index>`; none before the assignment."""
    summary = plan.summary("string_sampling", assignment.name)
    if summary is None:
        return []
    return [
        Shard(
            f"{plan.config.name}-{split}-{number:06d}",
            {"job": "collection", "split": split, "number": number, "samples": size, "assignment": assignment.name},
            (*(f"string_sampling/{worker}" for worker in workers), f"string_sampling/{assignment.name}"),
        )
        for split in SPLITS
        for number, (size, workers) in enumerate(summary["shards"][split])
    ]


def run_assignment(task: Task) -> Outcome:
    """Write `.jsonl`: for each sample its worker and key there, its own key, split and shard, in order.

    A graph that two models generated counts once. Raises ConfigError if no model has found a shape.
    """
    params, splits = task.shard.params, SplitConfig.model_validate(task.shard.params["splits"])
    rows: list[dict[str, Any]] = []
    seen: set[tuple[str, str]] = set()
    counts: Counter[str] = Counter()
    for model in params["models"]:
        kit, accepted = model["kit"], 0
        for row in (row for pool in model["pools"] for row in read_pool(task, pool)):
            if (kit, row["graph"]) in seen:
                task.reject(row["key"], "duplicate of another model's")
            elif accepted < model["samples"]:
                seen.add((kit, row["graph"]))
                rows.append({"worker": row["worker"], "found": row["key"], "key": f"{kit}-{counts[kit]:06d}"})
                counts[kit] += 1
                accepted += 1
    if not rows:
        raise ConfigError("no model of string_sampling.sources has generated a shape; the rejects give the reasons")
    split_of = assign_splits([[row] for row in range(len(rows))], splits, task.rng("splits"))
    rows_of = assign_shards(split_of, splits, task.rng("order"))
    placed = [
        {**rows[row], "split": split, "shard": shard}
        for split, of_shards in rows_of.items()
        for shard, members in enumerate(of_shards)
        for row in members.tolist()
    ]
    shards = {
        split: [(len(members), sorted({rows[row]["worker"] for row in members.tolist()})) for members in of_shards]
        for split, of_shards in rows_of.items()
    }
    with task.output(f"{task.shard.name}.jsonl") as stream:
        stream.writelines(json_bytes(row) for row in placed)
    return Outcome(0, {"shards": shards, "kits": dict(sorted(counts.items())), "samples_in_all": len(rows)})


def run_collection(task: Task) -> Outcome:
    """Write the samples of one shard."""
    params, name = task.shard.params, task.shard.name
    assignment = task.input("string_sampling", f"{params['assignment']}.jsonl").read_bytes().splitlines()
    mine = [
        row
        for row in map(json.loads, assignment)
        if (row["split"], row["shard"]) == (params["split"], params["number"])
    ]
    wanted = {(row["worker"], row["found"]) for row in mine}
    samples = {
        (worker, sample.key): sample
        for worker in sorted({worker for worker, _ in wanted})
        for sample in read_samples(task.input("string_sampling", f"{worker}.tar"))
        if (worker, sample.key) in wanted
    }
    counts: Counter[str] = Counter()
    with task.output(f"{name}.tar") as stream, ShardWriter(stream) as writer:
        for row in mine:
            sample = replace(samples[row["worker"], row["found"]], key=row["key"], split=params["split"])
            write_sample(writer, sample)
            counts[str(sample.lineage["novelty"])] += 1
    return Outcome(len(mine), {"split": params["split"], "samples": len(mine), "novelty": dict(sorted(counts.items()))})
