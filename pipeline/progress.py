"""How far a stage is, and what there is to say of it at the end: of the survey and what is under way."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from pipeline.disk_space import byte_size
from pipeline.event_log import Progress, duration_text
from pipeline.inventory import StageInventory
from pipeline.paths import StagePaths


def stage_progress(surveyed: StageInventory, running: Iterable[str], failed: int) -> Progress:
    """How far the stage is while the shards `running` are made and so many have `failed`."""
    records = surveyed.records
    share = {name: _how_far(surveyed.paths, name) for name in running} | dict.fromkeys(records, 1.0)
    work = {shard.name: int(shard.params.get("samples", 0)) for shard in surveyed.shards}
    return Progress(
        planned=len(surveyed.shards),
        done=sum(share.values()),
        failed=failed,
        work=sum(work.values()),
        worked=sum(samples * share.get(name, 0.0) for name, samples in work.items()),
        samples=sum(record.samples for record in records.values()),
        rejects=sum(sum(record.rejects.values()) for record in records.values()),
    )


def closing_line(surveyed: StageInventory, made: int, failed: Mapping[str, str], left: int) -> str:
    """What a run says of the stage when it ends: `made` shards are new, `failed` are set aside, so many are `left`."""
    records = surveyed.records.values()
    text = f"{len(records):,} of {len(surveyed.shards):,} shards, {sum(each.samples for each in records):,} samples"
    text += f", {byte_size(sum(each.bytes_on_disk() for each in records))}"
    text += f", {shard_count_text(made)} made now" if made else ", nothing to make"
    text += f" ({duration_text(sum(each.seconds for each in records))} of worker time in all)"
    if failed:
        text += f"; {len(failed)} set aside: {', '.join(failed)}"
    if left:
        text += f"; {left} not made"
    return text


def shard_count_text(shards: int) -> str:
    """So many shards, in words."""
    return f"{shards:,} shard{'' if shards == 1 else 's'}"


def _how_far(places: StagePaths, shard: str) -> float:
    try:
        done, total = (places.progress / shard).read_text().split()
        return min(int(done) / int(total), 1.0)
    except (OSError, ValueError, ZeroDivisionError):
        return 0.0
