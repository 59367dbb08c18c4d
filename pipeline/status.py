"""Status of a dataset, from its plans and records."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping

from pipeline.config import Config
from pipeline.disk_space import byte_size
from pipeline.display import duration_text
from pipeline.inventory import Inventory, StageInventory
from pipeline.paths import DatasetPaths, read_json
from pipeline.rebuild_reasons import rebuild_reasons
from pipeline.stage import Stage

_HEADER = ("stage", "done", "failed", "samples", "rejects", "time", "left", "memory", "disk")


def status_lines(config: Config, stages: Mapping[str, Stage], paths: DatasetPaths, workers: int) -> Iterator[str]:
    """Yield a table with a row for each stage, then rejects by reason, the stages' reports and quarantined shards.

    A stage that has nothing to make under this config has no row. Columns: `time` is worker time, `left` the estimate
    for `workers` workers from the mean of the finished shards, `memory` the largest amount that a worker has held.
    """
    inventory = Inventory(config, stages, paths)
    rows: list[tuple[str, ...]] = [_HEADER]
    notes: list[str] = []
    for name, stage in stages.items():
        unfinished = [read for read in stage.inputs if not inventory.complete(read)]
        if unfinished:
            if stage.may_make_samples(config):
                wanted = [read for read in unfinished if stages[read].may_make_samples(config)]
                rows.append((name, f"waits for {(wanted or unfinished)[0]}", *[""] * 7))
            continue
        state = inventory.stage(name)
        failures = _failures(state)
        rejects = sum((Counter(record.rejects) for record in state.records.values()), Counter[str]())
        if state.shards:
            rows.append(_row(state, len(failures), sum(rejects.values()), workers))
        notes += [f"{name}: {line}" for line in rebuild_reasons(state)]
        notes += [f"{name}: {line}" for line in stage.report(state.view)]
        notes += [f"{name}: {count:,} rejected: {reason}" for reason, count in rejects.most_common()]
        notes += [f"{name}: {shard} is quarantined: {message}" for shard, message in failures.items()]
    # A long cell that ends its row (a waiting stage) may extend over the columns after it.
    widths = [max(len(row[column]) for row in rows if row[column + 1 :] != ("",) * 7) for column in range(len(_HEADER))]
    for row in rows:
        cells = [
            cell.ljust(width) if not column else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        yield "  ".join(cells).rstrip()
    yield from notes


def _row(state: StageInventory, failed: int, rejects: int, workers: int) -> tuple[str, ...]:
    records = state.records.values()
    seconds = sum(record.seconds for record in records)
    left = seconds / len(records) * len(state.missing) / workers if records else 0.0
    unknown = bool(state.missing) and not records
    return (
        state.stage.name,
        f"{len(records)}/{len(state.shards)}",
        str(failed),
        f"{sum(record.samples for record in records):,}",
        f"{rejects:,}",
        duration_text(seconds),
        "?" if unknown else duration_text(left),
        byte_size(max((record.peak_bytes for record in records), default=0)),
        byte_size(sum(record.bytes_on_disk() for name, record in state.records.items() if name not in state.pruned)),
    )


def _failures(state: StageInventory) -> dict[str, str]:
    """Return the message of each quarantined shard that has not been made since."""
    failures = {}
    for shard in state.missing:
        failure = read_json(state.paths.failed / f"{shard.name}.json")
        if isinstance(failure, dict) and failure.get("fingerprint") == state.fingerprints[shard.name]:
            failures[shard.name] = str(failure["message"])
    return failures
