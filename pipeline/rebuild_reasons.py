"""Reasons for rebuilding shards: the difference between the recipe in a record and the current one."""

from __future__ import annotations

from collections import Counter

from pipeline.inventory import StageInventory
from pipeline.paths import read_json
from pipeline.records import ShardRecord

_NAMED = {
    "code": "code",
    "config": "config",
    "dataset": "name, version or seed of the dataset",
    "plan": "its plan",
    "inputs": "its inputs",
}


def rebuild_reasons(state: StageInventory) -> list[str]:
    """Return a line for each set of reasons for which finished shards are rebuilt."""
    counts: Counter[str] = Counter()
    for shard in state.missing:
        old = state.outdated.get(shard.name)
        if old is not None:
            counts[_changes(state, old)] += 1
    return [f"{count} shard{'s are' if count > 1 else ' is'} rebuilt: {why}" for why, count in counts.items()]


def _changes(state: StageInventory, old: ShardRecord) -> str:
    new = state.recipes[old.shard]
    changed = {kind: name for kind, name in _NAMED.items() if old.recipe.get(kind) != new[kind]}
    edited = _edited(state) if "code" in changed else []
    if edited:
        changed["code"] += f" ({', '.join(edited)})"
    if changed:
        return f"changed: {', '.join(changed.values())}"
    return "an input has other bytes" if old.is_whole(state.paths) else "a file is missing"


def _edited(state: StageInventory) -> list[str]:
    """Return the modules that changed since the stage was last finished, as far as known."""
    try:
        before = read_json(state.paths.manifest)["code"].items()
        return sorted({module for module, _ in before ^ state.code.items()})
    except (TypeError, KeyError, AttributeError):
        return []
