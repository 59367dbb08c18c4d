"""Stage `mixture`: the samples of all producers in; one collection out, as the shards `<dataset>-<split>-<index>.tar`.

Its first shards, one for each shard of a producer, list its samples with their clouds. The assignment leaves out near
copies between splits and assigns the others to shards. The shards of the collection then read their samples.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.config import Config
from pipeline.errors import ConfigError
from pipeline.shards import ShardWriter, array_bytes, bytes_array, json_bytes
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.mixture.contrast import NO_CONTRAST, contrast_fields, falling_partner, find_contrast
from stages.mixture.language import LANGUAGE
from stages.mixture.settings import MixtureConfig
from stages.shape.collection.assignment import SPLITS, SplitConfig, planned_collection, write_listings
from stages.shape.collection.discovery import language_of, producers
from stages.shape.collection.language import ShapeDecoder
from stages.shape.collection.shards import PRODUCERS
from stages.shape.physics.settings import PhysicsConfig
from stages.shape.sample import Sample, read_samples, write_sample
from stages.shape.shape import upright
from stages.validity.settings import ValidityConfig

BYTES_PER_SAMPLE = 70_000
"""Its two clouds, and the sample again."""

Row = dict[str, Any]


def plan(plan: Plan) -> list[Shard]:
    """Plan the listings of all producers' shards, then the assignment and, once that is made, the collection.

    After a change of code a producer may be back at its first shards, while listings of the others still count.
    """
    if not plan.config.section(MixtureConfig).enabled:
        return []
    makers = [name for name, declared in producers().items() if not declared.joins and plan.shards(name)]
    listings = [shard for maker in makers for shard in _listing_shards(plan, maker)]
    known = all(plan.summary("mixture", shard.name) is not None for shard in listings)
    reads = LANGUAGE.reads(plan)
    planned = all(name in plan.shards(stage) for stage, _, name in (source.partition("/") for source in reads))
    if not listings or not known or not planned:
        return listings
    assignment = Shard(
        f"{plan.config.name}-assignment",
        {"job": "assignment", "listings": [shard.name for shard in listings], "joined": makers},
        (*reads, *(f"mixture/{shard.name}" for shard in listings)),
    )
    summary = plan.summary("mixture", assignment.name)
    if summary is None:
        return [*listings, assignment]
    sources = tuple(source for shard in listings for source in shard.inputs[:1])
    pairs = _contrast_params(plan.config, makers)
    inputs = (*sources, f"mixture/{assignment.name}", *(reads if pairs else ()))
    collection = planned_collection(plan, summary["shards"], tuple(dict.fromkeys(inputs)))
    return [*listings, assignment, *(replace(shard, params={**shard.params, **pairs}) for shard in collection)]


def _contrast_params(config: Config, makers: Sequence[str]) -> dict[str, Any]:
    """Return what a shard of the collection needs to make pairs; nothing if the config asks for none."""
    if not config.section(MixtureConfig).contrast:
        return {}
    return {"joined": list(makers), "physics": config.section(ValidityConfig).model_dump(exclude={"falls"})}


def _listing_shards(plan: Plan, maker: str) -> list[Shard]:
    read = language_of(maker).reads(plan)
    shards = []
    for name in plan.shards(maker):
        summary = plan.summary(maker, name)
        if summary is not None and "split" in summary:
            params = {"job": "listing", "producer": maker, "shard": name}
            shards.append(Shard(f"{maker}-{name}", params, (f"{maker}/{name}", *read)))
    return shards


def run_shard(task: Task) -> Outcome:
    """List the samples of a producer's shard, assign all samples, or write a shard of the collection."""
    jobs = {"listing": run_listing, "assignment": run_assignment, "collection": run_collection}
    return jobs[task.shard.params["job"]](task)


def run_listing(task: Task) -> Outcome:
    """List the samples of one shard of a producer.

    Files of the shard:
        `.jsonl`: key, kit, graph and parents of each sample, one a line
        `.clouds.npy`: `unit_clouds` of each, float32 (k, 2, n, 3)
        `.features.npy`: `copy_features` of each, and the distance of its clouds last, float64 (k, 9)
    """
    from stages.mixture.near_copies import POINTS_PER_CLOUD, copy_features, unit_clouds
    from stages.shape.collection.collection import Collection
    from stages.shape.geometry.bounds import shape_bounds

    collection, name = Collection(task), task.shard.params["shard"]
    clouds, extents = [], []
    with task.output(f"{task.shard.name}.jsonl") as stream:
        for sample in collection.samples(name):
            shape = collection.shape(sample)
            low, high = shape_bounds(shape)
            clouds.append(unit_clouds(shape, task.rng(sample.key)))
            extents.append((high - low) / np.linalg.norm(high - low))
            row = {"key": sample.key, "kit": sample.kit, "graph": sample.graph}
            stream.write(json_bytes({**row, "parents": list(sample.lineage.get("parents", ()))}))
    both = np.array(clouds, np.float32).reshape(-1, 2, POINTS_PER_CLOUD, 3)
    features = np.column_stack(copy_features(both, np.array(extents, np.float64).reshape(-1, 3)))
    for what, array in (("clouds", both), ("features", features)):
        with task.output(f"{task.shard.name}.{what}.npy") as stream:
            stream.write(array_bytes(array))
    return Outcome(0, {"listed": len(clouds)})


def run_assignment(task: Task) -> Outcome:
    """Leave out what is too much or a near copy in another split, and assign the other samples to shards.

    Writes `.<split>-<number>.jsonl` for each shard of the collection: producer, shard and key of each sample, its key
    in the mixture, and its parents. Raises ConfigError for two producers with kits of one name and other labels,
    and for a maximum of an unknown kit.
    """
    LANGUAGE.decoder(task)
    config = task.config.section(MixtureConfig)
    rows = [row for listing in task.shard.params["listings"] for row in _listed_rows(task, listing)]
    unknown = sorted(set(config.max_samples) - {row["kit"] for row in rows})
    if unknown:
        kits = ", ".join(dict.fromkeys(row["kit"] for row in rows))
        raise ConfigError(f"mixture.max_samples: there are no samples of {', '.join(unknown)}; it may name {kits}")
    splits = np.array([SPLITS.index(row["split"]) for row in rows], dtype=np.int64)
    out: dict[int, str] = {}
    for number in _copies(task, rows, splits):
        out[number] = "a sample of another producer and split is too near"
    for number in _surplus(task, rows, splits, out, config.max_samples):
        out[number] = "more than mixture.max_samples"
    for number, reason in out.items():
        task.reject(rows[number]["mixed_key"], reason)
    kept = [number for number in range(len(rows)) if number not in out]
    parents = _named_parents(rows, kept)
    listed = [
        {"producer": row["producer"], "shard": row["shard"], "key": row["key"], "mixed_key": row["mixed_key"]}
        for row in rows
    ]
    chosen = [{**listed[number], "parents": parents[number]} for number in kept]
    shards = write_listings(task, chosen, splits[kept], config.shards, config.shuffle)
    counts = Counter((rows[number]["producer"], rows[number]["kit"], rows[number]["split"]) for number in kept)
    by_source: dict[str, dict[str, int]] = {}
    for (producer, kit, split), count in sorted(counts.items()):
        by_source.setdefault(f"{producer}: {kit}", {})[split] = count
    return Outcome(0, {"shards": shards, "samples": by_source, "left_out": dict(Counter(out.values()))})


def _listed_rows(task: Task, listing: str) -> Iterator[Row]:
    """Yield the samples of a listing, each with its producer, shard, split, and key in the mixture."""
    producer, _, shard = listing.partition("-")
    split = shard.removeprefix(f"{task.config.name}-").partition("-")[0]
    for line in task.input("mixture", f"{listing}.jsonl").read_text(encoding="utf-8").splitlines():
        row = json.loads(line)
        yield {**row, "producer": producer, "shard": shard, "split": split, "mixed_key": f"{producer}-{row['key']}"}


def _copies(task: Task, rows: Sequence[Row], splits: npt.NDArray[np.int64]) -> list[int]:
    """Return the samples to leave out so that no near copies and no equal graphs of two producers are in two splits."""
    from stages.mixture.near_copies import near_copy_pairs
    from stages.mixture.rivals import left_out

    listings = task.shard.params["listings"]
    read = [bytes_array(task.input("mixture", f"{name}.features.npy").read_bytes()) for name in listings]
    starts, features = np.cumsum([0, *map(len, read)]), np.concatenate(read)

    def cloud_of(number: int) -> npt.NDArray[np.float32]:
        place = int(np.searchsorted(starts, number, side="right")) - 1
        path = task.input("mixture", f"{listings[place]}.clouds.npy")
        cloud: npt.NDArray[np.float32] = np.load(path, mmap_mode="r", allow_pickle=False)[number - starts[place], 0]
        return cloud

    makers = np.array([task.shard.params["joined"].index(row["producer"]) for row in rows], dtype=np.int64)
    numbers: dict[tuple[str, str], int] = {}
    graphs = [numbers.setdefault((row["kit"], row["graph"]), len(numbers)) for row in rows]
    groups = np.array(graphs, dtype=np.int64)
    pairs = near_copy_pairs(features[:, :-1], features[:, -1], cloud_of, groups, makers, splits)
    return left_out(pairs, groups, makers, splits)


def _surplus(
    task: Task,
    rows: Sequence[Row],
    splits: npt.NDArray[np.int64],
    out: Mapping[int, str],
    max_samples: Mapping[str, int],
) -> Iterator[int]:
    """Yield samples beyond the maximum of their kit, the same share of each split at random."""
    groups: dict[tuple[str, str], list[int]] = {}
    for number, row in enumerate(rows):
        if number not in out and row["kit"] in max_samples:
            groups.setdefault((row["producer"], row["kit"]), []).append(number)
    for (producer, kit), group in groups.items():
        shuffled = task.rng("surplus", producer, kit).permutation(group)
        left, share = min(max_samples[kit], len(group)), min(max_samples[kit] / len(group), 1.0)
        for split in reversed(range(len(SPLITS))):
            own = shuffled[splits[shuffled] == split]
            count = min(int(share * len(own)), left) if split else left  # train gets what rounding leaves
            yield from own[count:].tolist()
            left -= min(count, len(own))


def _named_parents(rows: Sequence[Row], kept: Iterable[int]) -> dict[int, list[str]]:
    """Return the parents of each kept sample: other kept samples by their key in the mixture, and exemplars or files.

    A parent that is left out is replaced by its own parents.
    """
    numbers = {(row["producer"], row["key"]): number for number, row in enumerate(rows)}
    present = set(kept)

    def named(number: int, seen: frozenset[int]) -> dict[str, None]:
        names: dict[str, None] = {}
        for parent in rows[number]["parents"]:
            known = numbers.get((rows[number]["producer"], parent))
            if known is None:
                names[parent] = None
            elif known in present:
                names[rows[known]["mixed_key"]] = None
            elif known not in seen:
                names.update(named(known, seen | {known}))
        return names

    return {number: list(named(number, frozenset({number}))) for number in sorted(present)}


def run_collection(task: Task) -> Outcome:
    """Write the samples of one shard, with the lineage of their producers as a text that all samples have.

    If the config asks for pairs, the partner of a sample follows it.
    """
    params = task.shard.params
    listing = task.input("mixture", f"{task.config.name}-assignment.{params['split']}-{params['number']:06d}.jsonl")
    rows = [json.loads(line) for line in listing.read_text(encoding="utf-8").splitlines()]
    wanted = {(row["producer"], row["shard"], row["key"]) for row in rows}
    samples: dict[tuple[str, str], Sample] = {}
    for producer, shard in sorted({(row["producer"], row["shard"]) for row in rows}):
        for sample in read_samples(task.input(producer, f"{shard}.tar")):
            if (producer, shard, sample.key) in wanted:
                samples[producer, sample.key] = sample
    counts, pairs = Counter[str](), Counter[str]()
    decoder = LANGUAGE.decoder(task) if "physics" in params else None
    with task.output(f"{task.shard.name}.tar") as stream, ShardWriter(stream) as writer:
        for row in rows:
            mixed = [_mixed(samples[row["producer"], row["key"]], row["mixed_key"], row["parents"])]
            if decoder is not None:
                mixed = _with_partner(task, decoder, mixed[0], pairs)
            for sample in mixed:
                write_sample(writer, sample)
                counts[sample.producer] += 1
            task.progress(writer.samples, len(rows))
    made = {"pairs": dict(pairs)} if decoder is not None else {}
    summary = {"split": params["split"], "samples": writer.samples, "producers": dict(counts), **made}
    return Outcome(writer.samples, summary)


def _with_partner(task: Task, decoder: ShapeDecoder, sample: Sample, pairs: Counter[str]) -> list[Sample]:
    """Return a sample, and its partner that falls if there is one, with the field `contrast` of their lineages.

    pairs: number of pairs by edit and cause, which is counted up
    """
    physics = PhysicsConfig.model_validate(task.shard.params["physics"])
    shape = upright(decoder.shape(sample))
    contrast = find_contrast(shape, physics, task.rng("contrast", sample.key))
    if contrast is None:
        return [replace(sample, lineage={**sample.lineage, "contrast": dict(NO_CONTRAST)})]
    pairs[f"a part is {contrast.edit.kind}: {contrast.cause}"] += 1
    falling = falling_partner(sample, shape, language_of(sample.producer).name, contrast)
    fields = contrast_fields(shape, contrast, (sample.key, falling.key))
    lineage = {"method": "contrast", "parents": [sample.key], "details": "{}", "contrast": fields[1]}
    return [
        replace(sample, lineage={**sample.lineage, "contrast": fields[0]}),
        replace(falling, producer=LANGUAGE.name, lineage=lineage),
    ]


def _mixed(sample: Sample, key: str, parents: Sequence[str]) -> Sample:
    details = {name: value for name, value in sample.lineage.items() if name not in ("method", "parents")}
    lineage = {
        "method": sample.lineage.get("method", sample.producer),
        "parents": list(parents) or [sample.kit],
        "details": json_bytes(details).decode().strip(),
    }
    return replace(sample, key=key, lineage=lineage)


def report(plan: Plan) -> Sequence[str]:
    """Report the samples of each producer and kit, and what was left out."""
    summary = plan.summary("mixture", f"{plan.config.name}-assignment")
    if summary is None or not plan.config.section(MixtureConfig).enabled:
        return []
    lines = [
        f"{source}: {sum(counts.values()):,} samples ({', '.join(f'{split} {n:,}' for split, n in counts.items())})"
        for source, counts in summary["samples"].items()
    ]
    out = ", ".join(f"{count:,} {reason}" for reason, count in sorted(summary["left_out"].items()))
    lines.append(f"left out: {out or 'none'}")
    if plan.config.section(MixtureConfig).contrast:
        made = (plan.summary("mixture", shard) or {} for shard in plan.shards("mixture"))
        lines.append(f"pairs: {sum(sum(of_shard.get('pairs', {}).values()) for of_shard in made):,}")
    return lines


def check_contrast(config: Config) -> None:
    """Raise ConfigError for a config that asks for pairs whose records would not say which of the two falls."""
    if config.section(MixtureConfig).contrast and not config.section(ValidityConfig).falls:
        raise ConfigError(
            f"{config.path}: mixture.contrast needs to know which shapes fall; set `validity.falls: true`"
        )


def requested_samples(config: Config) -> Sequence[int]:
    """Return the samples of each shard if every producer makes what is asked of it and none is left out.

    With pairs, this is as if each sample got a partner.
    """
    from pipeline.registry import find_stages

    section = config.section(MixtureConfig)
    if not section.enabled:
        return ()
    makers = [stage for name, stage in find_stages().items() if name in producers() and name != "mixture"]
    total = sum(count for maker in makers for count in maker.requested_samples(config))
    sizes: list[int] = SplitConfig(**section.shards.model_dump()).shard_sizes(total)
    return [size * (1 + section.contrast) for size in sizes]


def trial_config(config: Config) -> MixtureConfig:
    """Return the same mixture in small shards."""
    section = config.section(MixtureConfig)
    return section.model_copy(update={"shards": section.shards.for_trial()})


def estimate_bytes(plan: Plan) -> int:
    """Estimate the bytes of the clouds and of the samples, as far as they are known."""
    summaries = [plan.summary("mixture", shard) or {} for shard in plan.shards("mixture")]
    listed: int = sum(summary.get("listed", 0) for summary in summaries)
    return BYTES_PER_SAMPLE * listed


STAGE = Stage(
    name="mixture",
    module=__name__,
    config=MixtureConfig,
    inputs=(PRODUCERS,),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=estimate_bytes,
    report=report,
    requested_samples=requested_samples,
    trial_config=trial_config,
    check=check_contrast,
    sections=("validity",),
)
