"""Stage `shapeassembly`: ShapeAssembly programs in; those that pass, as the shards `<dataset>-<split>-<index>.tar`.

Its first shards extract programs from part hierarchies, if there are any. Then one reads all programs, those of stage
`program_sampling` among them, refuses what is no program, and gives each of the others its split and shard.
A sample carries no
meshes: its text is the canonical program, and `stages.shapeassembly.shape.shape_of_text` executes it.
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
from stages.shapeassembly.acceptance import accepted_rows
from stages.shapeassembly.extraction.shards import extraction_shards, run_extraction
from stages.shapeassembly.language import ProgramDecoder, assignment_name
from stages.shapeassembly.origins import program_origins
from stages.shapeassembly.settings import ShapeAssemblyConfig
from stages.shapeassembly.sources import program_texts, source_digest
from stages.shapeassembly.splits import splits_of

BYTES_PER_PROGRAM = 12_000
"""A sample in its shard, and its line in the assignment."""


def planned_shards(plan: Plan) -> list[Shard]:
    """The extraction; when it is made, the assignment; when that is made, the shards of the collection."""
    config = plan.config.section(ShapeAssemblyConfig)
    if not config.has_sources:
        return []
    extraction = extraction_shards(plan.config.name, config.hierarchies)
    if any(plan.summary("shapeassembly", shard.name) is None for shard in extraction):
        return extraction
    digests = [source_digest(each.path) for each in config.programs]
    made = [("shapeassembly", shard.name) for shard in extraction]
    inputs = tuple(
        f"{stage}/{shard}"
        for stage, shard in (*made, *(("program_sampling", name) for name in plan.shards("program_sampling")))
    )
    assignment = Shard(assignment_name(plan.config.name), {"job": "assignment", "digests": digests}, inputs)
    summary = plan.summary("shapeassembly", assignment.name)
    if summary is None:
        return [*extraction, assignment]
    collection = planned_collection(plan, summary["shards"], (f"shapeassembly/{assignment.name}",))
    return [*extraction, assignment, *collection]


def run_shard(task: Task) -> Outcome:
    """A shard of the extraction, the assignment, or a shard of the collection."""
    if task.shard.params["job"] == "extraction":
        config = task.config.section(ShapeAssemblyConfig)
        return run_extraction(task, config.hierarchies, config.extraction, config.cleaning)
    return run_assignment(task) if task.shard.params["job"] == "assignment" else run_collection(task)


def run_assignment(task: Task) -> Outcome:
    """Read and check all programs, and share them out; programs of one signature stand in one split.

    Writes a file for each shard of the collection, `.<split>-<number>.jsonl`, one sample a line, and `.labels.json`,
    the part labels of all programs of each category, sorted. Raises ShardFailed for no program, or too many labels.
    """
    config = task.config.section(ShapeAssemblyConfig)
    refused: Counter[str] = Counter()
    rows = list(accepted_rows(task, config, refused))
    if not rows:
        why = ", ".join(f"{count:,} {reason}" for reason, count in refused.most_common(3))
        raise ShardFailed(f"no program was accepted; refused: {why or 'none'}")
    found: dict[str, set[str]] = {}
    for row in rows:
        found.setdefault(row["kit"], set()).update(row.pop("labels"))
    labels = {kit: sorted(found[kit]) for kit in sorted(found)}
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
    """How many programs there are and of how many structures, and why the others were refused."""
    name = assignment_name(plan.config.name)
    config = plan.config.section(ShapeAssemblyConfig)
    summary = plan.summary("shapeassembly", name) if config.has_sources else None
    if summary is None:
        return []
    extraction = [shard.name for shard in extraction_shards(plan.config.name, config.hierarchies)]
    counts = ", ".join(f"{count:,} {kit}" for kit, count in summary["programs"].items())
    refused: Counter[str] = Counter()
    for shard in (*extraction, name):
        refused.update(plan.rejects("shapeassembly", shard))
    why = ", ".join(f"{count:,} {reason}" for reason, count in refused.most_common())
    asked = [f"warning: {sentence}" for sentence in missing_licenses(program_origins(plan))]
    return [f"programs: {counts}; {summary['structures']:,} structures; refused: {why or 'none'}", *asked]


def estimate_bytes(plan: Plan) -> int:
    """Bytes of all samples, as far as they are known."""
    summary = plan.summary("shapeassembly", assignment_name(plan.config.name))
    return BYTES_PER_PROGRAM * sum(summary["programs"].values()) if summary else 0


def asked(config: Config) -> Sequence[int]:
    """The programs of each shard of the collection, if all are accepted."""
    section = config.section(ShapeAssemblyConfig)
    total = sum((1 + each.edits) * sum(1 for _ in program_texts(each.path, each.folder)) for each in section.programs)
    total += sum(len(each.source) for each in section.hierarchies) + sum(each.samples for each in section.sampled)
    return section.splits.shard_sizes(total)


def trial(config: Config) -> ShapeAssemblyConfig:
    """The same programs in shards of few, of edits and of models' programs a few."""
    section = config.section(ShapeAssemblyConfig)
    written = tuple(each.model_copy(update={"samples": min(each.samples, 16)}) for each in section.sampled)
    programs = tuple(each.model_copy(update={"edits": min(each.edits, 1)}) for each in section.programs)
    update = {"splits": section.splits.for_trial(), "programs": programs, "sampled": written}
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
    requested_samples=asked,
    trial_config=trial,
)
