"""`shapemill inspect`: what model files hold, what a run can make of them, and a config that makes it."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

import typer
from pydantic import ValidationError

from pipeline.config import explain_mistakes
from pipeline.display import ticking
from pipeline.errors import ConfigError
from pipeline.options import DATASETS, DEFAULT_CONFIG, DEFAULT_OUT, INSPECTION, ConfigOption, OutOption
from stages.autoconfig.settings import AutoconfigConfig

if TYPE_CHECKING:
    from stages.exemplars.settings import KitConfig
    from stages.model_files.limits import ReadLimits

DEFAULT_FOLDER = Path("datasets", "inspect")

COMMANDS = typer.Typer()


@COMMANDS.command(rich_help_panel=INSPECTION)
def inspect(
    models: Annotated[
        list[str],
        typer.Argument(metavar="MODEL", help="GLB, glTF, OBJ, PLY, STL, OFF or DAE; or a cloud or table of points"),
    ],
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object, for programs")] = False,
    as_table: Annotated[bool, typer.Option("--table", help="print a Markdown row for each model by itself")] = False,
    parts: Annotated[str, typer.Option(help="what makes a part, as exemplars.kits[].parts")] = "auto",
    types: Annotated[str | None, typer.Option(help="what makes a part type: congruence, labels or meaning")] = None,
    label: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=PATTERN,...", help="label of parts whose names do not give it, as in label_map"),
    ] = None,
    tolerance: Annotated[float | None, typer.Option(help="contact tolerance, in diagonals of the median part")] = None,
    kinds: Annotated[str | None, typer.Option(help="kinds of contact that count, such as face or line,face")] = None,
    grammar: Annotated[str | None, typer.Option(help="which neighbours a part may have, as in a config")] = None,
    up: Annotated[str | None, typer.Option(help="the axis that points up: y or z")] = None,
    max_cpu_seconds: Annotated[int | None, typer.Option(help="as exemplars.limits.cpu_seconds")] = None,
    max_memory_mb: Annotated[int | None, typer.Option(help="as exemplars.limits.memory_mb")] = None,
    max_parts: Annotated[int | None, typer.Option(help="as exemplars.limits.parts")] = None,
    max_triangles: Annotated[int | None, typer.Option(help="as exemplars.limits.triangles")] = None,
    tries: Annotated[int, typer.Option(min=1, help="as autoconfig.max_tries")] = AutoconfigConfig().max_tries,
    out: Annotated[
        Path | None, typer.Option(help=f"folder of config and pictures: {DEFAULT_FOLDER}, with --json none")
    ] = None,
) -> None:
    """Show what can be made of a mesh, or of several models of one kit, and write a config for it."""
    from stages.exemplars.read import read_parts
    from stages.exemplars.settings import AppearanceConfig, KitConfig
    from stages.grammars.inspect import may_have_grammar, write_grammar_report
    from stages.grammars.read_surface import is_point_cloud
    from stages.inspection.config_text import dataset_name
    from stages.inspection.files import write_report_files
    from stages.inspection.observation import describe_observation, observation_lines
    from stages.inspection.report import inspect_models
    from stages.model_files.folder import model_paths
    from stages.model_files.limits import ReadLimits
    from stages.shape.input_file import check_exists

    stated_limits = {
        "cpu_seconds": max_cpu_seconds,
        "memory_mb": max_memory_mb,
        "parts": max_parts,
        "triangles": max_triangles,
    }
    contact = {"tolerance": tolerance, "kinds": None if kinds is None else _kinds(kinds)}
    paths = [path for text in models for path in model_paths(text)]
    for path in paths:
        check_exists(path)
    settings = {"parts": parts, "types": types, "label_map": _label_map(label or []), "up": up, "grammar": grammar}
    try:
        limits = ReadLimits.model_validate(_stated(stated_limits))
        config = KitConfig.model_validate(
            {"name": "inspected", "shapes": tuple(paths), "contact": _stated(contact), **_stated(settings)}
        )
    except ValidationError as error:
        raise _wrong_options(error) from None
    if as_table:
        _print_table(config, paths, limits, tries)
        return
    name, folder = dataset_name(paths), out or DEFAULT_FOLDER
    if len(paths) == 1 and is_point_cloud(paths[0], limits):
        rows = write_grammar_report(folder, name, paths[0], up or "y", limits)
        if as_json:
            print(json.dumps({title: str(value) for title, value in rows}, ensure_ascii=False))
            return
        print(f"{paths[0]}: a point cloud, which has no parts; its repetitions may give a grammar")
        _print_rows(rows)
        return
    read = []
    textures = AppearanceConfig(keep="textures")
    for path in paths:
        read.append(read_parts(path, config.parts, limits, config.units, textures.kept_texture_size))
        if not as_json:
            print(f"{path}: {len(read[-1].parts)} parts by {read[-1].segmentation}", file=sys.stderr, flush=True)
    if any(model.shows_more_than_colors for model in read):
        config = config.model_copy(update={"appearance": textures})
    else:
        read = [model.with_colors_alone() for model in read]
    if as_json:
        report = inspect_models(config, read, tries, limits)
    else:
        with ticking("inspect", "looking for settings and trying them out") as say:
            report = inspect_models(config, read, tries, limits, say)
    observation = describe_observation(report.observed, report.models, report.config)
    if as_json:
        written = {} if out is None else dict(write_report_files(out, paths, report))
        files = {title: str(path) for title, path in written.items()}
        print(json.dumps({**observation, **report.as_json(), "files": files}, ensure_ascii=False, allow_nan=False))
        return
    print(*observation_lines(observation, report.config), "", sep="\n")
    _print_rows(report.lines())
    with ticking("inspect", "drawing the sheets"):
        written_rows = list(write_report_files(folder, paths, report))
    _print_rows(written_rows)
    if len(read) == 1 and may_have_grammar(read[0], parts):
        _print_rows(write_grammar_report(folder, name, paths[0], report.config.resolved().up, limits))


@COMMANDS.command(rich_help_panel=DATASETS)
def with_models(
    models: Annotated[list[str], typer.Argument(metavar="MODEL", help="models, or a folder of them")],
    config: ConfigOption = DEFAULT_CONFIG,
    out: OutOption = DEFAULT_OUT,
) -> None:
    """Write a config with models in place of its kits, as OUT/<name>.yaml, and print its path."""
    from pipeline.paths import write_file
    from stages.inspection.models_config import config_with_models
    from stages.model_files.folder import model_paths

    paths = [path for text in models for path in model_paths(text)]
    name, content, warnings = config_with_models(config, paths)
    print(*warnings, sep="\n", end="\n" if warnings else "", file=sys.stderr)
    print(write_file(out / f"{name}.yaml", content))


def _print_rows(rows: Iterable[tuple[str, Path | str]]) -> None:
    for title, value in rows:
        print(f"{title:<18} {value}", flush=True)


def _print_table(config: KitConfig, paths: list[Path], limits: ReadLimits, tries: int) -> None:
    """Print a Markdown table, a row for each model as soon as it is inspected."""
    from stages.exemplars.read import read_parts
    from stages.exemplars.settings import ShapeFile
    from stages.inspection.config_text import dataset_name
    from stages.inspection.report import inspect_models

    for number, path in enumerate(paths):
        try:
            alone = config.model_copy(update={"shapes": (ShapeFile(path=path),)})
            models = [read_parts(path, config.parts, limits, config.units)]
            report = inspect_models(alone, models, tries, limits)
        except ConfigError as error:
            print(error, file=sys.stderr)
            continue
        cells = {"model": dataset_name([path]), **report.table_cells()}
        if number == 0:
            print(f"| {' | '.join(cells)} |\n|{'---|' * len(cells)}")
        print(f"| {' | '.join(cells.values())} |", flush=True)


def _stated(settings: Mapping[str, object]) -> dict[str, object]:
    return {key: value for key, value in settings.items() if value is not None}


def _kinds(text: str) -> tuple[str, ...]:
    """Return kinds of contact in the order of ContactKind; KitConfig refuses unknown ones."""
    from stages.shape.kit import ContactKind

    known = get_args(ContactKind)
    kinds = {kind.strip() for kind in text.split(",")}
    return (*(kind for kind in known if kind in kinds), *sorted(kinds - set(known)))


def _label_map(labels: list[str]) -> dict[str, tuple[str, ...]]:
    label_map = {}
    for text in labels:
        name, _, patterns = text.partition("=")
        if not name or not patterns:
            raise typer.BadParameter(
                f"must be NAME=PATTERN,..., such as leg='*leg*,foot*', and is {text!r}", param_hint="--label"
            )
        label_map[name] = tuple(patterns.split(","))
    return label_map


def _wrong_options(error: ValidationError) -> typer.BadParameter:
    """Return what is wrong with the options, by their names."""
    from stages.exemplars.settings import KitConfig
    from stages.model_files.limits import ReadLimits

    faults = list(explain_mistakes(ReadLimits if error.title == "ReadLimits" else KitConfig, error))
    keys = [str(loc[1] if loc[0] == "contact" and len(loc) > 1 else loc[0]) if loc else "options" for loc, _ in faults]
    limited = error.title == "ReadLimits"
    hints = [f"--{'max-' * limited}{key.replace('_', '-')}" for key in keys]
    return typer.BadParameter("; ".join(f"{hint}: {text}" for hint, (_, text) in zip(hints, faults, strict=True)))
