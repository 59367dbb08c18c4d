"""Stage `primitives`: random compositions of solids, as the shards `<dataset>-<split>-<index>.tar`.

The first shards draw compositions. The assignment gives each its split and shard. A sample has no meshes: its text
lists its solids, and `stages.primitives.text.shape_of_text` makes the shape.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Sequence
from typing import Any

from pipeline.config import Config
from pipeline.errors import ShardFailed
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.primitives.language import KIT
from stages.primitives.settings import PrimitivesConfig
from stages.shape.collection.assignment import assign_splits, planned_collection, write_listed_samples, write_listings

BYTES_PER_SAMPLE = 8_000
SAMPLES_PER_DRAWING = 128
MAX_TRIES_PER_SAMPLE = 50
TRIAL_SAMPLES = 32


def plan(plan: Plan) -> list[Shard]:
    """Plan the drawing of compositions, the assignment and, once that is made, the collection."""
    samples = plan.config.section(PrimitivesConfig).samples
    if not samples:
        return []
    starts = range(0, samples, SAMPLES_PER_DRAWING)
    drawings = [
        Shard(f"drawing-{number:06d}", {"job": "drawing", "count": min(samples - start, SAMPLES_PER_DRAWING)})
        for number, start in enumerate(starts)
    ]
    inputs = tuple(f"primitives/{shard.name}" for shard in drawings)
    assignment = Shard(assignment_name(plan.config.name), {"job": "assignment", "drawings": len(drawings)}, inputs)
    summary = plan.summary("primitives", assignment.name)
    if summary is None:
        return [*drawings, assignment]
    collection = planned_collection(plan, summary["shards"], (f"primitives/{assignment.name}",))
    return [*drawings, assignment, *collection]


def assignment_name(dataset: str) -> str:
    """Return the name of the shard that assigns compositions to splits."""
    return f"{dataset}-assignment"


def run_shard(task: Task) -> Outcome:
    """Draw compositions, assign all, or write a shard of the collection."""
    jobs = {"drawing": run_drawing, "assignment": run_assignment, "collection": run_collection}
    return jobs[task.shard.params["job"]](task)


def run_drawing(task: Task) -> Outcome:
    """Draw compositions that meet the requirements, one JSON line each in `.jsonl`.

    Raises ShardFailed where too many tries in a row meet none.
    """
    from stages.primitives.compose import random_composition
    from stages.primitives.text import composition_text, shape_of_solids
    from stages.shape.physics.judge import unmet_requirement

    config, count = task.config.section(PrimitivesConfig), int(task.shard.params["count"])
    reasons: Counter[str] = Counter()
    with task.output(f"{task.shard.name}.jsonl") as stream:
        for number in range(count):
            rng = task.rng(number)
            for _ in range(MAX_TRIES_PER_SAMPLE):
                composition = config.compositions[int(rng.integers(len(config.compositions)))]
                solids = random_composition(composition, config, rng)
                reason = unmet_requirement(config.require, shape_of_solids(solids))
                if reason is None:
                    break
                reasons[reason] += 1
            else:
                raise ShardFailed(
                    f"{MAX_TRIES_PER_SAMPLE} compositions in a row are {reason}; relax primitives.require"
                )
            structure = " ".join([composition, *(solid.kind for solid in solids)])
            stream.write(json_bytes({"method": composition, "structure": structure, "text": composition_text(solids)}))
            task.progress(number + 1, count)
    for reason, refused in sorted(reasons.items()):
        task.reject("composition", reason, count=refused)
    return Outcome(0, {"drawn": count, "tries": count + sum(reasons.values())})


def run_assignment(task: Task) -> Outcome:
    """Assign all compositions to splits and shards; those of one structure share a split."""
    config = task.config.section(PrimitivesConfig)
    rows: list[dict[str, Any]] = []
    groups: dict[str, list[int]] = {}
    for number in range(task.shard.params["drawings"]):
        drawing = task.input("primitives", f"drawing-{number:06d}.jsonl").read_text(encoding="utf-8")
        for line in drawing.splitlines():
            row = json.loads(line)
            graph = hashlib.sha256(row["structure"].encode()).hexdigest()
            groups.setdefault(graph, []).append(len(rows))
            made = {"key": f"{KIT}-{len(rows):06d}", "kit": KIT, "graph": graph, "parents": [KIT]}
            rows.append({**made, "method": row["method"], "text": row["text"]})
    split_of = assign_splits(list(groups.values()), config.splits, task.rng("splits"))
    shards = write_listings(task, rows, split_of, config.splits)
    methods = dict(sorted(Counter(row["method"] for row in rows).items()))
    return Outcome(0, {"shards": shards, "shapes": methods, "structures": len(groups)})


def run_collection(task: Task) -> Outcome:
    """Write the samples of one shard."""
    return write_listed_samples(task, "primitives", assignment_name(task.config.name))


def report(plan: Plan) -> Sequence[str]:
    """Report shapes by composition, structures and rejects."""
    summary = plan.summary("primitives", assignment_name(plan.config.name))
    if summary is None or not plan.config.section(PrimitivesConfig).samples:
        return []
    rejected: Counter[str] = Counter()
    for shard in plan.shards("primitives"):
        rejected.update(plan.rejects("primitives", shard))
    shapes = ", ".join(f"{count:,} {method}" for method, count in summary["shapes"].items())
    why = ", ".join(f"{count:,} {reason}" for reason, count in sorted(rejected.items()))
    return [f"primitives: {shapes}; {summary['structures']:,} structures; rejected: {why or 'none'}"]


def requested_samples(config: Config) -> Sequence[int]:
    """Return the shapes of each shard of the collection."""
    section = config.section(PrimitivesConfig)
    sizes: list[int] = section.splits.shard_sizes(section.samples)
    return sizes


def trial_config(config: Config) -> PrimitivesConfig:
    """Return a config with a few shapes."""
    section = config.section(PrimitivesConfig)
    update = {"samples": min(section.samples, TRIAL_SAMPLES), "splits": section.splits.for_trial()}
    return section.model_copy(update=update)


STAGE = Stage(
    name="primitives",
    module=__name__,
    config=PrimitivesConfig,
    inputs=(),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=lambda plan: 2 * BYTES_PER_SAMPLE * plan.config.section(PrimitivesConfig).samples,
    report=report,
    requested_samples=requested_samples,
    trial_config=trial_config,
)
