"""`make eval`: tables about a finished dataset, or about files, kept as Markdown, CSV and LaTeX; and the report.

python -m eval [--config YAML] [--out FOLDER]                     lists the tables, and what each still needs
python -m eval TABLE [--config YAML] [--out FOLDER] [OPTION...]   prints one and keeps it
python -m eval TABLE [OPTION...] FILE...                          prints one about files, if it can be made of files
python -m eval all [--config YAML] [--out FOLDER] [OPTION...]     makes every table that can be made, and the report

A table is kept as `OUT/<dataset>-eval/<table>.md`, `.csv` and `.tex`, its sheets of pictures beside it as `.png`, the
report as `OUT/<dataset>-eval/report.html`. Of a table about files its sheets alone are kept, in `OUT/eval`.
"""

from __future__ import annotations

import argparse
import os
import sys
import traceback
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from time import perf_counter

from eval.engine.dataset_run import DatasetRun, load_dataset_run
from eval.engine.evaluation import Evaluation, TableResult
from eval.engine.registry import find_tables
from pipeline.config import nearest_word
from pipeline.errors import ConfigError
from pipeline.paths import write_file

ALL = "all"
REPORT = "report.html"


def main(arguments: list[str]) -> int:
    """Do what the arguments ask for; 0, or 2 with a message where that cannot be, or 1 where a table of all failed."""
    # Solvers of small systems on a busy machine: threads that wait for each other take a hundred times as long.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Small networks there: threads that wait without sleeping take up to fifteen times the processor's time.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    tables = find_tables()
    asked = _parser(tables).parse_args(arguments)
    try:
        if asked.files:
            return _print_of_files(_known(tables, asked.table), asked)
        subject = load_dataset_run(asked.config, asked.out)
        if not asked.table:
            print(listing(subject, tables), end="")
            return 0
        if asked.table == ALL:
            return _make_all(subject, tables, asked)
        return _make_one(subject, _known(tables, asked.table), asked)
    except ConfigError as error:
        print(error, file=sys.stderr)
        return 2


def _parser(tables: Mapping[str, Evaluation]) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m eval", description="Tables about datasets.")
    parser.add_argument("table", nargs="?", default="", help=f"{', '.join(tables)} or {ALL}; without, they are listed")
    parser.add_argument("files", nargs="*", type=Path, help="models or boxes instead of the dataset")
    parser.add_argument("--config", type=Path, default=Path("configs/default.yaml"), help="the dataset's YAML")
    parser.add_argument("--out", type=Path, default=Path("datasets"), help="folder that datasets are made in")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes for tables of many models")
    for each in tables.values():
        each.options(parser)
    return parser


def _known(tables: Mapping[str, Evaluation], name: str) -> str:
    if name not in tables:
        close = nearest_word(name, tables)
        raise ConfigError(f"there is no table {name}; " + (f"did you mean {close}?" if close else ", ".join(tables)))
    return name


def listing(subject: DatasetRun, tables: Mapping[str, Evaluation]) -> str:
    """Every table with its question, and what it needs that is not there, or how long it takes."""
    where = f"{subject.folder}, {subject.samples:,} shapes" if subject.manifest else f"nothing in {subject.folder} yet"
    lines = [f"Tables about {subject.config.name} ({where}):", ""]
    width = max(map(len, tables)) + 2
    for name, each in tables.items():
        missing = each.missing(subject)
        state = f"missing: {missing}" if missing else f"can be made, takes about {_duration(each.seconds(subject))}"
        lines += [f"  {name:<{width}}{each.question}", f"  {'':<{width}}{state}"]
        lines += [f"  {'':<{width}}needs {', '.join(need.what for need in each.needs)}", ""]
    lines.append(f"make eval TABLE=<name> prints one; TABLE={ALL} makes all that can be made, and {REPORT}")
    return "\n".join(lines) + "\n"


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"


def _print_of_files(name: str, asked: argparse.Namespace) -> int:
    of_files = find_tables()[name].of_files
    if of_files is None:
        raise ConfigError(f"{name} is a table about datasets, not about files; leave out {asked.files[0]}")
    answer = of_files(asked.files, asked)
    print(_markdown(answer), end="")
    for sheet in answer.sheets:
        print(f"\n{sheet.title}: {write_file(asked.out / 'eval' / f'{name}_{sheet.name}.png', sheet.picture)}")
    return 0


def _make_one(subject: DatasetRun, name: str, asked: argparse.Namespace) -> int:
    from eval.engine.report import FinishedTable, report_html

    evaluation = find_tables()[name]
    missing = evaluation.missing(subject)
    if missing:
        raise ConfigError(f"{name}: {missing}")
    start, began = perf_counter(), datetime.now(UTC)
    answer = evaluation.answer(subject, asked)
    _keep(subject, name, answer)
    made = FinishedTable(name, evaluation.question, answer, perf_counter() - start)
    write_file(subject.results / f"{name}.html", report_html(subject, [made], {}, began).encode())
    print(_markdown(answer), end="")
    drawn = ", with curves and pictures" if answer.curves or answer.strips else ""
    print(f"\nAlso in {subject.results}: {name}.html{drawn}, {name}.md, {name}.csv, {name}.tex")
    return 0


def _make_all(subject: DatasetRun, tables: Mapping[str, Evaluation], asked: argparse.Namespace) -> int:
    """Make every table that has what it needs, one after another; a failure is told and takes no other with it."""
    from eval.engine.report import FinishedTable, report_html

    made: list[FinishedTable] = []
    unmade: dict[str, str] = {}
    failed, began = 0, datetime.now(UTC)
    for name, evaluation in tables.items():
        missing = evaluation.missing(subject)
        if missing:
            unmade[name] = missing
            print(f"{name}: missing: {missing}")
            continue
        start = perf_counter()
        try:
            answer = evaluation.answer(subject, asked)
        except Exception as error:
            failed += 1
            unmade[name] = f"it failed: {type(error).__name__}: {error}"
            traceback.print_exc()
            continue
        made.append(FinishedTable(name, evaluation.question, answer, perf_counter() - start))
        _keep(subject, name, answer)
        print(f"{name}: made in {made[-1].seconds:.0f} s")
    write_file(subject.results / REPORT, report_html(subject, made, unmade, began).encode())
    print(f"\n{subject.results / REPORT}: {len(made)} tables, {len(unmade)} not made")
    return 1 if failed else 0


def _markdown(answer: TableResult) -> str:
    return "\n".join(table.markdown() for table in answer.tables)


def _keep(subject: DatasetRun, name: str, answer: TableResult) -> None:
    """Write the tables of an answer: the first as `<name>`, others as `<name>_2` and so on, but all in one `.md`; and
    its sheets, as `<name>_<sheet>.png`."""
    write_file(subject.results / f"{name}.md", _markdown(answer).encode())
    for place, table in enumerate(answer.tables):
        stem = name if place == 0 else f"{name}_{place + 1}"
        write_file(subject.results / f"{stem}.csv", table.csv().encode())
        write_file(subject.results / f"{stem}.tex", table.latex().encode())
    for sheet in answer.sheets:
        write_file(subject.results / f"{name}_{sheet.name}.png", sheet.picture)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
