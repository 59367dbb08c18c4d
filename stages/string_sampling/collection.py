"""The collection: which dreamt shapes become samples, and in which split and shard they stand."""

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
    """The shard that shares out what all models have found, once they have ended."""
    sources = plan.config.section(StringSamplingConfig).sources
    pools = [[shard.name for shard in each.shards if shard.params["job"] == "pool"] for each in models]
    params = {
        "job": "assignment",
        "models": [
            {"kit": source.kit, "samples": source.samples, "pools": own}
            for source, own in zip(sources, pools, strict=True)
        ],
        "splits": plan.config.section(StringSamplingConfig).splits.model_dump(mode="json"),
    }
    return Shard(
        f"{plan.config.name}-assignment", params, tuple(f"string_sampling/{each}" for own in pools for each in own)
    )


def planned_collection(plan: Plan, assignment: Shard) -> list[Shard]:
    """The shards of the collection, `<dataset>-<split>-<index>`; none until the assignment is made."""
    summary = plan.summary("string_sampling", assignment.name)
    if summary is None:
        return []
    return [
        Shard(
            f"{plan.config.name}-{split}-{number:06d}",
            {"job": "collection", "split": split, "number": number, "samples": size, "assignment": assignment.name},
            (*(f"string_sampling/{lane}" for lane in lanes), f"string_sampling/{assignment.name}"),
        )
        for split in SPLITS
        for number, (size, lanes) in enumerate(summary["shards"][split])
    ]


def run_assignment(task: Task) -> Outcome:
    """Files of the shard: `.jsonl`, for each sample its lane and key there, its own key, split and shard, in the order
    of the samples. Two models that have dreamt one graph of a kit have it once.

    Raises ConfigError where no model has found anything.
    """
    params, splits = task.shard.params, SplitConfig.model_validate(task.shard.params["splits"])
    rows: list[dict[str, Any]] = []
    seen: set[tuple[str, str]] = set()
    counts: Counter[str] = Counter()
    for model in params["models"]:
        kit, taken = model["kit"], 0
        for row in (row for pool in model["pools"] for row in read_pool(task, pool)):
            if (kit, row["graph"]) in seen:
                task.reject(row["key"], "duplicate of another model's")
            elif taken < model["samples"]:
                seen.add((kit, row["graph"]))
                rows.append({"lane": row["lane"], "found": row["key"], "key": f"{kit}-{counts[kit]:06d}"})
                counts[kit] += 1
                taken += 1
    if not rows:
        raise ConfigError(
            "no model of string_sampling.sources has dreamt a shape; the rejects say what became of its strings"
        )
    split_of = assign_splits([[row] for row in range(len(rows))], splits, task.rng("splits"))
    rows_of = assign_shards(split_of, splits, task.rng("order"))
    placed = [
        {**rows[row], "split": split, "shard": shard}
        for split, of_shards in rows_of.items()
        for shard, members in enumerate(of_shards)
        for row in members.tolist()
    ]
    shards = {
        split: [(len(members), sorted({rows[row]["lane"] for row in members.tolist()})) for members in of_shards]
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
    wanted = {(row["lane"], row["found"]) for row in mine}
    found = {
        (lane, sample.key): sample
        for lane in sorted({lane for lane, _ in wanted})
        for sample in read_samples(task.input("string_sampling", f"{lane}.tar"))
        if (lane, sample.key) in wanted
    }
    counts: Counter[str] = Counter()
    with task.output(f"{name}.tar") as stream, ShardWriter(stream) as writer:
        for row in mine:
            sample = replace(found[row["lane"], row["found"]], key=row["key"], split=params["split"])
            write_sample(writer, sample)
            counts[str(sample.lineage["known"])] += 1
    return Outcome(len(mine), {"split": params["split"], "samples": len(mine), "known": dict(sorted(counts.items()))})
