"""Progress of a stage while it runs, and its closing line."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from pipeline.compilation_note import read_compilation_note
from pipeline.disk_space import byte_size
from pipeline.display import duration_text
from pipeline.event_log import Progress
from pipeline.inventory import StageInventory
from pipeline.paths import StagePaths


def stage_progress(state: StageInventory, running: Iterable[str], failed: int) -> Progress:
    """Return the progress of a stage: `running` names the shards being made, `failed` counts quarantined ones."""
    records, running = state.records, list(running)
    share = {name: _finished_share(state.paths, name) for name in running} | dict.fromkeys(records, 1.0)
    notes = [read_compilation_note(state.paths.compilation_note(name)) for name in running]
    work = {shard.name: int(shard.params.get("samples", 0)) for shard in state.shards}
    return Progress(
        planned=len(state.shards),
        done=sum(share.values()),
        failed=failed,
        work=sum(work.values()),
        worked=sum(samples * share.get(name, 0.0) for name, samples in work.items()),
        samples=sum(record.samples for record in records.values()),
        rejects=sum(sum(record.rejects.values()) for record in records.values()),
        kernels=sum(count for count, _ in notes) if any(compiles for _, compiles in notes) else None,
        running=tuple(sorted(running)),
    )


def closing_line(state: StageInventory, made: int, failed: Mapping[str, str], left: int) -> str:
    """Return the line that ends a run.

    made: number of shards made by this run
    failed: message by name of each quarantined shard
    left: number of shards that are neither made nor failed
    """
    records = state.records.values()
    text = f"{len(records):,} of {len(state.shards):,} shards, {sum(record.samples for record in records):,} samples"
    text += f", {byte_size(sum(record.bytes_on_disk() for record in records))}"
    text += f", {shard_count_text(made)} made now" if made else ", nothing to make"
    text += f" ({duration_text(sum(record.seconds for record in records))} of worker time in all)"
    if failed:
        text += f"; {len(failed)} quarantined: {', '.join(failed)}"
    if left:
        text += f"; {left} not made"
    return text


def shard_count_text(shards: int) -> str:
    """Return a number of shards with its unit: `1 shard`, `1,200 shards`."""
    return f"{shards:,} shard{'' if shards == 1 else 's'}"


def _finished_share(paths: StagePaths, shard: str) -> float:
    try:
        done, total = (paths.progress / shard).read_text(encoding="utf-8").split()
        return min(int(done) / int(total), 1.0)
    except (OSError, ValueError, ZeroDivisionError):
        return 0.0
