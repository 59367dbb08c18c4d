"""Makes tables: about a finished dataset, about files, or all of them with a report."""

from __future__ import annotations

import json
import traceback
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from time import perf_counter

import yaml
from pydantic import ValidationError

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, TableResult
from eval.engine.registry import read_tables
from pipeline.config import StrictModel, mistakes_in_words, nearest_word
from pipeline.errors import ConfigError
from pipeline.paths import write_file

ALL_TABLES = "all"
REPORT_FILE = "report.html"


def list_tables(run: DatasetRun) -> str:
    """Describe every table: its question, its options, and what is missing or how long it takes.

    A table whose file cannot be read has a line that says why.
    """
    tables, faults = read_tables()
    dataset = f"{run.folder}, {run.samples:,} shapes" if run.manifest else f"nothing in {run.folder} yet"
    lines = [f"Tables about {run.config.name} ({dataset}):", ""]
    width = max(map(len, tables)) + 2
    for name, table in tables.items():
        missing = table.missing(run)
        state = (
            f"missing: {missing}" if missing else f"can be made, takes about {_duration(table.estimate_seconds(run))}"
        )
        needs = ", ".join(need.description for need in table.requirements)
        lines += [
            f"  {name:<{width}}{table.question}",
            *(f"  {'':<{width}}{text}" for text in (state, f"needs {needs}")),
        ]
        if table.options.model_fields:
            lines.append(f"  {'':<{width}}options: {_options_text(table.options)}")
        lines.append("")
    lines += [f"  {name:<{width}}cannot be read: {fault}\n" for name, fault in faults.items()]
    lines.append(f"make eval TABLE=<name> prints one; TABLE={ALL_TABLES} makes all that can be made, and {REPORT_FILE}")
    return "\n".join(lines) + "\n"


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"


def _options_text(model: type[StrictModel]) -> str:
    defaults = model().model_dump(mode="json")
    return "; ".join(
        f"{name}={json.dumps(defaults[name])} ({field.description})" for name, field in model.model_fields.items()
    )


def find_table(name: str) -> Evaluation:
    """Return a table by name. Raises ConfigError for a file that cannot be read, and for an unknown name."""
    tables, faults = read_tables()
    if name in faults:
        raise ConfigError(f"table {name} cannot be read: {faults[name]}")
    if name not in tables:
        close = nearest_word(name, tables)
        raise ConfigError(f"there is no table {name}; " + (f"did you mean {close}?" if close else ", ".join(tables)))
    return tables[name]


def read_settings(settings: Sequence[str]) -> dict[str, object]:
    """Parse options as `KEY=VALUE`, the value as YAML. Raises ConfigError for any other text."""
    values: dict[str, object] = {}
    for setting in settings:
        key, equals, text = setting.partition("=")
        try:
            values[key] = yaml.safe_load(text)
        except yaml.YAMLError as error:
            raise ConfigError(f"{setting}: the value is no YAML: {error}") from error
        if not equals:
            raise ConfigError(f"{setting}: an option is KEY=VALUE")
    return values


def table_options(name: str, model: type[StrictModel], values: Mapping[str, object]) -> StrictModel:
    """Return the options of a table. Raises ConfigError for an unknown option or an invalid value."""
    try:
        return model.model_validate_json(json.dumps(values))
    except ValidationError as error:
        wrong = "; ".join(mistakes_in_words(model, error, values))
        known = f"its options: {_options_text(model)}" if model.model_fields else "it has no options"
        raise ConfigError(f"{name}: {wrong}; {known}") from None


def print_table_of_files(
    name: str, files: Sequence[Path], out: Path, values: Mapping[str, object], workers: int
) -> None:
    """Print a table about files; keep only its figures, in `OUT/eval`. Raises ConfigError if it is not about files."""
    about_files = [known for known, table in read_tables()[0].items() if table.compute_from_files]
    remedy = f"leave out {files[0]} (MESH), or name a table about files: {', '.join(about_files)}"
    if name in ("", ALL_TABLES):
        raise ConfigError(f"a table is about files where it is named; {remedy}")
    table = find_table(name)
    if table.compute_from_files is None:
        raise ConfigError(f"{name} is a table about datasets, not about files; {remedy}")
    result = table.compute_from_files(files, table_options(name, table.options, values), workers)
    print(markdown(result), end="")
    for figure in result.figures:
        print(f"\n{figure.title}: {write_file(out / 'eval' / f'{name}_{figure.name}.png', figure.png)}")


def make_table(run: DatasetRun, name: str, values: Mapping[str, object]) -> None:
    """Print a table about a dataset and keep it. Raises ConfigError for a missing requirement."""
    from eval.engine.report import FinishedTable, report_html

    table = find_table(name)
    options = table_options(name, table.options, values)
    missing = table.missing(run)
    if missing:
        raise ConfigError(f"{name}: {missing}")
    start, started = perf_counter(), datetime.now(UTC)
    result = table.compute(run, options)
    write_tables(run, name, result)
    finished = FinishedTable(name, table.question, result, perf_counter() - start)
    write_file(run.results / f"{name}.html", report_html(run, [finished], {}, started).encode())
    print(markdown(result), end="")
    pictures = ", with charts and pictures" if result.charts or result.image_rows else ""
    print(f"\nAlso in {run.results}: {name}.html{pictures}, {name}.md, {name}.csv, {name}.tex")


def make_all_tables(run: DatasetRun, values: Mapping[str, object]) -> int:
    """Make every table of the report whose requirements are met, and the report. Return how many failed.

    Each table takes those of the options that it knows. Raises ConfigError for an option that no table knows.
    """
    from eval.engine.report import FinishedTable, report_html

    tables, faults = read_tables()
    known = {key for table in tables.values() for key in table.options.model_fields}
    unknown = sorted(values.keys() - known)
    if unknown:
        raise ConfigError(f"no table has the option {unknown[0]}; options are {', '.join(sorted(known))}")
    finished: list[FinishedTable] = []
    unmade = {name: f"it cannot be read: {fault}" for name, fault in faults.items()}
    for name, fault in unmade.items():
        print(f"{name}: {fault}")
    failed, started = len(faults), datetime.now(UTC)
    for name, table in tables.items():
        own = {key: value for key, value in values.items() if key in table.options.model_fields}
        options = table_options(name, table.options, own)
        missing = table.missing(run)
        if missing:
            unmade[name] = missing
            print(f"{name}: missing: {missing}")
            continue
        if not table.in_report:
            unmade[name] = f"it takes long and is made alone: make eval TABLE={name}"
            print(f"{name}: {unmade[name]}")
            continue
        start = perf_counter()
        try:
            result = table.compute(run, options)
        except Exception as error:
            failed += 1
            unmade[name] = f"it failed: {type(error).__name__}: {error}"
            traceback.print_exc()
            continue
        finished.append(FinishedTable(name, table.question, result, perf_counter() - start))
        write_tables(run, name, result)
        print(f"{name}: made in {finished[-1].seconds:.0f} s")
    write_file(run.results / REPORT_FILE, report_html(run, finished, unmade, started).encode())
    print(f"\n{run.results / REPORT_FILE}: {len(finished)} tables, {len(unmade)} not made")
    return failed


def markdown(result: TableResult) -> str:
    """Return the tables of a result as Markdown."""
    return "\n".join(table.markdown() for table in result.tables)


def write_tables(run: DatasetRun, name: str, result: TableResult) -> None:
    """Write the tables as `<name>`, `<name>_2`, ..., all in one `.md`, and the figures as `<name>_<figure>.png`."""
    write_file(run.results / f"{name}.md", markdown(result).encode())
    for number, table in enumerate(result.tables, 1):
        stem = name if number == 1 else f"{name}_{number}"
        write_file(run.results / f"{stem}.csv", table.csv().encode())
        write_file(run.results / f"{stem}.tex", table.latex().encode())
    for figure in result.figures:
        write_file(run.results / f"{name}_{figure.name}.png", figure.png)
