"""Stage `programs`: the parameters of programs in; sampled shapes out, as the shards `<dataset>-<split>-<index>.tar`.

A sample has no meshes: its text is its parameters, from which `stages.programs.program.shape_from_text` builds the
shape.
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
from stages.programs.settings import ProgramConfig, ProgramsConfig
from stages.programs.split_plan import listed_shapes, plan_splits
from stages.shape.collection.assignment import SPLITS
from stages.shape.sample import Sample, write_sample

BYTES_PER_SAMPLE = 8192
TRIAL_SHARD_SAMPLES = 8
MIN_TRIAL_SAMPLES = 96
"""Of a trial of random sampling, where the config requests as many."""

SampledValues = tuple[dict[str, Value], dict[str, Any]]
"""The values of a shape, and its lineage."""


def planned_shards(plan: Plan) -> list[Shard]:
    """The shards of every split. Each owns a share of all shapes, disjoint from the others."""
    return _shards(plan.config)


def _shards(dataset: Config) -> list[Shard]:
    section = dataset.section(ProgramsConfig)
    numbers: Counter[str] = Counter()
    shards: list[Shard] = []
    for entry, config in enumerate(section.sampled):
        code = (program_module(config.program),)
        split_plan = plan_splits(config.program, config.random) if config.mode == "random" else None
        sizes = split_plan.sizes if split_plan else _all_values_sizes(config)
        first = 0
        for split, size in sizes.items():
            count = min(max(section.splits.shards, -(-size // section.splits.samples_per_shard)), size)
            for number in range(count):
                start, end = number * size // count, (number + 1) * size // count
                owned = (
                    split_plan.owned(split, start, end) if split_plan else _all_values_share(sizes, first, start, end)
                )
                part = {"entry": entry, "split": split, "start": start, "samples": end - start}
                name = f"{dataset.name}-{split}-{numbers[split] + number:06d}"
                shards.append(Shard(name, {**part, "first_key": first + start, **owned}, code=code))
            first += size
            numbers[split] += count
    return shards


def run_shard(task: Task) -> Outcome:
    """Make the samples of one shard, in random order; its summary has the number of samples and of draws examined.

    In mode random, a shard has fewer samples than planned where its share has no more. Raises ShardFailed where a value
    has no shape, and where the whole program has none.
    """
    config, params = _entry(task), task.shard.params
    program = find_program(config.program)
    structures, shapes = params.get("share", ((0.0, 1.0), (0.0, 1.0)))
    share = Share((structures[0], structures[1]), (shapes[0], shapes[1]), params.get("weight", 1.0))
    sampler = Sampler(program, share, off_grid=config.mode == "random", require=config.require)
    shapes_found = _random(task, sampler) if config.mode == "random" else _all_values(task, sampler)
    with task.output(f"{task.shard.name}.tar") as stream, ShardWriter(stream) as writer:
        for values, lineage in shapes_found:
            key = f"{program.name}-{params['first_key'] + writer.samples:06d}"
            write_sample(writer, _sample(program, key, params["split"], config.program, values, lineage))
            task.progress(writer.samples, params["samples"])
    for (parameter, reason), count in sorted(sampler.refused.items()):
        task.reject(parameter, reason, count=count)
    summary = {"split": params["split"], "samples": writer.samples, "tried": sampler.tried}
    return Outcome(writer.samples, {**summary, "failure": sampler.failure} if sampler.failure else summary)


def _entry(task: Task) -> ProgramConfig:
    """The program that a shard samples."""
    entry: int = task.shard.params["entry"]
    return task.config.section(ProgramsConfig).sampled[entry]


def _all_values(task: Task, sampler: Sampler) -> Iterator[SampledValues]:
    """Yield shapes with every value of every parameter in turn, in random order."""
    params, indices = task.shard.params, all_value_indices(sampler.program)
    for number in task.rng("order").permutation(params["samples"]).tolist():
        name, index = indices[(params["start"] + number) % len(indices)]
        values = sampler.find((name, index), task.rng("shape", number))
        yield values, {"method": "all_values", "parameter": name, "class": index}


def _random(task: Task, sampler: Sampler) -> Iterator[SampledValues]:
    """Yield random shapes of the shard's share: the planned number, or all that exist."""
    params = task.shard.params
    name = _entry(task).program
    listed = listed_shapes(name, task.config.seed) if "listed" in params else None
    shapes = sampler.listed(listed[:, slice(*params["listed"])]) if listed is not None else _drawn(task, sampler)
    count = 0
    for values in islice(shapes, params["samples"]):
        count += 1
        yield values, {"method": "random", "split_by": params["split_by"]}
    if not count:
        # An empty share is no mistake, but a program without any shape is.
        whole = replace(sampler, share=Share(), refused=Counter(), tried=0)
        if listed is None:
            whole.find(None, task.rng("any"))
        elif next(whole.listed(listed), None) is None:
            raise ShardFailed(f"{whole.program.name}: none of its {whole.tried} shapes is valid ({whole.reasons()})")


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


def _all_values_sizes(config: ProgramConfig) -> dict[str, int]:
    """The number of samples of each split. Raises ConfigError for a program without parameters."""
    count = len(all_value_indices(find_program(config.program)))
    if not count:
        raise ConfigError(f"programs.mode: {config.program} has no parameters, and so no values; set it to random")
    return {split: getattr(config.all_values, split) * count for split in SPLITS}


def _all_values_share(sizes: dict[str, int], first: int, start: int, end: int) -> dict[str, list[Interval]]:
    """The same share of all shapes as of all samples; structures recur."""
    total = sum(sizes.values())
    return {"share": [(0.0, 1.0), ((first + start) / total, (first + end) / total)]}


def check(config: Config) -> None:
    """Raise ConfigError for two programs of one name, whose samples would have the same keys."""
    entries = config.section(ProgramsConfig).entries
    names = [find_program(entry.program).name for entry in entries]
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise ConfigError(f"{config.path}: programs.entries: two programs are named {twice[0]}; change PROGRAM.name")


def report(plan: Plan) -> Sequence[str]:
    """Report draws per sample, reasons for refused draws, one failure of the program itself, and missing shapes."""
    refused: Counter[str] = Counter()
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
            refused.update(plan.rejects("programs", shard.name))
    if not made:
        return []
    reasons = ", ".join(f"{100 * count / tried:.1f} % {reason}" for reason, count in refused.most_common())
    lines = [f"{sum(made.values()):,} shapes of {tried:,} tries; refused: {reasons or 'none'}", *failures[:1]]
    sampled = plan.config.section(ProgramsConfig).sampled
    if sampled[0].mode == "random" and all(plan.summary("programs", shard.name) for shard in shards):
        for entry, config in enumerate(sampled):
            of_program: Counter[str] = Counter()
            for shard in shards:
                if shard.params["entry"] == entry:
                    summary = plan.summary("programs", shard.name) or {}
                    of_program[summary["split"]] += summary["samples"]
            notes = plan_splits(config.program, config.random).notes(config.random, of_program)
            lines += notes if len(sampled) == 1 else [f"{config.program}: {note}" for note in notes]
    return lines


def requested_samples(config: Config) -> Sequence[int]:
    """The number of shapes of each shard."""
    return [int(shard.params["samples"]) for shard in _shards(config)]


def trial_config(config: Config) -> ProgramsConfig:
    """A config with few shapes in each shard, and about as many shards.

    Each shard searches its own share of all shapes. With a million shapes in small shards, the plan alone would take a
    minute.
    """
    section = config.section(ProgramsConfig)
    scale = min(TRIAL_SHARD_SAMPLES / section.splits.samples_per_shard, 1.0)
    least = MIN_TRIAL_SAMPLES // max(len(section.sampled), 1)
    shards = section.splits.model_copy(update={"samples_per_shard": TRIAL_SHARD_SAMPLES})
    entries = tuple(entry.model_copy(update=_fewer(entry, scale, least)) for entry in section.entries)
    return section.model_copy(update={"splits": shards, "entries": entries, **_fewer(section, scale, least)})


def _fewer(config: ProgramConfig, scale: float, least: int) -> dict[str, Any]:
    """The numbers of shapes of a program, multiplied by `scale`, as an update of its config."""
    requested, all_values = config.random.samples, config.all_values
    samples = max(round(scale * requested), min(requested, least))
    fewer = {split: max(round(scale * getattr(all_values, split)), 1) for split in SPLITS}
    return {
        "random": config.random.model_copy(update={"samples": samples}),
        "all_values": all_values.model_copy(update=fewer),
    }


STAGE = Stage(
    name="programs",
    module=__name__,
    config=ProgramsConfig,
    inputs=(),
    plan=planned_shards,
    run_shard=run_shard,
    estimate_bytes=lambda plan: BYTES_PER_SAMPLE * sum(requested_samples(plan.config)),
    report=report,
    check=check,
    requested_samples=requested_samples,
    trial_config=trial_config,
)
