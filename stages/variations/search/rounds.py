"""The search in rounds: lanes look for variants beside each other, then a pool shard keeps what is new.

A round of a kit is some lane shards `<kit>-r<round>-lane<k>` and one pool shard `<kit>-r<round>-pool`. Lanes draw
their parents from the pools of all earlier rounds; what a lane does depends on its number and never on who runs it.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.config import Config
from pipeline.stage import Outcome, Plan, Shard, Task
from stages.exemplars.settings import ExemplarsConfig
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.kit import Kit
from stages.shape.kit_input import input_kit
from stages.shape.physics.judge import unmet_requirement
from stages.shape.resolved_settings import MAX_COPIED_SHARE_KEY, REQUIRED_LABELS_KEY, STABLE_KEY, resolved_settings
from stages.shape.shape import kit_shape
from stages.variations.constraint import build_repair, build_test, module_of
from stages.variations.novelty.archive import cell_of
from stages.variations.report.advice import SAME_LAYOUT, what_keeps, what_was_left
from stages.variations.report.measures import pool_measures
from stages.variations.requirements.hub_restoration import HUBS_NOT_RESTORED, auto_min_hubs, hub_restorer
from stages.variations.requirements.required_labels import LABELS_MISSING, labels_test
from stages.variations.search.pool import FoundVariants, PoolIndex, write_kept, write_variants
from stages.variations.search.search import SPARE, Search, Variant
from stages.variations.settings import VariationsConfig

ROUND_FIND = 400
"""Most variants that one lane finds in a round before the lanes exchange what they have."""
ROUND_SHARE = 40
"""Unless that would make more rounds than about so many: a large pool grows in larger steps."""
PATIENCE, LEAST_PATIENCE = 200_000, 40_000
PATIENT_PARTS = 100
"""A try takes the longer the more parts there are: exemplars of more than so many have less than PATIENCE tries."""
SLOW, SLOW_CHOICE = 10, 2
"""Where a search has become slow it ends: when what is missing of the variants wanted would take so many times the
tries so far, and when there are as many as are wanted, what is missing to choose from."""
COUNTED = ("crossings", "lists", "rejects", "resized")
"""What lanes count, by name, and pools add up."""
FEWEST = 32
"""A lane looks for at least so many variants, so that the last rounds are not mere starts and stops."""


def search_shards(plan: Plan, kit: str) -> tuple[list[Shard], bool]:
    """The rounds of a kit's search as far as they can be planned now, and whether the search has ended."""
    config = plan.config.section(VariationsConfig)
    shards: list[Shard] = []
    found: list[str] = []
    state: Mapping[str, Any] = {"telling": 0, "tries": 0, "idle": 0, "curve": [], **{key: {} for key in COUNTED}}
    target, required = math.ceil(config.selection.oversample * config.samples_per_kit), _chosen(plan, kit)
    for number in range(config.search.max_rounds):
        name = f"{kit}-r{number:03d}"
        wanted = max(FEWEST, -(-(target - state["telling"]) * 11 // (10 * config.search.parallel_searches)))
        wanted = min(wanted, max(ROUND_FIND, target // (ROUND_SHARE * config.search.parallel_searches)))
        lanes = [
            Shard(
                f"{name}-lane{lane:02d}",
                {"job": "lane", "kit": kit, "wanted": wanted, **required},
                (f"exemplars/{kit}", *found),
                code=tuple(module_of(each) for each in config.require.constraints),
            )
            for lane in range(config.search.parallel_searches)
        ]
        shards.extend(lanes)
        found.extend(f"variations/{lane.name}" for lane in lanes)
        ended_lanes = [plan.summary("variations", lane.name) for lane in lanes]
        done = [each for each in ended_lanes if each is not None]
        if len(done) < len(lanes):
            return shards, False
        params = {
            "job": "pool",
            "kit": kit,
            "tried": sum(each["tries"] for each in done),
            "spares": sum(each["spares"] for each in done),
            "counted": {key: _added(*(each[key] for each in done)) for key in COUNTED},
            "last": number == config.search.max_rounds - 1,
            **{key: state[key] for key in ("telling", "tries", "idle", "curve", *COUNTED)},
        }
        pool = Shard(f"{name}-pool", params, (f"exemplars/{kit}", *found))
        shards.append(pool)
        found.append(f"variations/{pool.name}")
        summary = plan.summary("variations", pool.name)
        if summary is None or summary["ended"]:
            return shards, summary is not None
        state = summary
    return shards, True


def last_pool(plan: Plan, kit: str) -> dict[str, Any]:
    """The summary of the newest pool of a kit, empty before the first."""
    newest: dict[str, Any] = {}
    for name in plan.shards("variations"):
        if re.fullmatch(rf"{kit}-r\d+-pool", name):
            newest = dict(plan.summary("variations", name) or newest)
    return newest


def run_lane(task: Task) -> Outcome:
    """One lane of one round."""
    section = task.config.section(VariationsConfig)
    config = section.search
    kit = input_kit(task, task.shard.params["kit"])
    search = Search(_answers(kit, task), config)
    rng = task.rng("tries")
    pool = PoolIndex.of(task, kit.name, len(kit.types))
    places = _archive(pool, search)
    chosen = _parents(rng, search.archive.crowds(places), config.max_parents, config.novelty.guided)
    for place, (found, index) in zip(places[chosen].tolist(), pool.variants(task, chosen), strict=True):
        (assembly, labels), origins = found.assembly(index), found.origins_of(index)
        if assembly.stretches is not None:  # how stretched parts dock nobody has seen
            continue
        search.adopt(rng, search.parent(f"{found.name}-{index}", assembly, origins, (place[0], place[1]), labels))
    wanted = task.shard.params["wanted"]
    variants, tries = search.run(
        rng, config.tries_per_round, wanted, task.shard.name, lambda count: task.progress(count, wanted)
    )
    is_whole = labels_test(kit, task.shard.params["labels"])
    whole = [each for each in variants if is_whole(each.assembly)]
    if len(whole) < len(variants):
        search.rejects[LABELS_MISSING] += len(variants) - len(whole)
    kept, resized = _required(task, kit, section, whole, search.rejects)
    write_variants(task, kit, kept)
    rejects = dict(sorted(search.rejects.items()))
    for reason, count in rejects.items():
        task.reject(task.shard.name, reason, count=count)
    summary = {"found": len(kept), "tries": tries, "spares": search.spares, "rejects": rejects}
    for key, counts in (("crossings", search.crossings), ("lists", search.lists), ("resized", resized)):
        summary[key] = dict(sorted(counts.items()))
    return Outcome(0, summary)


def _required(
    task: Task, kit: Kit, section: VariationsConfig, variants: Sequence[Variant], rejects: Counter[str]
) -> tuple[Sequence[Variant], Counter[str]]:
    """The variants that are, with their backdrop, what the config requires, the others being added to `rejects` by
    reason; and how many of them were resized so that they are, by the reason for which they would have been refused."""
    params = task.shard.params
    telling = [each for each in variants if each.lineage["copied"]["share"] <= params["max_copied_share"]]
    if len(telling) < len(variants):
        rejects["too much copied whole"] += len(variants) - len(telling)
    telling, resized = _constrained(kit, section, telling, rejects)
    hubs, physical = _hubs_required(task.config, kit), section.require.physical(params["stable"])
    if not (physical.rooted or physical.stable or hubs):
        return telling, resized
    backdrop, kept = hub_restorer(task, kit.name), []
    for variant in telling:
        whole = backdrop.fit(variant.assembly)
        weak = (
            unmet_requirement(physical, kit_shape(kit, whole)) if backdrop.has_hubs(hubs, whole) else HUBS_NOT_RESTORED
        )
        if weak is None:
            kept.append(variant)
        else:
            rejects[weak] += 1
    return kept, resized


def _constrained(
    kit: Kit, section: VariationsConfig, variants: list[Variant], rejects: Counter[str]
) -> tuple[list[Variant], Counter[str]]:
    """The variants that meet the global constraints, resized where that helps and the config allows it, and how many
    were; the others are added to `rejects`."""
    asked, stretch, resized = section.require.constraints, section.search.stretch, Counter[str]()
    if not asked:
        return variants, resized
    test, kept = build_test(kit, asked), []
    mend = build_repair(kit, asked, stretch.max_factor, stretch.rigid) if stretch.max_factor > 1 else None
    for variant in variants:
        reason = test(variant.assembly)
        if reason is None:
            kept.append(variant)
            continue
        mended = None if mend is None else mend(variant.assembly)
        if mended is None:
            rejects[reason] += 1
            continue
        kept.append(replace(variant, assembly=mended, lineage={**variant.lineage, "deformed": True}))
        resized[reason] += 1
    return kept, resized


def _chosen(plan: Plan, kit: str) -> dict[str, Any]:
    """What is required of a variant of `kit` by the keys that can be left open, as stated or as was chosen."""
    require = plan.config.section(VariationsConfig).require
    resolved = resolved_settings(plan, kit)
    found: dict[str, Any] = {}
    for key, said, otherwise in (
        (MAX_COPIED_SHARE_KEY, require.max_copied_share, 1.0),
        (STABLE_KEY, require.stable, False),
        (REQUIRED_LABELS_KEY, require.labels, ()),
    ):
        value = resolved.get(key, otherwise) if said == "auto" else said
        found[key.removeprefix("require.")] = list(value) if isinstance(value, tuple) else value
    return found


def _hubs_required(config: Config, kit: Kit) -> float:
    """How many hub parts a variant of `kit` must get back, or, below 1, the share of what exemplars have."""
    said = config.section(VariationsConfig).require.min_hubs
    if said != "auto":
        return said
    return auto_min_hubs(next(each for each in config.section(ExemplarsConfig).kits if each.name == kit.name), kit)


def _archive(pool: PoolIndex, search: Search) -> np.ndarray:
    """Tell a search what the pool holds; where each of its variants stands in the archive, int64 (k, 2)."""
    novelty = search.config.novelty
    places = []
    for counts, features, keys in zip(pool.counts, pool.features, pool.keys, strict=True):
        types = np.repeat(np.arange(len(counts)), counts)
        search.remember(types, *keys.tolist())
        cell = cell_of(features, novelty.axes, novelty.resolution)
        places.append(search.archive.add(cell, search.histogram(types)))
    return np.array(places, dtype=np.int64).reshape(-1, 2)


def _parents(rng: np.random.Generator, crowds: np.ndarray, most: int, guided: bool) -> list[int]:
    """At most `most` variants of the pool as parents, without replacement, the rare ones likelier; ascending."""
    waits = rng.exponential(size=len(crowds)) * (crowds if guided else 1)
    return sorted(np.argsort(waits, kind="stable")[:most].tolist())


def run_pool(task: Task) -> Outcome:
    """Keep what the lanes of a round found that is new, in the order of the lanes, and say whether to go on."""
    config = task.config.section(VariationsConfig)
    params = task.shard.params
    kit = input_kit(task, params["kit"])
    duplicates = config.search.duplicates
    before = PoolIndex.of(task, kit.name, len(kit.types))
    known = {_identity(*each, duplicates) for each in zip(before.counts, before.digests, strict=True)}
    kept: list[tuple[int, int]] = []
    doubles = 0
    stem = task.shard.name.removesuffix("pool")
    lanes = [FoundVariants.of(task, f"{stem}lane{lane:02d}") for lane in range(config.search.parallel_searches)]
    for lane, found in enumerate(lanes):
        for index in range(len(found)):
            identity = _identity(found.counts(index, len(kit.types)), found.digests[index], duplicates)
            if identity in known:
                doubles += 1
                continue
            known.add(identity)
            kept.append((lane, index))
    if doubles:
        task.reject(task.shard.name, "found by another lane too", count=doubles)
    new = write_kept(task, lanes, kept, len(kit.types))
    counts = np.concatenate([before.counts, new["counts"]])
    features = np.concatenate([before.features, new["features"]])
    measures = pool_measures(counts, features, np.concatenate([before.digests, new["digests"]]), config.search.novelty)
    total = len(counts)
    tries = params["tries"] + params["tried"]
    idle = 0 if kept else params["idle"] + params["tried"]
    telling = params["telling"] + max(len(kept) - params["spares"], 0)
    target = math.ceil(config.selection.oversample * config.samples_per_kit)
    left = target - telling if total >= config.samples_per_kit else config.samples_per_kit - total
    pace = len(kept) / params["tried"]
    slow = tries >= _patience(kit, config) and 0 < pace * _slowest(total, config) * tries < left
    ended = telling >= target or total >= SPARE * target or idle >= _patience(kit, config) or params["last"] or slow
    counted = {key: _added(params[key], params["counted"][key]) for key in COUNTED}
    poor = ended and total < config.samples_per_kit
    return Outcome(
        0,
        {
            "kit": kit.name,
            "found": total,
            "tries": tries,
            "idle": idle,
            "telling": telling,
            **measures,
            "curve": [*params["curve"], [tries, total, measures["histograms"]]],
            **counted,
            "left": what_was_left(counted["lists"]),
            "advice": f"{what_keeps(kit, counted['rejects'], tries)}, or {SAME_LAYOUT}" if poor else "",
            "ended": ended,
            "why": _why(kit, config, total, tries, idle, params["tried"] if slow else 0) if ended else "",
        },
    )


def _added(*counts: Mapping[str, int]) -> dict[str, int]:
    total: Counter[str] = Counter()
    for each in counts:
        total.update(each)
    return dict(sorted(total.items()))


def _slowest(found: int, config: VariationsConfig) -> int:
    """So many times the tries so far the rest may take, at the pace of the last round."""
    return SLOW_CHOICE if found >= config.samples_per_kit else SLOW


def _why(kit: Kit, config: VariationsConfig, found: int, tries: int, idle: int, slow: int) -> str:
    """slow: tries of the last round, where its pace was too slow to go on."""
    start = f"{kit.name}: {min(found, config.samples_per_kit):,} of {config.samples_per_kit:,}"
    if found >= config.selection.oversample * config.samples_per_kit:
        return f"{start} variants, chosen from {found:,} after {tries:,} tries"
    chosen = f", chosen from {found:,}" if found > config.samples_per_kit else ""
    if idle >= _patience(kit, config):
        return f"{start}{chosen}: no new variant in the last {idle:,} tries"
    if slow:
        longer = f"{_slowest(found, config)} times as long as all {tries:,} so far"
        return f"{start}{chosen}: at the pace of the last {slow:,} tries the rest would take more than {longer}"
    return f"{start}{chosen}: the search ended after {config.search.max_rounds} rounds"


def _patience(kit: Kit, config: VariationsConfig) -> int:
    """Tries without a new variant after which the search of a kit has ended."""
    said = config.search.patience
    if said != "auto":
        return said
    largest = max(len(each.assembly) for each in kit.exemplars)
    return min(PATIENCE, max(LEAST_PATIENCE, PATIENCE * PATIENT_PARTS // largest))


def _identity(counts: np.ndarray, digests: np.ndarray, duplicates: str) -> bytes:
    """What two variants share when they are the same by the config's rule."""
    return bytes(counts if duplicates == "histogram" else digests[int(duplicates == "docking")])


_known_answers: dict[str, ContactOracle] = {}


def _answers(kit: Kit, task: Task) -> ContactOracle:
    """The contact answers of a kit, kept from shard to shard of one worker: what they hold never changes a result."""
    made_from = str(task.input("exemplars", f"{kit.name}.tar"))
    if made_from not in _known_answers:
        _known_answers[made_from] = ContactOracle(kit)
    return _known_answers[made_from]
