"""Disk space, checked before the start so that a long run does not end on a full disk."""

from __future__ import annotations

import shutil
from pathlib import Path

from pipeline.errors import ConfigError
from pipeline.inventory import StageInventory


def byte_size(count: float) -> str:
    """Return a number of bytes for people: `512 B`, `3.4 GB` (powers of 1000)."""
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000:
            return f"{count:.0f} {unit}" if unit == "B" else f"{count:.1f} {unit}"
        count /= 1000
    return f"{count:.1f} TB"


def check_space(state: StageInventory, out: Path) -> str:
    """Return in words what the stage still needs on disk. Raises ConfigError when `out` has less than that free."""
    estimate = state.stage.estimate_bytes(state.view)
    needed = max(0, estimate - sum(record.bytes_on_disk() for record in state.records.values()))
    samples = sum(int(shard.params.get("samples", 0)) for shard in state.shards)
    notes = [f"{byte_size(estimate)} in total"] if needed < estimate else []
    notes += [f"{byte_size(estimate / samples)} per sample"] if samples else []
    free = shutil.disk_usage(out).free
    words = f"about {byte_size(needed)} of disk" + (f" ({', '.join(notes)})" if notes else "")
    if needed > free:
        raise ConfigError(
            f"{out}: stage {state.stage.name} needs {words}, and {byte_size(free)} are free: "
            "free some space, choose another OUT, or ask for less in the config"
        )
    return words
