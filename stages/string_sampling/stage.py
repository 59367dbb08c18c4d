"""Stage `string_sampling`: from trained string models to generated shapes, `<dataset>-<split>-<index>.tar`.

Its shards are the models, the search workers and pools of each model's rounds, the assignment of shapes to splits, and
the collection.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from pipeline.config import Config
from pipeline.errors import ConfigError
from pipeline.package_groups import require_group
from pipeline.shards import ShardWriter, json_bytes
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.exemplars.settings import ExemplarsConfig
from stages.shape.collection.assignment import SPLITS, SplitConfig, assign_shards, assign_splits
from stages.shape.sample import read_samples, write_sample
from stages.string_sampling.rounds import ModelRounds, model_rounds, read_pool, write_new_graphs
from stages.string_sampling.settings import StringSamplingConfig
from stages.string_sampling.source import run_source

BYTES_PER_SAMPLE = 40_000
BYTES_PER_MODEL = 8_000_000


def plan(plan: Plan) -> list[Shard]:
    """Plan the rounds of every model as far as they are known, then the assignment and the collection."""
    sources = plan.config.section(StringSamplingConfig).sources
    models = [model_rounds(plan, number, source) for number, source in enumerate(sources)]
    shards = [shard for model in models for shard in model.shards]
    if not models or not all(model.ended for model in models):
        return shards
    assignment = assignment_shard(plan, models)
    return [*shards, assignment, *planned_collection(plan, assignment)]


def run_shard(task: Task) -> Outcome:
    """Make one shard of the plan."""
    from stages.string_sampling.worker import run_worker

    jobs = {
        "source": run_source,
        "worker": run_worker,
        "pool": write_new_graphs,
        "assignment": run_assignment,
        "collection": run_collection,
    }
    return jobs[task.shard.params["job"]](task)


def report(plan: Plan) -> Sequence[str]:
    """Report the progress of each model, and the reasons of rejected draws."""
    config = plan.config.section(StringSamplingConfig)
    lines = []
    for number, source in enumerate(config.sources):
        model = model_rounds(plan, number, source)
        if model.pools:
            rejected: Counter[str] = Counter()
            for worker in model.workers:
                rejected.update(plan.rejects("string_sampling", worker))
            found = sum(pool["new"] for pool in model.pools)
            drawn = len(model.pools) * config.parallel_searches * config.draws
            why = ", ".join(f"{count:,} {reason}" for reason, count in rejected.most_common())
            ended = f"; {model.ended}" if model.ended else ""
            lines.append(
                f"{source.dataset}/{source.model}-{source.kit}-{source.seed}: {found:,} shapes for {source.samples:,} "
                f"of {drawn:,} draws{ended}; rejected: {why or 'none'}"
            )
    return lines


def check(config: Config) -> None:
    """Raise ConfigError for models of unknown kits."""
    sources = config.section(StringSamplingConfig).sources
    kits = [kit.name for kit in config.section(ExemplarsConfig).kits]
    for number, source in enumerate(sources):
        if source.kit not in kits:
            raise ConfigError(
                f"{config.path}: string_sampling.sources[item {number + 1}]: there is no kit"
                f" {source.kit}; kits are {', '.join(kits)}"
            )


def requested_samples(config: Config) -> Sequence[int]:
    """Return the shapes of each shard, if every model finds enough."""
    section = config.section(StringSamplingConfig)
    return section.splits.shard_sizes(sum(source.samples for source in section.sources))


def check_environment(config: Config) -> None:
    """Raise ConfigError where the config names trained models and torch is not installed."""
    if config.section(StringSamplingConfig).sources:
        require_group("models")


def trial(config: Config) -> StringSamplingConfig:
    """Return a config with a few shapes of each model."""
    section = config.section(StringSamplingConfig)
    few = max(32 // max(len(section.sources), 1), 4)
    sources = tuple(source.model_copy(update={"samples": few}) for source in section.sources)
    update = {"sources": sources, "splits": section.splits.for_trial(), "parallel_searches": 1, "draws": 2 * few}
    return section.model_copy(update=update)


def estimate_bytes(plan: Plan) -> int:
    """Return the bytes of all models, and of each shape by its worker and in the collection."""
    sources = plan.config.section(StringSamplingConfig).sources
    return len(sources) * BYTES_PER_MODEL + 2 * BYTES_PER_SAMPLE * sum(source.samples for source in sources)


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


STAGE = Stage(
    name="string_sampling",
    module=__name__,
    config=StringSamplingConfig,
    inputs=("exemplars",),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=estimate_bytes,
    report=report,
    check=check,
    requested_samples=requested_samples,
    check_environment=check_environment,
    trial_config=trial,
    whole_section=False,
)
