"""Stage `programs`: the parameters of a program in; sampled shapes out, as the shards `<dataset>-<split>-<index>.tar`.

A sample carries no meshes: its text is its parameters, and `stages.programs.program.shape_of_text` makes the shape.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any

from pipeline.config import Config
from pipeline.errors import ConfigError, ShardFailed
from pipeline.shards import ShardWriter
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.programs.draws import Interval, Share
from stages.programs.parameters import Value
from stages.programs.program import Program, find_program, program_module
from stages.programs.sampling import NoMoreShapes, Sampler, all_value_indices, structure_digest
from stages.programs.settings import ProgramsConfig
from stages.programs.split_plan import listed_shapes, plan_splits
from stages.shape.collection.assignment import SPLITS
from stages.shape.sample import Sample, write_sample

BYTES_PER_SAMPLE = 8192
TRIAL_SHARD_SAMPLES = 8
"""Samples of a shard of a trial."""
MIN_TRIAL_SAMPLES = 96
"""Samples of a trial's sweep, where the config asks for so many."""

SampledValues = tuple[dict[str, Value], dict[str, Any]]
"""The values of a shape, and its lineage."""


def planned_shards(plan: Plan) -> list[Shard]:
    """The shards of every split. Each owns a share of all shapes that no other shard has a part in."""
    return _shards(plan.config)


def _shards(dataset: Config) -> list[Shard]:
    config = dataset.section(ProgramsConfig)
    if not config.program:
        return []
    code = (program_module(config.program),)
    sweep = plan_splits(config.program, config.random) if config.mode == "random" else None
    sizes = sweep.sizes if sweep else _each_value_sizes(config)
    shards: list[Shard] = []
    first = 0
    for split, size in sizes.items():
        count = min(max(config.splits.shards, -(-size // config.splits.samples_per_shard)), size)
        for number in range(count):
            start, end = number * size // count, (number + 1) * size // count
            params = {
                "split": split,
                "start": start,
                "samples": end - start,
                "first_key": first + start,
                **(
                    sweep.owned(split, start, end) if sweep is not None else _each_value_share(sizes, first, start, end)
                ),
            }
            shards.append(Shard(f"{dataset.name}-{split}-{number:06d}", params, code=code))
        first += size
    return shards


def run_shard(task: Task) -> Outcome:
    """The samples of one shard, in random order; its summary says how many draws it looked at for how many samples.

    A shard of a sweep has fewer samples than planned where its share holds no more. Raises ShardFailed where a value
    has no shape, and where the whole program has none.
    """
    config, params = task.config.section(ProgramsConfig), task.shard.params
    program = find_program(config.program)
    structures, shapes = params.get("share", ((0.0, 1.0), (0.0, 1.0)))
    share = Share((structures[0], structures[1]), (shapes[0], shapes[1]), params.get("weight", 1.0))
    sampler = Sampler(program, share, off_grid=config.mode == "random", require=config.require)
    found = _swept(task, sampler) if config.mode == "random" else _each_value(task, sampler)
    with task.output(f"{task.shard.name}.tar") as stream, ShardWriter(stream) as writer:
        for values, lineage in found:
            key = f"{program.name}-{params['first_key'] + writer.samples:06d}"
            write_sample(writer, _sample(program, key, params["split"], config.program, values, lineage))
            task.progress(writer.samples, params["samples"])
    for (parameter, reason), count in sorted(sampler.refused.items()):
        task.reject(parameter, reason, count=count)
    summary = {"split": params["split"], "samples": writer.samples, "tried": sampler.tried}
    return Outcome(writer.samples, {**summary, "failure": sampler.failure} if sampler.failure else summary)


def _each_value(task: Task, sampler: Sampler) -> Iterator[SampledValues]:
    """Shapes with every value of every parameter in turn, in random order."""
    params, every = task.shard.params, all_value_indices(sampler.program)
    for number in task.rng("order").permutation(params["samples"]).tolist():
        cell = every[(params["start"] + number) % len(every)]
        values = sampler.find(cell, task.rng("shape", number))
        yield values, {"method": "each_value", "parameter": cell[0], "class": cell[1]}


def _swept(task: Task, sampler: Sampler) -> Iterator[SampledValues]:
    """Random shapes of the shard's share: as many as planned, or all that there are."""
    params = task.shard.params
    listed = (
        listed_shapes(task.config.section(ProgramsConfig).program, task.config.seed) if "listed" in params else None
    )
    shapes = _drawn(task, sampler) if listed is None else sampler.listed(listed[:, slice(*params["listed"])])
    found = 0
    for values in islice(shapes, params["samples"]):
        found += 1
        yield values, {"method": "random", "apart": params["apart"]}
    if not found:
        # An empty share is no mistake. A program without any shape is one, and here it says why.
        whole = replace(sampler, share=Share(), refused=Counter(), tried=0)
        if listed is None:
            whole.find(None, task.rng("any"))
        elif next(whole.listed(listed), None) is None:
            raise ShardFailed(f"{whole.program.name}: none of its {whole.tried} shapes is kept ({whole.reasons()})")


def _drawn(task: Task, sampler: Sampler) -> Iterator[dict[str, Value]]:
    for number in task.rng("order").permutation(task.shard.params["samples"]).tolist():
        try:
            yield sampler.find(None, task.rng("shape", number))
        except NoMoreShapes:
            return


def _sample(
    program: Program, key: str, split: str, kit: str, values: dict[str, Value], lineage: dict[str, Any]
) -> Sample:
    return Sample(
        key=key,
        split=split,
        producer="programs",
        kit=kit,
        graph=structure_digest(program, values),
        lineage=lineage,
        text=program.schema.to_text(values),
    )


def _each_value_sizes(config: ProgramsConfig) -> dict[str, int]:
    """The samples of each split. Raises ConfigError for a program without parameters, which has no value to show."""
    count = len(all_value_indices(find_program(config.program)))
    if not count:
        raise ConfigError(f"programs.mode: {config.program} has no parameters, and so no values; set it to random")
    return {split: getattr(config.each_value, split) * count for split in SPLITS}


def _each_value_share(sizes: dict[str, int], first: int, start: int, end: int) -> dict[str, list[Interval]]:
    """A share of the shapes as large as samples `start` to `end` are of all samples; structures recur."""
    total = sum(sizes.values())
    return {"share": [(0.0, 1.0), ((first + start) / total, (first + end) / total)]}


def report(plan: Plan) -> Sequence[str]:
    """How many draws there were for each sample, why the others were refused, one case in which the program itself
    failed, and where a sweep ended early."""
    counts: Counter[str] = Counter()
    made: Counter[str] = Counter()
    failures: list[str] = []
    tried = 0
    shards = planned_shards(plan)
    for shard in shards:
        summary = plan.summary("programs", shard.name)
        if summary is not None:
            tried += summary["tried"]
            made[summary["split"]] += summary["samples"]
            failures += [summary["failure"]] if "failure" in summary else []
            counts.update(plan.rejects("programs", shard.name))
    if not made:
        return []
    why = ", ".join(f"{100 * count / tried:.1f} % {reason}" for reason, count in counts.most_common())
    told = [f"{sum(made.values()):,} shapes of {tried:,} tries; refused: {why or 'none'}", *failures[:1]]
    config = plan.config.section(ProgramsConfig)
    if config.mode == "random" and all(plan.summary("programs", shard.name) for shard in shards):
        told += plan_splits(config.program, config.random).notes(config.random, made)
    return told


def asked(config: Config) -> Sequence[int]:
    """The shapes of each shard."""
    return [int(shard.params["samples"]) for shard in _shards(config)]


def trial(config: Config) -> ProgramsConfig:
    """Few shapes a shard, in about as many shards as the config asks for: each looks through its share of all shapes,
    and of a million shapes in shards of few the plan alone would take a minute."""
    section = config.section(ProgramsConfig)
    less = min(TRIAL_SHARD_SAMPLES / section.splits.samples_per_shard, 1.0)
    wanted, every = section.random.samples, section.each_value
    sweep = section.random.model_copy(update={"samples": max(round(less * wanted), min(wanted, MIN_TRIAL_SAMPLES))})
    each = {split: max(round(less * getattr(every, split)), 1) for split in SPLITS}
    splits = section.splits.model_copy(update={"samples_per_shard": TRIAL_SHARD_SAMPLES})
    return section.model_copy(
        update={"splits": splits, "random": sweep, "each_value": every.model_copy(update=each)},
    )


STAGE = Stage(
    name="programs",
    module=__name__,
    config=ProgramsConfig,
    inputs=(),
    plan=planned_shards,
    run_shard=run_shard,
    estimate_bytes=lambda plan: sum(BYTES_PER_SAMPLE * int(each.params["samples"]) for each in planned_shards(plan)),
    report=report,
    requested_samples=asked,
    trial_config=trial,
)
