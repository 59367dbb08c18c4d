"""Stage `grammars`: meshes in one piece and clouds in; random and resized shapes of their grammars out.

The first shards extract a grammar each: `<name>.json`, `<name>.tar`, `<name>.png`. One shard then samples the shapes of
all grammars and assigns them to splits and shards. It rejects shapes that collide or look like earlier ones. The
samples are in the shards `<dataset>-<split>-<index>.tar`. A sample has no meshes: its text is its derivation, which
`stages.grammars.derived_shape.shape_of_text` turns into the shape.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from pipeline.config import Config
from pipeline.errors import ShardFailed
from pipeline.paths import file_digest
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.grammars.language import drawing_name, grammar_shards, input_grammars
from stages.grammars.origins import mesh_origins
from stages.grammars.settings import GrammarConfig, GrammarsConfig
from stages.shape.collection.assignment import assign_splits, planned_collection, write_listed_samples, write_listings
from stages.shape.collection.origin import missing_licenses

BYTES_PER_GRAMMAR = 20_000_000
BYTES_PER_SAMPLE = 4_000
TRIAL_SHAPES = 8
"""Shapes by each method in a trial run."""


def planned_shards(plan: Plan) -> list[Shard]:
    """Return the shards of the grammars, of the sampling, and, when that is finished, of the collection."""
    config = plan.config.section(GrammarsConfig)
    if not config.models:
        return []
    shards = [
        Shard(name, {"job": "extraction", "digest": file_digest(model.model)})
        for name, model in zip(grammar_shards(plan.config), config.models, strict=True)
    ]
    inputs = tuple(f"grammars/{shard.name}" for shard in shards)
    drawing = Shard(drawing_name(plan.config.name), {"job": "drawing"}, inputs)
    summary = plan.summary("grammars", drawing.name)
    if summary is None:
        return [*shards, drawing]
    collection = planned_collection(plan, summary["shards"], (f"grammars/{drawing.name}",))
    return [*shards, drawing, *collection]


def run_shard(task: Task) -> Outcome:
    """Extract a grammar, sample all shapes, or write a shard of the collection."""
    jobs = {"extraction": run_extraction, "drawing": run_drawing, "collection": run_collection}
    return jobs[task.shard.params["job"]](task)


def run_extraction(task: Task) -> Outcome:
    """Read a mesh or a cloud, extract its grammar and write it. Raises ShardFailed if nothing can be exchanged."""
    from stages.grammars.description import describe_grammar
    from stages.grammars.extraction.extract import extract_grammar
    from stages.grammars.files import write_grammar
    from stages.grammars.picture import grammar_sheet
    from stages.grammars.read_surface import read_surface

    names = grammar_shards(task.config)
    config = task.config.section(GrammarsConfig).models[names.index(task.shard.name)]
    surface, file_up, warnings = read_surface(config.model, units=config.units)
    up = config.up if config.up != "auto" else file_up or "y"
    extracted = extract_grammar(surface, config.name, config.radius, up, task.rng("sets"), config.upright)
    grammar = extracted.grammar
    if len(grammar.productions) < 2 and not grammar.grids:
        raise ShardFailed(
            f"{config.model}: nothing in it can be exchanged, because its {extracted.transforms} symmetries have no "
            f"docking site; set grammars.models[{config.name}].radius smaller, or take it by its parts: exemplars.kits"
        )
    description = describe_grammar(extracted)
    with task.output(f"{task.shard.name}.json") as text, task.output(f"{task.shard.name}.tar") as arrays:
        write_grammar(description, grammar, text, arrays)
    with task.output(f"{task.shard.name}.png") as picture:
        picture.write(grammar_sheet(extracted))
    return Outcome(
        samples=0,
        summary={
            "made_of": f"{len(grammar.exemplar.faces):,} {grammar.made_of}",
            "transforms": extracted.transforms,
            "sites": extracted.site_classes,
            "docked_pieces": len(extracted.docked_pieces),
            "productions": len(grammar.productions),
            "grids": [list(grid.counts) for grid in grammar.grids],
            "warnings": warnings,
        },
    )


def run_drawing(task: Task) -> Outcome:
    """Sample the shapes of all grammars and assign them to splits; shapes that look alike count once.

    Writes a file for each shard of the collection, `.<split>-<number>.jsonl`, one sample a line. Raises ShardFailed if
    there are no shapes.
    """
    config = task.config.section(GrammarsConfig)
    rows: list[dict[str, Any]] = []
    for model in config.models:
        rows += _sampled_rows(task, model, len(rows))
    if not rows:
        raise ShardFailed("; ".join(shortfall_message(model, 0) for model in config.models))
    groups: dict[str, list[int]] = {}
    for index, row in enumerate(rows):
        groups.setdefault(row["graph"], []).append(index)
    split_of = assign_splits(list(groups.values()), config.splits, task.rng("splits"))
    shards = write_listings(task, rows, split_of, config.splits)
    counts = {
        model.name: dict(Counter(row["method"] for row in rows if row["kit"] == model.name)) for model in config.models
    }
    return Outcome(0, {"shards": shards, "shapes": counts})


def _sampled_rows(task: Task, config: GrammarConfig, first: int) -> list[dict[str, Any]]:
    """Return the shapes of one grammar as rows, numbered from `first` on."""
    from stages.grammars.distinct_shapes import DistinctShapes, requested_counts

    sampler = DistinctShapes(
        input_grammars(task)[config.name],
        config,
        lambda *decision: task.rng(config.name, *decision),
        lambda reason: task.reject(config.name, reason),
    )
    rows: list[dict[str, Any]] = []
    for method, limit in requested_counts(config).items():
        for shape in sampler.shapes(method, limit):
            rows.append(
                {
                    "key": f"{config.name}-{first + len(rows):06d}",
                    "kit": config.name,
                    "graph": shape.digest,
                    "method": method,
                    "parents": ["/".join(config.model.parts[-2:])],
                    "text": shape.text,
                }
            )
            task.progress(len(rows), config.requested_shapes)
    return rows


def shortfall_message(config: GrammarConfig, count: int) -> str:
    """Return what to say of a grammar that gives fewer shapes than requested, in one sentence."""
    requested = config.requested_shapes
    return (
        f"{config.name}: {count:,} of {requested:,} requested shapes; all others that its grammar gives collide with "
        f"themselves, or look like the exemplar or one of these (min_difference {config.min_difference:g}). Set "
        f"grammars.models[{config.name}].radius smaller, which finds more sites, or min_difference smaller, or take "
        "the model by its parts: exemplars.kits"
    )


def run_collection(task: Task) -> Outcome:
    """Write the samples of one shard."""
    return write_listed_samples(task, "grammars", drawing_name(task.config.name))


def report(plan: Plan) -> Sequence[str]:
    """Return lines on each grammar, its shapes, reasons of rejection, and warnings."""
    lines = []
    for name in grammar_shards(plan.config):
        summary = plan.summary("grammars", name)
        if summary is not None:
            grids = ", ".join(" x ".join(map(str, counts)) for counts in summary["grids"]) or "none"
            lines.append(
                f"{name}: {summary['made_of']}, {summary['transforms']} symmetries, {summary['docked_pieces']} docked "
                f"pieces at {summary['sites']} classes of sites, {summary['productions']} productions; grids: {grids}"
            )
            lines += [f"warning: {name}: {sentence}" for sentence in summary["warnings"]]
    drawing = drawing_name(plan.config.name)
    sampled = plan.summary("grammars", drawing) if lines else None
    if sampled is not None:
        counts = [(count, name, method) for name, of in sampled["shapes"].items() for method, count in of.items()]
        shapes = "; ".join(f"{count:,} {name}, {method}" for count, name, method in counts)
        rejects = sorted(plan.rejects("grammars", drawing).items())
        lines.append(f"shapes: {shapes}; rejected: {', '.join(f'{n:,} {reason}' for reason, n in rejects) or 'none'}")
        for model in plan.config.section(GrammarsConfig).models:
            total = sum(sampled["shapes"][model.name].values())
            lines += [f"warning: {shortfall_message(model, total)}"] if total < model.requested_shapes else []
    lines += [f"warning: {sentence}" for sentence in missing_licenses(mesh_origins(plan))]
    return lines


def requested_samples(config: Config) -> Sequence[int]:
    """Return the numbers of samples in the shards of the collection, if all requested shapes are found."""
    section = config.section(GrammarsConfig)
    return section.splits.shard_sizes(sum(model.requested_shapes for model in section.models))


def trial_config(config: Config) -> GrammarsConfig:
    """Return the same grammars with few shapes of each."""
    section = config.section(GrammarsConfig)
    models = tuple(
        model.model_copy(
            update={
                "random_shapes": min(model.random_shapes, TRIAL_SHAPES),
                "resized_grids": min(model.resized_grids, TRIAL_SHAPES),
            }
        )
        for model in section.models
    )
    return section.model_copy(update={"models": models, "splits": section.splits.for_trial()})


def estimate_bytes(plan: Plan) -> int:
    """Estimate the size of the grammars and of all samples."""
    samples = int(np.sum(requested_samples(plan.config)))
    return BYTES_PER_GRAMMAR * len(grammar_shards(plan.config)) + BYTES_PER_SAMPLE * samples


STAGE = Stage(
    name="grammars",
    module=__name__,
    keep_output=True,
    config=GrammarsConfig,
    inputs=(),
    plan=planned_shards,
    run_shard=run_shard,
    estimate_bytes=estimate_bytes,
    report=report,
    requested_samples=requested_samples,
    trial_config=trial_config,
)
