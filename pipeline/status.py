"""How far a dataset is and what failed, from the plans and the records alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping

from pipeline.config import Config
from pipeline.disk_space import byte_size
from pipeline.event_log import duration_text
from pipeline.inventory import Inventory, StageInventory
from pipeline.paths import DatasetPaths, read_json
from pipeline.rebuild_reasons import rebuild_reasons
from pipeline.stage import Stage

_HEADER = ("stage", "done", "failed", "samples", "rejects", "time", "left", "memory", "disk")


def status_lines(config: Config, stages: Mapping[str, Stage], places: DatasetPaths, workers: int) -> Iterator[str]:
    """A table with a row for each stage, then its rejects by reason, its own report and the shards set aside.

    `time` is worker time; `left` is for `workers` workers, from the mean of the finished shards; `memory` is the
    largest that any worker of the stage has held.
    """
    survey = Inventory(config, stages, places)
    rows: list[tuple[str, ...]] = [_HEADER]
    notes: list[str] = []
    for name, stage in stages.items():
        unfinished = [each for each in stage.inputs if not survey.complete(each)]
        if unfinished:
            rows.append((name, f"waits for {unfinished[0]}", *[""] * 7))
            continue
        surveyed = survey.stage(name)
        failures = _failures(surveyed)
        rejects = sum((Counter(record.rejects) for record in surveyed.records.values()), Counter[str]())
        rows.append(_row(surveyed, len(failures), sum(rejects.values()), workers))
        notes += [f"{name}: {line}" for line in rebuild_reasons(surveyed)]
        notes += [f"{name}: {line}" for line in stage.report(surveyed.view)]
        notes += [f"{name}: {count:,} rejected: {reason}" for reason, count in rejects.most_common()]
        notes += [f"{name}: {shard} is set aside: {message}" for shard, message in failures.items()]
    # A long cell that ends its row (a stage that waits) may run over the columns after it.
    widths = [max(len(row[column]) for row in rows if row[column + 1 :] != ("",) * 7) for column in range(len(_HEADER))]
    for row in rows:
        cells = [
            cell.ljust(width) if not column else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        yield "  ".join(cells).rstrip()
    yield from notes


def _row(surveyed: StageInventory, failed: int, rejects: int, workers: int) -> tuple[str, ...]:
    records = surveyed.records.values()
    seconds = sum(record.seconds for record in records)
    left = seconds / len(records) * len(surveyed.missing) / workers if records else 0.0
    unknown = bool(surveyed.missing) and not records
    return (
        surveyed.stage.name,
        f"{len(records)}/{len(surveyed.shards)}",
        str(failed),
        f"{sum(record.samples for record in records):,}",
        f"{rejects:,}",
        duration_text(seconds),
        "?" if unknown else duration_text(left),
        byte_size(max((record.peak_bytes for record in records), default=0)),
        byte_size(sum(each.bytes_on_disk() for name, each in surveyed.records.items() if name not in surveyed.pruned)),
    )


def _failures(surveyed: StageInventory) -> dict[str, str]:
    """The message of each shard that was set aside and has not been made since."""
    failures = {}
    for shard in surveyed.missing:
        noted = read_json(surveyed.paths.failed / f"{shard.name}.json")
        if isinstance(noted, dict) and noted.get("fingerprint") == surveyed.fingerprints[shard.name]:
            failures[shard.name] = str(noted["message"])
    return failures
