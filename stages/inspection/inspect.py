"""`make inspect`: what Shapemill sees in model files and what it can make of them, and a config that makes it."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
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
from stages.exemplars.segmentation import Segmentation
from stages.exemplars.settings import ContactConfig, KitConfig, ReadLimits, ShapeFile
from stages.grammars.inspect import may_have_grammar, write_grammar_report
from stages.grammars.read_surface import is_point_cloud
from stages.inspection.config_text import config_text, dataset_name, proportions_section, variations_section
from stages.inspection.observation import describe_observation, observation_lines
from stages.inspection.report import InspectionReport, inspect_models
from stages.inspection.sample_figure import sample_figure
from stages.shape.kit import ContactKind, Strictness
from stages.shape.resolved_settings import FALLBACK_STABLE_KEY

FOLDER = Path("datasets", "inspect")
"""Where the config and the pictures go if nobody says where."""


def main(arguments: list[str]) -> int:
    """Show what is in the models that the command line `arguments` name, and write a config for them. Returns the exit
    code: 0, also for models that a run would refuse; 2 for files that cannot be read."""
    asked = _parser().parse_args(arguments)
    try:
        paths = [path for text in asked.models for path in _paths(text)]
        limits = _limits(asked)
        if len(paths) == 1 and is_point_cloud(paths[0], limits):
            _show_cloud(asked, paths[0], limits)
            return 0
        models = [read_model(path, asked.parts, limits) for path in paths]
        config = _config(asked, paths)
        found = inspect_models(config, models, asked.tries, limits)
        seen = describe_observation(found.seen, found.models, found.config)
        if asked.json:
            written = {} if asked.out is None else dict(_written(asked.out, paths, found))
            files = {title: str(path) for title, path in written.items()}
            print(json.dumps({**seen, **found.as_json(), "files": files}, ensure_ascii=False, allow_nan=False))
            return 0
        for line in observation_lines(seen, found.config):
            print(line)
        print()
        for title, line in found.lines():
            print(f"{title:<18} {line}")
        sys.stdout.flush()
        for title, path in _written(asked.out or FOLDER, paths, found):
            print(f"{title:<18} {path}")
        if len(models) == 1 and may_have_grammar(models[0], asked.parts):
            sys.stdout.flush()
            up, name = found.config.resolved().up, dataset_name(paths)
            for title, said in write_grammar_report(asked.out or FOLDER, name, paths[0], up, limits):
                print(f"{title:<18} {said}")
    except ConfigError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def _show_cloud(asked: argparse.Namespace, path: Path, limits: ReadLimits) -> None:
    """Print what there is in a point cloud: no parts, but perhaps a grammar."""
    found = write_grammar_report(asked.out or FOLDER, dataset_name([path]), path, asked.up or "y", limits)
    if asked.json:
        print(json.dumps({title: str(said) for title, said in found}, ensure_ascii=False))
        return
    print(f"{path}: a point cloud, which has no parts; of what is alike in it a grammar can be made")
    for title, said in found:
        print(f"{title:<18} {said}", flush=True)


def _written(folder: Path, paths: Sequence[Path], found: InspectionReport) -> Iterator[tuple[str, Path]]:
    """Write the picture of what was seen, the sheet of what it can become and the config; what each is, and where."""
    name = dataset_name(paths)
    kit = replace(found.seen.kit, name=" + ".join(each.name for each in found.seen.kit.exemplars))
    yield "picture", write_file(folder / f"{name}.png", kit_figure(kit))
    layouts = found.yield_estimate.layouts if found.yield_estimate is not None else 0
    if found.shapes:
        title, note = "Most different finds of a short search", found.sentence
        if found.proportioned is not None:
            title, note = (
                "The same in other proportions",
                f"{found.proportioned.holds:.0%} of what is drawn holds together",
            )
        sheet = sample_figure(found.built.kit, found.shapes, title, name, note)
        yield "sheet", write_file(folder / f"{name}-forecast.png", sheet)
    if found.proportioned is not None:
        why = found.choices.reasons[FALLBACK_STABLE_KEY]
        others = found.yield_estimate.sentence if found.yield_estimate else "nothing"
        asked = proportions_section(found.proportioned.different, found.proportioned.stable, why, others)
    else:
        require = {key: found.choices.values[key] for key in REQUIREMENT_KEYS}
        asked = variations_section(found.config, found.choices.reasons, require, layouts)
    text = config_text(name, found.config, found.models, found.choices.reasons, asked, found.sentence)
    yield "config", write_file(folder / f"{name}.yaml", text.encode())


def _paths(text: str) -> list[Path]:
    """The models that one argument names: a file, or several with spaces between them, as in MESH="a.glb b.glb"."""
    several = [Path(each) for each in text.split()]
    if Path(text).exists() or not all(each.suffix.lower() in READERS for each in several):
        return [Path(text)]
    return several


def _config(asked: argparse.Namespace, paths: Sequence[Path]) -> KitConfig:
    contact = {"tolerance": asked.tolerance, "kinds": asked.kinds}
    settings = {"types": asked.types, "up": asked.up, "grammar": asked.grammar}
    try:
        return KitConfig(
            name="inspected",
            shapes=tuple(ShapeFile(path=path) for path in paths),
            parts=asked.parts,
            label_map=dict(asked.meaning),
            contact=ContactConfig(**{key: value for key, value in contact.items() if value is not None}),
            **{key: value for key, value in settings.items() if value is not None},
        )
    except ValidationError as error:
        lines = [f"--{each['loc'][0]}: {each['msg']}" for each in error.errors(include_url=False)]
        raise ConfigError("\n".join(lines)) from None


def _limits(asked: argparse.Namespace) -> ReadLimits:
    said = {key: getattr(asked, f"most_{key}") for key in ReadLimits.model_fields}
    try:
        return ReadLimits(**{key: value for key, value in said.items() if value is not None})
    except ValidationError as error:
        lines = [
            f"--most-{str(each['loc'][0]).replace('_', '-')}: {each['msg']}" for each in error.errors(include_url=False)
        ]
        raise ConfigError("\n".join(lines)) from None


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="pipeline inspect",
        description="Show what Shapemill sees in one model, or in several models of one kit: parts, part types, "
        "contacts, grammar, what may go wrong, and what will come of it; and write a config for it.",
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
        "--meaning", type=_meaning, action="append", default=[], metavar="NAME=PATTERN,...",
        help="what parts mean whose names do not say so, as exemplars.kits[].label_map in a config",
    )  # fmt: skip
    parser.add_argument("--tolerance", type=float, help="contact tolerance, as a share of the median part's diagonal")
    parser.add_argument("--kinds", type=_kinds, help="kinds of contact that count, such as face or line,face")
    parser.add_argument("--grammar", choices=get_args(Strictness), help="which neighbours a part may have")
    parser.add_argument("--up", choices=["y", "z"], help="the axis that points up")
    for key in ReadLimits.model_fields:
        option = f"--most-{key.replace('_', '-')}"
        parser.add_argument(option, type=int, metavar="MOST", help=f"as exemplars.limits.{key} in a config")
    parser.add_argument(
        "--tries", type=int, default=AutoconfigConfig().max_tries, help="as autoconfig.max_tries in a config"
    )
    parser.add_argument(
        "--out", type=Path, metavar="FOLDER", help=f"where config and pictures go; {FOLDER}, with --json nowhere"
    )
    return parser


def _kinds(text: str) -> tuple[ContactKind, ...]:
    known = get_args(ContactKind)
    asked = [each.strip() for each in text.split(",")]
    if not set(asked) <= set(known):
        raise argparse.ArgumentTypeError(f"{text!r} is no list of {', '.join(known)}")
    return tuple(kind for kind in known if kind in asked)


def _meaning(text: str) -> tuple[str, tuple[str, ...]]:
    name, _, patterns = text.partition("=")
    if not name or not patterns:
        raise argparse.ArgumentTypeError(f"{text!r} is no NAME=PATTERN,..., such as leg='*leg*,foot*'")
    return name, tuple(patterns.split(","))
