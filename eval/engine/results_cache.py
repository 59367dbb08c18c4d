"""Long tables in sections: each finished section is cached, so a killed run resumes."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Chart, TableResult
from eval.engine.table import Table
from pipeline.code import code_digest, transitive_imports
from pipeline.paths import file_digest, write_file
from pipeline.shards import json_bytes
from stages.package.versions import library_versions

Item = TypeVar("Item")


@dataclass(frozen=True)
class TableSection:
    """A section of a long table, such as the rows of one model. Of the config it depends on name and seed alone."""

    name: str
    """Unique within the table."""
    input_files: Sequence[Path]
    """All files that its values depend on."""
    compute: Callable[[], TableResult]
    modules: Sequence[str] = ()
    """Modules that it imports by name at run time."""
    options: Sequence[str] | None = None
    """The names of the options that its values depend on; None for all."""


class _CachedResult(BaseModel):
    model_config = ConfigDict(ser_json_bytes="base64", val_json_bytes="base64", ser_json_inf_nan="constants")

    result: TableResult
    seconds: float


def cached_sections(
    sections: Callable[[DatasetRun, Any], Iterable[TableSection]],
) -> Callable[[DatasetRun, Any], TableResult]:
    """Return the `Evaluation.compute` of a table that consists of sections.

    Each section is kept in `OUT/<dataset>-eval/cache/<table>/<section>.json`. It is computed again when its code, the
    libraries, its options, the seed or its input files have changed.
    """
    module = sections.__module__
    table = module.rpartition(".")[2]

    def compute(run: DatasetRun, options: Any) -> TableResult:
        digest = cache(file_digest)
        common = {"libraries": library_versions(), "dataset": (run.config.name, run.config.seed)}

        def results() -> Iterator[TableResult]:
            for section in sections(run, options):
                names = None if section.options is None else set(section.options)
                inputs = {
                    **common,
                    "options": options.model_dump(mode="json", include=names),
                    "section": section.name,
                    "code": code_digest(transitive_imports([module, *section.modules])),
                    "files": [digest(path) for path in section.input_files],
                }
                path = run.results / "cache" / table / f"{section.name}.json"
                yield cached_result(section.name, inputs, path, section.compute)[0]

        return join_results(list(results()))

    return compute


def cached_result(
    name: str, inputs: Mapping[str, Any], path: Path, compute: Callable[[], TableResult]
) -> tuple[TableResult, float]:
    """Return a result and the seconds that it took; compute it unless `path` has it for the same inputs.

    name: what standard error calls it
    inputs: all that its values depend on, as JSON
    """
    key = hashlib.sha256(json_bytes(dict(inputs))).hexdigest()
    kept = _read(path, key)
    if kept is not None:
        print(f"{name}: cached", file=sys.stderr)
        return kept.result, kept.seconds
    start = perf_counter()
    result = compute()
    made = _CachedResult(result=result, seconds=perf_counter() - start)
    content = made.model_dump_json().encode()
    write_file(path, _checksum(key, content) + b"\n" + content)
    print(f"{name}: made in {made.seconds:.0f} s", file=sys.stderr)
    return made.result, made.seconds


def _read(path: Path, key: str) -> _CachedResult | None:
    """Return what was kept under this key, or None for a missing, outdated or corrupted file."""
    if not path.is_file():
        return None
    checksum, _, content = path.read_bytes().partition(b"\n")
    return _CachedResult.model_validate_json(content) if checksum == _checksum(key, content) else None


def _checksum(key: str, content: bytes) -> bytes:
    return hashlib.sha256(key.encode() + content).hexdigest().encode()


def join_results(results: Sequence[TableResult]) -> TableResult:
    """Join results: tables with equal titles and columns, and charts with equal titles and labels, become one each.

    Notes and reference rows that several results share appear once.
    """
    tables: dict[tuple[str, tuple[str, ...]], Table] = {}
    charts: dict[tuple[str, str, str], Chart] = {}
    for result in results:
        for table in result.tables:
            empty = replace(table, rows=(), notes=(), reference_rows=())
            joined = tables.setdefault((table.title, table.columns), empty)
            tables[table.title, table.columns] = replace(
                joined,
                rows=(*joined.rows, *table.rows),
                notes=_without_repeats(joined.notes, table.notes),
                reference_rows=_without_repeats(joined.reference_rows, table.reference_rows),
            )
        for chart in result.charts:
            key = chart.title, chart.x_label, chart.y_label
            lines = charts[key].lines if key in charts else {}
            charts[key] = replace(chart, lines={**lines, **chart.lines})
    return TableResult(
        list(tables.values()),
        list(charts.values()),
        [row for result in results for row in result.image_rows],
        [figure for result in results for figure in result.figures],
    )


def _without_repeats(first: Sequence[Item], second: Sequence[Item]) -> list[Item]:
    return [*first, *(item for item in second if item not in first)]
