"""`make inspect`: what model files hold, what a run can make of them, and a config that makes it."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import get_args

from pydantic import ValidationError

from pipeline.errors import ConfigError
from pipeline.paths import write_file
from stages.autoconfig.resolve import REQUIREMENT_KEYS
from stages.autoconfig.settings import AutoconfigConfig
from stages.exemplars.kit_figure import kit_figure
from stages.exemplars.read import read_model
from stages.exemplars.scene_file import READERS
from stages.exemplars.settings import ContactConfig, KitConfig, ReadLimits, Segmentation, ShapeFile
from stages.grammars.inspect import may_have_grammar, write_grammar_report
from stages.grammars.read_surface import is_point_cloud
from stages.inspection.config_text import config_text, dataset_name, proportions_section, variations_section
from stages.inspection.observation import describe_observation, observation_lines
from stages.inspection.report import InspectionReport, inspect_models
from stages.inspection.sample_figure import sample_figure
from stages.shape.kit import ContactKind, Strictness
from stages.shape.resolved_settings import FALLBACK_STABLE_KEY

FOLDER = Path("datasets", "inspect")
"""Where config and pictures go by default."""


def main(arguments: list[str]) -> int:
    """Inspect the models that the command line `arguments` name, and write a config for them.

    Returns the exit code: 0, also for models that a run would refuse; 2 for files that cannot be read.
    """
    options = _parser().parse_args(arguments)
    try:
        paths = [path for text in options.models for path in _paths(text)]
        limits = _limits(options)
        if len(paths) == 1 and is_point_cloud(paths[0], limits):
            _inspect_cloud(options, paths[0], limits)
        else:
            _inspect_meshes(options, paths, limits)
    except ConfigError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def _inspect_meshes(options: argparse.Namespace, paths: Sequence[Path], limits: ReadLimits) -> None:
    models = [read_model(path, options.parts, limits) for path in paths]
    report = inspect_models(_config(options, paths), models, options.tries, limits)
    observation = describe_observation(report.observed, report.models, report.config)
    if options.json:
        written = {} if options.out is None else dict(_write_files(options.out, paths, report))
        files = {title: str(path) for title, path in written.items()}
        print(json.dumps({**observation, **report.as_json(), "files": files}, ensure_ascii=False, allow_nan=False))
        return
    print(*observation_lines(observation, report.config), "", sep="\n")
    _print_rows(report.lines())
    folder = options.out or FOLDER
    _print_rows(_write_files(folder, paths, report))
    if len(models) == 1 and may_have_grammar(models[0], options.parts):
        up = report.config.resolved().up
        _print_rows(write_grammar_report(folder, dataset_name(paths), paths[0], up, limits))


def _inspect_cloud(options: argparse.Namespace, path: Path, limits: ReadLimits) -> None:
    """Print what is in a point cloud: it has no parts, but perhaps a grammar."""
    rows = write_grammar_report(options.out or FOLDER, dataset_name([path]), path, options.up or "y", limits)
    if options.json:
        print(json.dumps({title: str(value) for title, value in rows}, ensure_ascii=False))
        return
    print(f"{path}: a point cloud, which has no parts; its repetitions may give a grammar")
    _print_rows(rows)


def _print_rows(rows: Iterable[tuple[str, Path | str]]) -> None:
    for title, value in rows:
        print(f"{title:<18} {value}", flush=True)


def _write_files(folder: Path, paths: Sequence[Path], report: InspectionReport) -> Iterator[tuple[str, Path]]:
    """Write the picture of the observation, the figure of samples and the config; yield a title and path for each."""
    name, resolution, resizing = dataset_name(paths), report.resolution, report.resizing
    kit = report.observed.kit
    kit = replace(kit, name=" + ".join(exemplar.name for exemplar in kit.exemplars))
    yield "picture", write_file(folder / f"{name}.png", kit_figure(kit))
    if report.shapes:
        title, note = "Most different hits of a short search", report.sentence
        if resizing is not None:
            title, note = "The same resized", f"{resizing.success_rate:.0%} of what is drawn holds together"
        figure = sample_figure(report.built.kit, report.shapes, title, name, note)
        yield "samples", write_file(folder / f"{name}-samples.png", figure)
    if resizing is not None:
        reason = resolution.reasons[FALLBACK_STABLE_KEY]
        others = report.layouts.sentence if report.layouts else "nothing"
        section = proportions_section(resizing.different, resizing.stable, reason, others)
    else:
        require = {key: resolution.values[key] for key in REQUIREMENT_KEYS}
        layouts = report.layouts.layouts if report.layouts is not None else 0
        section = variations_section(report.config, resolution.reasons, require, layouts)
    text = config_text(name, report.config, report.models, resolution.reasons, section, report.sentence)
    yield "config", write_file(folder / f"{name}.yaml", text.encode())


def _paths(text: str) -> list[Path]:
    """Return the models that one argument names: a file, or several with spaces between, as in MESH="a.glb b.glb"."""
    several = [Path(word) for word in text.split()]
    if Path(text).exists() or not all(path.suffix.lower() in READERS for path in several):
        return [Path(text)]
    return several


def _config(options: argparse.Namespace, paths: Sequence[Path]) -> KitConfig:
    contact = {"tolerance": options.tolerance, "kinds": options.kinds}
    settings = {"types": options.types, "up": options.up, "grammar": options.grammar}
    try:
        return KitConfig(
            name="inspected",
            shapes=tuple(ShapeFile(path=path) for path in paths),
            parts=options.parts,
            label_map=dict(options.label),
            contact=ContactConfig(**{key: value for key, value in contact.items() if value is not None}),
            **{key: value for key, value in settings.items() if value is not None},
        )
    except ValidationError as error:
        raise ConfigError(_option_errors(error, "--")) from None


def _limits(options: argparse.Namespace) -> ReadLimits:
    stated = {key: getattr(options, f"max_{key}") for key in ReadLimits.model_fields}
    try:
        return ReadLimits(**{key: value for key, value in stated.items() if value is not None})
    except ValidationError as error:
        raise ConfigError(_option_errors(error, "--max-")) from None


def _option_errors(error: ValidationError, prefix: str) -> str:
    """Return a line for each wrong option, by the name that it has on the command line."""
    faults = error.errors(include_url=False)
    return "\n".join(f"{prefix}{str(fault['loc'][0]).replace('_', '-')}: {fault['msg']}" for fault in faults)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="pipeline inspect",
        description="Show the parts, part types, contacts and grammar of one model, or of several models of one kit, "
        "what may go wrong and what a run will find; and write a config for it.",
    )
    parser.add_argument(
        "models",
        nargs="+",
        metavar="MODEL",
        help="GLB, glTF, OBJ, PLY, STL, OFF or DAE; or one point cloud, PLY or XYZ",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object, for programs")
    parser.add_argument("--parts", choices=get_args(Segmentation), default="auto", help="what makes a part")
    parser.add_argument("--types", choices=["congruence", "labels", "meaning"], help="what makes a part type")
    parser.add_argument(
        "--label", type=_label, action="append", default=[], metavar="NAME=PATTERN,...",
        help="the label of parts whose names do not give it, as exemplars.kits[].label_map in a config",
    )  # fmt: skip
    parser.add_argument("--tolerance", type=float, help="contact tolerance, as a share of the median part's diagonal")
    parser.add_argument("--kinds", type=_kinds, help="kinds of contact that count, such as face or line,face")
    parser.add_argument("--grammar", choices=get_args(Strictness), help="which neighbours a part may have")
    parser.add_argument("--up", choices=["y", "z"], help="the axis that points up")
    for key in ReadLimits.model_fields:
        option = f"--max-{key.replace('_', '-')}"
        parser.add_argument(option, type=int, metavar="MAX", help=f"as exemplars.limits.{key} in a config")
    tries = AutoconfigConfig().max_tries
    parser.add_argument("--tries", type=int, default=tries, help="as autoconfig.max_tries in a config")
    parser.add_argument(
        "--out", type=Path, metavar="FOLDER", help=f"where config and pictures go; {FOLDER}, with --json nowhere"
    )
    return parser


def _kinds(text: str) -> tuple[ContactKind, ...]:
    known = get_args(ContactKind)
    kinds = [word.strip() for word in text.split(",")]
    if not set(kinds) <= set(known):
        raise argparse.ArgumentTypeError(f"{text!r} is no list of {', '.join(known)}")
    return tuple(kind for kind in known if kind in kinds)


def _label(text: str) -> tuple[str, tuple[str, ...]]:
    name, _, patterns = text.partition("=")
    if not name or not patterns:
        raise argparse.ArgumentTypeError(f"{text!r} is no NAME=PATTERN,..., such as leg='*leg*,foot*'")
    return name, tuple(patterns.split(","))
