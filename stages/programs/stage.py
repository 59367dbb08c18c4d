"""Stage `programs`: the parameters of a program in; sampled shapes out, as the shards `<dataset>-<split>-<index>.tar`.

A sample carries no meshes: its text is its parameters, and `stages.programs.program.shape_of_text` makes the shape.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pipeline.shards import ShardWriter
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.programs.draws import Interval, Share
from stages.programs.parameters import Value
from stages.programs.program import Program, find_program, program_source
from stages.programs.sampling import Sampler, cells, structure_digest
from stages.programs.settings import ProgramsConfig
from stages.shape.sample import Sample, write_sample
from stages.shape.splits import SPLITS

__all__ = ["STAGE"]

BYTES_A_SAMPLE = 8192


def planned_shards(plan: Plan) -> list[Shard]:
    """The shards of every split. Each owns a share of all shapes that no other shard has a part in."""
    config = plan.config.section(ProgramsConfig)
    if not config.program:
        return []
    program = find_program(config.program)
    sizes, source = _split_sizes(program, config), _source_digest(config.program)
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
                "share": _share(config, sizes, split, start, end),
                "program": source,
            }
            shards.append(Shard(f"{plan.config.name}-{split}-{number:06d}", params))
        first += size
    return shards


def run_shard(task: Task) -> Outcome:
    """The samples of one shard, in random order; its summary says how many draws it looked at for how many samples."""
    config = task.config.section(ProgramsConfig)
    program = find_program(config.program)
    params = task.shard.params
    structures, shapes = params["share"]
    sampler = Sampler(
        program,
        Share((structures[0], structures[1]), (shapes[0], shapes[1])),
        between=config.mode == "sweep",
        require=config.require,
    )
    every = cells(program)
    order = task.rng("order").permutation(params["samples"]).tolist()
    with task.output(f"{task.shard.name}.tar") as stream, ShardWriter(stream) as writer:
        for place, number in enumerate(order):
            cell = None if config.mode == "sweep" else every[(params["start"] + number) % len(every)]
            values = sampler.find(cell, task.rng("shape", number))
            key = f"{program.name}-{params['first_key'] + place:06d}"
            lineage: dict[str, Any] = {"mode": config.mode}
            if cell is not None:
                lineage |= {"parameter": cell[0], "class": cell[1]}
            write_sample(writer, _sample(program, key, params["split"], config.program, values, lineage))
            task.progress(writer.samples, len(order))
    for (parameter, reason), count in sorted(sampler.refused.items()):
        task.reject(parameter, reason, count=count)
    return Outcome(len(order), {"split": params["split"], "samples": len(order), "tried": sampler.tried})


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
        text=program.schema.text(values),
    )


def _split_sizes(program: Program, config: ProgramsConfig) -> dict[str, int]:
    if config.mode == "sweep":
        sizes = {split: max(round(getattr(config.sweep, split) * config.sweep.samples), 1) for split in ("val", "test")}
        return {"train": config.sweep.samples - sum(sizes.values()), **sizes}
    return {split: getattr(config.each_value, split) * len(cells(program)) for split in SPLITS}


def _share(config: ProgramsConfig, sizes: dict[str, int], split: str, start: int, end: int) -> list[Interval]:
    """The structures and the shapes that belong to samples `start` to `end` of a split: shares as large as theirs of
    the samples. In a sweep a split has its own structures."""
    total = sum(sizes.values())
    before = sum(sizes[each] for each in SPLITS[: SPLITS.index(split)])
    if config.mode == "sweep":
        return [(before / total, (before + sizes[split]) / total), (start / sizes[split], end / sizes[split])]
    return [(0.0, 1.0), ((before + start) / total, (before + end) / total)]


def _source_digest(name: str) -> str:
    """Hex sha256 of what shapes are made with, the program's file and this folder: an edited program is another."""
    digest = hashlib.sha256(program_source(name).read_bytes())
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def report(plan: Plan) -> Sequence[str]:
    """How many draws there were for each sample, and why the others were refused."""
    counts: Counter[str] = Counter()
    tried = samples = 0
    for shard in planned_shards(plan):
        summary = plan.summary("programs", shard.name)
        if summary is not None:
            tried, samples = tried + summary["tried"], samples + summary["samples"]
            counts.update(plan.rejects("programs", shard.name))
    if not samples:
        return []
    why = ", ".join(f"{100 * count / tried:.1f} % {reason}" for reason, count in counts.most_common())
    return [f"{samples:,} shapes of {tried:,} tries; refused: {why or 'none'}"]


STAGE = Stage(
    name="programs",
    version=1,
    config=ProgramsConfig,
    inputs=(),
    plan=planned_shards,
    run_shard=run_shard,
    estimate_bytes=lambda plan: sum(BYTES_A_SAMPLE * int(each.params["samples"]) for each in planned_shards(plan)),
    report=report,
)
