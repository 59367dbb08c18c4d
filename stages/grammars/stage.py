"""Stage `grammars`: meshes in one piece and clouds in; random and resized shapes of their grammars out, as the shards
`<dataset>-<split>-<index>.tar`.

Its first shards extract a grammar each: `<name>.json`, `<name>.tar`, `<name>.png`. Then one draws the shapes of all of
them, refuses what collides or was drawn before, and gives each of the others its split and shard. A sample carries no
meshes: its text is its derivation, and `stages.grammars.derivation_text.shape_of_text` makes the shape.
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

BYTES_A_GRAMMAR = 20_000_000
BYTES_A_SAMPLE = 4_000


def planned_shards(plan: Plan) -> list[Shard]:
    """The grammars; the drawing of all shapes; when that is made, the shards of the collection."""
    config = plan.config.section(GrammarsConfig)
    if not config.models:
        return []
    shards = [
        Shard(name, {"job": "extraction", "digest": file_digest(each.model)})
        for name, each in zip(grammar_shards(plan.config), config.models, strict=True)
    ]
    inputs = tuple(f"grammars/{each.name}" for each in shards)
    drawing = Shard(drawing_name(plan.config.name), {"job": "drawing"}, inputs)
    summary = plan.summary("grammars", drawing.name)
    if summary is None:
        return [*shards, drawing]
    collection = planned_collection(plan, summary["shards"], (f"grammars/{drawing.name}",))
    return [*shards, drawing, *collection]


def run_shard(task: Task) -> Outcome:
    """A grammar, the drawing of all shapes, or a shard of the collection."""
    jobs = {"extraction": run_extraction, "drawing": run_drawing, "collection": run_collection}
    return jobs[task.shard.params["job"]](task)


def run_extraction(task: Task) -> Outcome:
    """Read a mesh or a cloud, find its grammar, write it. Raises ShardFailed for one in which nothing can be
    exchanged."""
    from stages.grammars.description import describe_grammar
    from stages.grammars.extraction.extract import extract_grammar
    from stages.grammars.files import write_grammar
    from stages.grammars.picture import grammar_sheet
    from stages.grammars.read_surface import read_surface

    names = grammar_shards(task.config)
    config = task.config.section(GrammarsConfig).models[names.index(task.shard.name)]
    surface, said = read_surface(config.model)
    up = config.up if config.up != "auto" else said or "y"
    found = extract_grammar(surface, config.name, config.radius, up, task.rng("sets"), config.upright)
    if len(found.grammar.productions) < 2 and not found.grammar.grids:
        raise ShardFailed(
            f"{config.model}: nothing in it can be exchanged, {found.transforms} transforms leave no docking site; set "
            f"grammars.models[{config.name}].radius smaller, or take it by its parts: exemplars.kits"
        )
    described = describe_grammar(found)
    with task.output(f"{task.shard.name}.json") as text, task.output(f"{task.shard.name}.tar") as arrays:
        write_grammar(described, found.grammar, text, arrays)
    with task.output(f"{task.shard.name}.png") as picture:
        picture.write(grammar_sheet(found))
    return Outcome(
        samples=0,
        summary={
            "made_of": f"{len(found.grammar.exemplar.faces):,} {found.grammar.made_of}",
            "motions": found.transforms,
            "sites": len({each.site for each in found.docked_pieces}),
            "dockers": len(found.docked_pieces),
            "rules": len(found.grammar.productions),
            "grids": [list(each.counts) for each in found.grammar.grids],
        },
    )


def run_drawing(task: Task) -> Outcome:
    """Draw the shapes of all grammars, and share them out; shapes that look alike are one.

    Writes a file for each shard of the collection, `.<split>-<number>.jsonl`, one sample a line. Raises ShardFailed
    where there are no shapes.
    """
    from stages.grammars.distinct_shapes import shortfall_message

    config = task.config.section(GrammarsConfig)
    rows: list[dict[str, Any]] = []
    for each in config.models:
        rows += _drawn(task, each, len(rows))
    if not rows:
        raise ShardFailed("; ".join(shortfall_message(each, 0) for each in config.models))
    groups: dict[str, list[int]] = {}
    for index, row in enumerate(rows):
        groups.setdefault(row["graph"], []).append(index)
    split_of = assign_splits(list(groups.values()), config.splits, task.rng("splits"))
    shards = write_listings(task, rows, split_of, config.splits)
    counts = {
        each.name: dict(Counter(row["method"] for row in rows if row["kit"] == each.name)) for each in config.models
    }
    return Outcome(0, {"shards": shards, "shapes": counts})


def _drawn(task: Task, config: GrammarConfig, first: int) -> list[dict[str, Any]]:
    """The shapes of one grammar as rows, `first` rows being there already."""
    from stages.grammars.distinct_shapes import DistinctShapes, requested_counts

    variety = DistinctShapes(
        input_grammars(task)[config.name],
        config,
        lambda *decision: task.rng(config.name, *decision),
        lambda reason: task.reject(config.name, reason),
    )
    rows: list[dict[str, Any]] = []
    for method, most in requested_counts(config).items():
        for drawn in variety.shapes(method, most):
            rows.append(
                {
                    "key": f"{config.name}-{first + len(rows):06d}",
                    "kit": config.name,
                    "graph": drawn.digest,
                    "method": method,
                    "parents": ["/".join(config.model.parts[-2:])],
                    "text": drawn.text,
                }
            )
            task.progress(len(rows), config.instances + config.resized)
    return rows


def run_collection(task: Task) -> Outcome:
    """Write the samples of one shard."""
    return write_listed_samples(task, "grammars", drawing_name(task.config.name))


def report(plan: Plan) -> Sequence[str]:
    """What each grammar has, how many shapes were drawn of it, why others were refused, and where there are no more."""
    from stages.grammars.distinct_shapes import shortfall_message

    lines = []
    for name in grammar_shards(plan.config):
        seen = plan.summary("grammars", name)
        if seen is not None:
            grids = ", ".join(" x ".join(map(str, each)) for each in seen["grids"]) or "none"
            lines.append(
                f"{name}: {seen['made_of']}, {seen['motions']} motions, {seen['dockers']} dockers at "
                f"{seen['sites']} classes of sites, {seen['rules']} rules; grids: {grids}"
            )
    drawing = drawing_name(plan.config.name)
    made = plan.summary("grammars", drawing) if lines else None
    if made is not None:
        shapes = "; ".join(
            f"{count:,} {name}, {method}" for name, each in made["shapes"].items() for method, count in each.items()
        )
        why = ", ".join(f"{count:,} {reason}" for reason, count in sorted(plan.rejects("grammars", drawing).items()))
        lines.append(f"shapes: {shapes}; refused: {why or 'none'}")
        for each in plan.config.section(GrammarsConfig).models:
            count = sum(made["shapes"][each.name].values())
            lines += [f"warning: {shortfall_message(each, count)}"] if count < each.instances + each.resized else []
    lines += [f"warning: {sentence}" for sentence in missing_licenses(mesh_origins(plan))]
    return lines


def asked(config: Config) -> Sequence[int]:
    """The shapes of each shard of the collection, if as many are found as are asked for."""
    section = config.section(GrammarsConfig)
    return section.splits.shard_sizes(sum(each.instances + each.resized for each in section.models))


def trial(config: Config) -> GrammarsConfig:
    """The same grammars, and few shapes of each."""
    section = config.section(GrammarsConfig)
    models = tuple(
        each.model_copy(update={"instances": min(each.instances, 8), "resized": min(each.resized, 8)})
        for each in section.models
    )
    return section.model_copy(update={"models": models, "splits": section.splits.for_trial()})


def estimate_bytes(plan: Plan) -> int:
    """Bytes of the grammars and of all samples."""
    return BYTES_A_GRAMMAR * len(grammar_shards(plan.config)) + BYTES_A_SAMPLE * int(np.sum(asked(plan.config)))


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
    requested_samples=asked,
    trial_config=trial,
)
