"""The search in rounds: lanes look for variants beside each other, then a pool shard keeps what is new.

A round of a kit is some lane shards `<kit>-r<round>-lane<k>` and one pool shard `<kit>-r<round>-pool`. Lanes draw
their parents from the pools of all earlier rounds; what a lane does depends on its number and never on who runs it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from pipeline.shards import array_bytes
from pipeline.stage import Outcome, Plan, Shard, Task
from stages.shape.collection import input_kit
from stages.shape.kit import Kit
from stages.variations.answers import ContactAnswers
from stages.variations.pool import FoundVariants, write_variants
from stages.variations.search import Search
from stages.variations.settings import VariationsConfig

__all__ = ["last_pool", "pool_entries", "run_lane", "run_pool", "search_shards"]

ROUND_FIND = 400
"""Most variants that one lane finds in a round before the lanes exchange what they have."""
FEWEST = 32
"""A lane looks for at least so many variants, so that the last rounds are not mere starts and stops."""


def search_shards(plan: Plan, kit: str) -> tuple[list[Shard], bool]:
    """The rounds of a kit's search as far as they can be planned now, and whether the search has ended."""
    config = plan.config.section(VariationsConfig)
    shards: list[Shard] = []
    found: list[str] = []
    state: Mapping[str, Any] = {"found": 0, "tries": 0, "idle": 0}
    for number in range(config.search.rounds):
        name = f"{kit}-r{number:03d}"
        wanted = max(FEWEST, -(-(config.per_kit - state["found"]) * 11 // (10 * config.search.lanes)))
        lanes = [
            Shard(
                f"{name}-lane{lane:02d}",
                {"job": "lane", "kit": kit, "wanted": min(wanted, ROUND_FIND)},
                (f"exemplars/{kit}", *found),
            )
            for lane in range(config.search.lanes)
        ]
        shards.extend(lanes)
        found.extend(f"variations/{lane.name}" for lane in lanes)
        ended_lanes = [plan.summary("variations", lane.name) for lane in lanes]
        tries = [each["tries"] for each in ended_lanes if each is not None]
        if len(tries) < len(lanes):
            return shards, False
        last = number == config.search.rounds - 1
        params = {"job": "pool", "kit": kit, "tried": sum(tries), "tries": state["tries"], "idle": state["idle"]}
        pool = Shard(f"{name}-pool", {**params, "last": last}, (f"exemplars/{kit}", *found))
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


def pool_entries(task: Task, kit: str) -> Iterator[tuple[FoundVariants, int]]:
    """Every variant in the pools among a shard's inputs, in the order in which they were kept."""
    names = [each.partition("/")[2] for each in task.shard.inputs]
    for pool in sorted(name for name in names if re.fullmatch(rf"{kit}-r\d+-pool", name)):
        kept = np.load(task.input("variations", f"{pool}.kept.npy"), allow_pickle=False)
        lanes: dict[int, FoundVariants] = {}
        for lane, index in kept.tolist():
            if lane not in lanes:
                lanes[lane] = FoundVariants.of(task, f"{pool.removesuffix('pool')}lane{lane:02d}")
            yield lanes[lane], index


def run_lane(task: Task) -> Outcome:
    """One lane of one round."""
    config = task.config.section(VariationsConfig).search
    kit = input_kit(task, task.shard.params["kit"])
    search = Search(_answers(kit, task), config)
    rng = task.rng("tries")
    entries = list(pool_entries(task, kit.name))
    for found, index in entries:
        search.seen.add(search.key(found.types_of(index), *found.keys[index].tolist()))
    chosen = rng.permutation(len(entries))[: config.parents]
    for entry in np.sort(chosen).tolist():
        found, index = entries[entry]
        assembly, labels = found.assembly(index)
        search.parents.append(search.parent(f"{found.name}-{index}", assembly, labels))
    wanted = task.shard.params["wanted"]
    variants, tries = search.run(rng, config.tries, wanted, task.shard.name, lambda count: task.progress(count, wanted))
    write_variants(task, variants)
    for reason, count in sorted(search.rejects.items()):
        task.reject(task.shard.name, reason, count=count)
    return Outcome(0, {"found": len(variants), "tries": tries})


def run_pool(task: Task) -> Outcome:
    """Keep what the lanes of a round found that is new, in the order of the lanes, and say whether to go on."""
    config = task.config.section(VariationsConfig)
    params = task.shard.params
    kit = input_kit(task, params["kit"])
    duplicates = config.search.duplicates
    known: set[bytes] = set()
    histograms: set[bytes] = set()
    graphs: set[bytes] = set()
    before = 0
    for found, index in pool_entries(task, kit.name):
        known.add(_identity(found, index, duplicates, len(kit.types)))
        histograms.add(found.histogram(index, len(kit.types)))
        graphs.add(found.digest(index, docked=False))
        before += 1
    kept: list[tuple[int, int]] = []
    doubles = 0
    stem = task.shard.name.removesuffix("pool")
    for lane in range(config.search.lanes):
        found = FoundVariants.of(task, f"{stem}lane{lane:02d}")
        for index in range(len(found)):
            identity = _identity(found, index, duplicates, len(kit.types))
            if identity in known:
                doubles += 1
                continue
            known.add(identity)
            histograms.add(found.histogram(index, len(kit.types)))
            graphs.add(found.digest(index, docked=False))
            kept.append((lane, index))
    if doubles:
        task.reject(task.shard.name, "found by another lane too", count=doubles)
    with task.output(f"{task.shard.name}.kept.npy") as stream:
        stream.write(array_bytes(np.array(kept, dtype=np.int64).reshape(-1, 2)))
    total = before + len(kept)
    tries = params["tries"] + params["tried"]
    idle = 0 if kept else params["idle"] + params["tried"]
    ended = total >= config.per_kit or idle >= config.search.patience or params["last"]
    return Outcome(
        0,
        {
            "kit": kit.name,
            "found": total,
            "tries": tries,
            "idle": idle,
            "graphs": len(graphs),
            "histograms": len(histograms),
            "ended": ended,
            "why": _why(kit, config, total, tries, idle) if ended else "",
        },
    )


def _why(kit: Kit, config: VariationsConfig, found: int, tries: int, idle: int) -> str:
    if found >= config.per_kit:
        return f"{kit.name}: {config.per_kit:,} of {config.per_kit:,} variants after {tries:,} tries"
    if idle >= config.search.patience:
        return f"{kit.name}: {found:,} of {config.per_kit:,}: no new variant in the last {idle:,} tries"
    return f"{kit.name}: {found:,} of {config.per_kit:,}: the search ended after {config.search.rounds} rounds"


def _identity(found: FoundVariants, index: int, duplicates: str, types: int) -> bytes:
    """What two variants share when they are the same by the config's rule."""
    if duplicates == "histogram":
        return found.histogram(index, types)
    return found.digest(index, docked=duplicates == "docking")


_known_answers: dict[str, ContactAnswers] = {}


def _answers(kit: Kit, task: Task) -> ContactAnswers:
    """The contact answers of a kit, kept from shard to shard of one worker: what they hold never changes a result."""
    made_from = str(task.input("exemplars", f"{kit.name}.tar"))
    if made_from not in _known_answers:
        _known_answers[made_from] = ContactAnswers(kit)
    return _known_answers[made_from]
