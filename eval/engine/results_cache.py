"""Long tables in parts: what is made of one is kept, and not made again after a kill."""

from __future__ import annotations

import hashlib
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from time import perf_counter
from typing import TypeVar

from pydantic import BaseModel, ConfigDict

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Chart, TableResult
from eval.engine.table import Table
from pipeline.code import code_digest, transitive_imports
from pipeline.paths import file_digest, write_file
from pipeline.shards import json_bytes
from stages.package.versions import library_versions

Said = TypeVar("Said")


@dataclass(frozen=True)
class TableSection:
    """A part of a long table, such as the rows of one model.

    name: no other part of the table has it; reads: the files that its figures depend on; make: makes it; code: modules
    that it finds at run time, by a name; options: of the table's options those that its figures depend on, by name; all
    where it is None. Of the config it depends on the dataset's name and seed alone.
    """

    name: str
    reads: Sequence[Path]
    make: Callable[[], TableResult]
    code: Sequence[str] = ()
    options: Sequence[str] | None = None


class _Kept(BaseModel):
    model_config = ConfigDict(ser_json_bytes="base64", val_json_bytes="base64", ser_json_inf_nan="constants")

    answer: TableResult


def cached_sections(
    parts: Callable[[DatasetRun, Namespace], Iterable[TableSection]], options: Callable[[ArgumentParser], None]
) -> Callable[[DatasetRun, Namespace], TableResult]:
    """The `Evaluation.answer` of a table that is made of `parts`, which hang on its `options`.

    Each part is kept in `OUT/<dataset>-eval/parts/<table>/<part>.json` when it is made. It is taken from there as long
    as the code that makes it, the libraries, the options, the seed and the files that it reads are the same.
    """
    module = parts.__module__
    table = module.rpartition(".")[2]

    def answer(subject: DatasetRun, asked: Namespace) -> TableResult:
        own = ArgumentParser()
        options(own)
        digest = cache(file_digest)
        common = {"libraries": library_versions(), "dataset": (subject.config.name, subject.config.seed)}

        def each_part() -> Iterator[TableResult]:
            for part in parts(subject, asked):
                code, read = (
                    code_digest(transitive_imports([module, *part.code])),
                    [digest(path) for path in part.reads],
                )
                names = vars(own.parse_args([])) if part.options is None else part.options
                chosen = {name: getattr(asked, name) for name in names}
                described = {**common, "options": chosen, "part": part.name, "code": code, "reads": read}
                key = hashlib.sha256(json_bytes(described)).hexdigest()
                yield _answer_of(part, key, subject.results / "parts" / table / f"{part.name}.json")

        return join_results(list(each_part()))

    return answer


def _answer_of(part: TableSection, key: str, path: Path) -> TableResult:
    kept = _read(path, key)
    if kept is not None:
        print(f"{part.name}: made before", file=sys.stderr)
        return kept
    start = perf_counter()
    answer = part.make()
    written = _Kept(answer=answer).model_dump_json().encode()
    write_file(path, _seal(key, written) + b"\n" + written)
    print(f"{part.name}: made in {perf_counter() - start:.0f} s", file=sys.stderr)
    return answer


def _read(path: Path, key: str) -> TableResult | None:
    """The answer with this key in a file; None where there is none, or none any more: the disk has spoilt it."""
    if not path.is_file():
        return None
    seal, _, written = path.read_bytes().partition(b"\n")
    return _Kept.model_validate_json(written).answer if seal == _seal(key, written) else None


def _seal(key: str, written: bytes) -> bytes:
    return hashlib.sha256(key.encode() + written).hexdigest().encode()


def join_results(answers: Sequence[TableResult]) -> TableResult:
    """One answer of several: tables of one title and the same columns become one, and so do curves in one plot; what
    all say in notes and published rows is said once."""
    tables: dict[tuple[str, tuple[str, ...]], Table] = {}
    curves: dict[tuple[str, str, str], Chart] = {}
    for answer in answers:
        for table in answer.tables:
            there = tables.setdefault((table.title, table.columns), replace(table, rows=(), notes=(), published=()))
            tables[table.title, table.columns] = replace(
                there,
                rows=(*there.rows, *table.rows),
                notes=_once(there.notes, table.notes),
                published=_once(there.published, table.published),
            )
        for curve in answer.curves:
            alike = curves.setdefault((curve.title, curve.across, curve.up), replace(curve, lines={}))
            curves[curve.title, curve.across, curve.up] = replace(alike, lines={**alike.lines, **curve.lines})
    return TableResult(
        list(tables.values()),
        list(curves.values()),
        [strip for answer in answers for strip in answer.strips],
        [sheet for answer in answers for sheet in answer.sheets],
    )


def _once(first: Sequence[Said], second: Sequence[Said]) -> list[Said]:
    return [*first, *(each for each in second if each not in first)]
