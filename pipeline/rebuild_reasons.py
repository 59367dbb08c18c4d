"""Why shards are made again: what differs between the recipe in a record and the one of today."""

from __future__ import annotations

from collections import Counter

from pipeline.inventory import StageInventory
from pipeline.paths import read_json
from pipeline.records import ShardRecord

_NAMED = {
    "code": "code",
    "config": "config",
    "dataset": "name, version or seed of the dataset",
    "plan": "what is planned",
    "inputs": "what it is made from",
}


def rebuild_reasons(surveyed: StageInventory) -> list[str]:
    """A line for each reason, or set of reasons, for which shards that were made once are made again."""
    counts: Counter[str] = Counter()
    for shard in surveyed.missing:
        old = surveyed.outdated.get(shard.name)
        if old is not None:
            counts[_changes(surveyed, old)] += 1
    return [f"{count} shard{'s are' if count > 1 else ' is'} made again: {why}" for why, count in counts.items()]


def _changes(surveyed: StageInventory, old: ShardRecord) -> str:
    new = surveyed.recipes[old.shard]
    changed = {kind: name for kind, name in _NAMED.items() if old.recipe.get(kind) != new[kind]}
    edited = _edited(surveyed) if "code" in changed else []
    if edited:
        changed["code"] += f" ({', '.join(edited)})"
    if changed:
        return f"changed: {', '.join(changed.values())}"
    return "what it is made from has other bytes" if old.is_whole(surveyed.paths) else "a file is gone"


def _edited(surveyed: StageInventory) -> list[str]:
    """The modules that are not as they were when the stage was last finished, as far as that is known."""
    try:
        before = read_json(surveyed.paths.manifest)["code"].items()
        return sorted({module for module, _ in before ^ surveyed.code.items()})
    except (TypeError, KeyError, AttributeError):
        return []
