"""Stage `shapeassembly`: from ShapeAssembly programs to the shards `<dataset>-<split>-<index>.tar`.

The first shards extract programs from part hierarchies and draw random ones, if the config asks for any. The assignment
reads all programs, those of stage `program_sampling` included, rejects invalid ones, and gives each a split and shard.
A sample has no meshes: its text is the canonical program, executed by `stages.shapeassembly.shape.shape_of_text`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from pipeline.config import Config
from pipeline.errors import ShardFailed
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.shape.collection.assignment import planned_collection, write_listed_samples, write_listings
from stages.shape.collection.classes import Classes
from stages.shape.collection.origin import missing_licenses
from stages.shapeassembly.extraction.shards import extraction_shards, run_extraction
from stages.shapeassembly.language import ProgramDecoder, assignment_name
from stages.shapeassembly.origins import program_origins
from stages.shapeassembly.random_programs import random_shards, run_random
from stages.shapeassembly.settings import ShapeAssemblyConfig
from stages.shapeassembly.sources import program_texts, source_digest
from stages.shapeassembly.splits import splits_of

BYTES_PER_PROGRAM = 12_000
"""A sample in its shard, and its line in the assignment."""


def planned_shards(plan: Plan) -> list[Shard]:
    """Plan the extraction, then the assignment, then the shards of the collection, as far as records exist."""
    config = plan.config.section(ShapeAssemblyConfig)
    if not config.has_sources:
        return []
    extraction = _first_shards(plan.config)
    summaries = [plan.summary("shapeassembly", shard.name) for shard in extraction]
    if None in summaries:
        return extraction
    digests = [source_digest(files.path) for files in config.programs]
    extracted = [("shapeassembly", shard.name) for shard in extraction]
    inputs = tuple(
        f"{stage}/{shard}"
        for stage, shard in (*extracted, *(("program_sampling", name) for name in plan.shards("program_sampling")))
    )
    assignment = Shard(assignment_name(plan.config.name), {"job": "assignment", "digests": digests}, inputs)
    summary = plan.summary("shapeassembly", assignment.name)
    if summary is None:
        return [*extraction, assignment]
    collection = planned_collection(plan, summary["shards"], (f"shapeassembly/{assignment.name}",))
    return [*extraction, assignment, *collection]


def _first_shards(config: Config) -> list[Shard]:
    """Return the shards that make programs: those of the extraction, then those of random programs."""
    section = config.section(ShapeAssemblyConfig)
    return [*extraction_shards(config.name, section.hierarchies), *random_shards(config.name, section.random)]


def run_shard(task: Task) -> Outcome:
    """Run a shard of the extraction or of random programs, the assignment, or a shard of the collection."""
    if task.shard.params["job"] == "random":
        return run_random(task)
    if task.shard.params["job"] == "extraction":
        config = task.config.section(ShapeAssemblyConfig)
        return run_extraction(task, config.hierarchies, config.extraction, config.cleaning)
    return run_assignment(task) if task.shard.params["job"] == "assignment" else run_collection(task)


def run_assignment(task: Task) -> Outcome:
    """Read and check all programs, and assign them to splits; programs of one signature share a split.

    Files of the shard:
        `.<split>-<number>.jsonl`: the samples of each shard of the collection, one a line
        `.labels.json`: the part labels of each category, sorted
    Raises ShardFailed for no program, or too many labels.
    """
    from stages.shapeassembly.acceptance import accepted_rows

    config = task.config.section(ShapeAssemblyConfig)
    rejected: Counter[str] = Counter()
    rows = list(accepted_rows(task, config, rejected))
    if not rows:
        reasons = ", ".join(f"{count:,} {reason}" for reason, count in rejected.most_common(3))
        raise ShardFailed(f"no program was accepted; rejected: {reasons or 'none'}")
    label_sets: dict[str, set[str]] = {}
    for row in rows:
        label_sets.setdefault(row["kit"], set()).update(row.pop("labels"))
    labels = {kit: sorted(label_sets[kit]) for kit in sorted(label_sets)}
    try:
        Classes.of(ProgramDecoder(labels).sources)
    except ValueError as error:
        raise ShardFailed(f"{error}; the names in the programs make them") from error
    split_of = splits_of(rows, config, task.rng("splits"))
    shards = write_listings(task, [{**row, "parents": [row["file"]]} for row in rows], split_of, config.splits)
    counts = dict(sorted(Counter(row["kit"] for row in rows).items()))
    with task.output(f"{task.shard.name}.labels.json") as stream:
        stream.write(json_bytes(labels))
    parts = float(np.mean([row["parts"] for row in rows]))
    structures = len({row["graph"] for row in rows})
    return Outcome(0, {"shards": shards, "programs": counts, "structures": structures, "parts": round(parts, 2)})


def run_collection(task: Task) -> Outcome:
    """Write the samples of one shard."""
    return write_listed_samples(task, "shapeassembly", assignment_name(task.config.name))


def report(plan: Plan) -> Sequence[str]:
    """Report programs, structures, and reject counts."""
    name = assignment_name(plan.config.name)
    config = plan.config.section(ShapeAssemblyConfig)
    summary = plan.summary("shapeassembly", name) if config.has_sources else None
    if summary is None:
        return []
    extraction = [shard.name for shard in _first_shards(plan.config)]
    counts = ", ".join(f"{count:,} {kit}" for kit, count in summary["programs"].items())
    rejected: Counter[str] = Counter()
    for shard in (*extraction, name):
        rejected.update(plan.rejects("shapeassembly", shard))
    reasons = ", ".join(f"{count:,} {reason}" for reason, count in rejected.most_common())
    warnings = [f"warning: {sentence}" for sentence in missing_licenses(program_origins(plan))]
    left_out = {entry.path: entry.source.sidecars for entry in config.hierarchies}
    for path, count in left_out.items():
        warnings += [f"warning: {path}: {count} `._` files of macOS were left out"] if count else []
    return [f"programs: {counts}; {summary['structures']:,} structures; rejected: {reasons or 'none'}", *warnings]


def estimate_bytes(plan: Plan) -> int:
    """Estimate the bytes of all samples, as far as they are known."""
    summary = plan.summary("shapeassembly", assignment_name(plan.config.name))
    return BYTES_PER_PROGRAM * sum(summary["programs"].values()) if summary else 0


def requested_samples(config: Config) -> Sequence[int]:
    """Return the programs of each shard of the collection, if all are accepted."""
    section = config.section(ShapeAssemblyConfig)
    total = sum(
        (1 + files.edits) * sum(1 for _ in program_texts(files.path, files.folder)) for files in section.programs
    )
    total += sum(len(files.source) for files in section.hierarchies)
    total += sum(model.samples for model in section.sampled) + sum(source.samples for source in section.random)
    return section.splits.shard_sizes(total)


def trial_config(config: Config) -> ShapeAssemblyConfig:
    """Return the same programs in small shards, with few edits and sampled programs."""
    section = config.section(ShapeAssemblyConfig)
    sampled = tuple(model.model_copy(update={"samples": min(model.samples, 16)}) for model in section.sampled)
    programs = tuple(files.model_copy(update={"edits": min(files.edits, 1)}) for files in section.programs)
    random = tuple(source.model_copy(update={"samples": min(source.samples, 16)}) for source in section.random)
    update = {"splits": section.splits.for_trial(), "programs": programs, "sampled": sampled, "random": random}
    return section.model_copy(update=update)


STAGE = Stage(
    name="shapeassembly",
    module=__name__,
    config=ShapeAssemblyConfig,
    inputs=("program_sampling",),
    plan=planned_shards,
    run_shard=run_shard,
    estimate_bytes=estimate_bytes,
    report=report,
    requested_samples=requested_samples,
    trial_config=trial_config,
)
