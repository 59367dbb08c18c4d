"""`make inspect`: what Shapemill sees in model files, before hours are spent on them."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
from pydantic import ValidationError

from pipeline.errors import ConfigError
from stages.exemplars.build import Observation, observe_models
from stages.exemplars.findings import hubs, mirror_twins, pieces, ways_together
from stages.exemplars.portrait import kit_sheet
from stages.exemplars.read import Model, read_model
from stages.exemplars.segment import Segmentation
from stages.exemplars.settings import ContactConfig, KitConfig
from stages.shape.kit import ContactKind
from stages.shape.kit_files import describe_kit

__all__ = ["inspection", "main"]

MOST_ROWS = 40
"""So many part types are listed for people."""
PICTURES = Path("datasets", "inspect")
"""Where the picture goes if nobody says where."""


def main(arguments: list[str]) -> int:
    """Show what is in the models that the command line `arguments` name. Returns the exit code: 0, also for models
    that a run would refuse; 2 for files that cannot be read."""
    asked = _parser().parse_args(arguments)
    try:
        models = [read_model(path, asked.parts) for path in asked.models]
        config = _config(asked)
        seen = observe_models(config, models)
        found = inspection(seen, models, config)
        if asked.json:
            if asked.picture is not None:
                found["picture"] = str(_draw(seen, asked.picture))
            print(json.dumps(found, ensure_ascii=False, allow_nan=False))
        else:
            for line in _text(found, config):
                print(line)
            sys.stdout.flush()
            print(f"picture: {_draw(seen, asked.picture or PICTURES / f'{models[0].path.stem}.png')}")
    except ConfigError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def inspection(seen: Observation, models: Sequence[Model], config: KitConfig) -> dict[str, Any]:
    """What was found, as JSON.

    For one model `parts` (name and type, in the order of the file), `contacts` (those that count, as pairs i < j of
    indices into `parts`, sorted), `contact_kinds` (every contact, with its kind), `pieces`, `hubs` and `segmentation`
    stand at the top; for several, in one object a model under `models`. Beside them stands what the models share:
    `types`, `mirror_twins`, `neighbourhoods`, `dockings`, `tolerance`, `repairs`, `warnings`.
    """
    kit = seen.kit
    names = kit.type_names()
    counts = np.bincount(np.concatenate([each.assembly.types for each in kit.exemplars]), minlength=len(names))
    described = describe_kit(kit)
    shared = {
        "types": [
            {"name": each.name, "count": int(count), "triangles": len(each.faces), "symmetries": len(each.symmetries)}
            for each, count in zip(kit.types, counts, strict=True)
        ],
        "mirror_twins": [[names[i], names[j]] for i, j in mirror_twins(kit.types, config.congruence_tolerance)],
        "neighbourhoods": described["neighbourhoods"],
        "dockings": described["dockings"],
        "tolerance": kit.contact_tolerance,
        "repairs": dict(seen.repairs),
        "warnings": [*seen.refusals, *ways_together(kit), *seen.warnings],
    }
    each_model = [_model(seen, index, model) for index, model in enumerate(models)]
    return {**each_model[0], **shared} if len(models) == 1 else {"models": each_model, **shared}


def _model(seen: Observation, index: int, model: Model) -> dict[str, Any]:
    exemplar = seen.kit.exemplars[index]
    assembly, names = exemplar.assembly, exemplar.part_names
    piece = pieces(assembly)
    degrees = np.bincount(assembly.edges.ravel(), minlength=len(assembly)).tolist()
    return {
        "model": str(model.path),
        "segmentation": {"parts": model.segmentation, "why": model.why},
        "parts": [
            {"name": name, "type": seen.kit.types[each].name} for name, each in zip(names, assembly.types, strict=True)
        ],
        "contacts": assembly.edges.tolist(),
        "contact_kinds": [
            [i, j, kind] for (i, j), kind in zip(seen.contacts[index].tolist(), seen.kinds[index], strict=True)
        ],
        "pieces": [np.flatnonzero(piece == number).tolist() for number in range(int(piece.max()) + 1)],
        "hubs": [{"part": part, "name": names[part], "contacts": degrees[part]} for part in hubs(assembly)],
    }


def _text(found: dict[str, Any], config: KitConfig) -> Iterator[str]:
    models = found.get("models", [found])
    for model in models:
        yield model["model"]
        for title, line in _model_lines(model, config):
            yield f"  {title:<10} {line}"
        yield ""
    types = found["types"]
    rules = sum(len(each) for each in found["neighbourhoods"].values())
    twins = {name: other for pair in found["mirror_twins"] for name, other in (pair, pair[::-1])}
    parts = [[part["type"] for part in model["parts"]] for model in models]
    header = ["type", *(f"in {number + 1}" for number in range(len(models))), "triangles", "symmetries", ""]
    if len(models) == 1:
        header[1] = "parts"
    rows = [
        [
            each["name"],
            *(str(names.count(each["name"])) for names in parts),
            str(each["triangles"]),
            str(each["symmetries"]),
            f"mirror image of {twins[each['name']]}" if each["name"] in twins else "",
        ]
        for each in sorted(types, key=lambda each: -each["count"])
    ]
    yield from _table([header, *rows[:MOST_ROWS]])
    if len(rows) > MOST_ROWS:
        yield f"and {len(rows) - MOST_ROWS} more types, of {sum(each['count'] for each in types)} parts in all"
    yield ""
    yield f"tolerance  {found['tolerance']:.4g} units, {config.contact.tolerance:g} of the median part's diagonal"
    repaired = ", ".join(f"{count} {kind.replace('_', ' ')}" for kind, count in found["repairs"].items())
    yield f"repairs    {repaired or 'none needed'}"
    yield f"grammar    {rules} neighbourhoods, {len(found['dockings'])} dockings of {len(types)} part types"
    if twins:
        yield "mirrored   a part and its mirror image are one type with `mirror_images_match: true`"
    for number, warning in enumerate(found["warnings"]):
        yield f"{'' if number else 'warnings':<10} - {warning}"


def _model_lines(model: dict[str, Any], config: KitConfig) -> Iterator[tuple[str, str]]:
    """What is particular to one model, as title and line."""
    kinds = [kind for _, _, kind in model["contact_kinds"]]
    sizes = [len(each) for each in model["pieces"]]
    degrees = np.bincount(np.array(model["contacts"], dtype=int).ravel(), minlength=len(model["parts"]))
    yield "parts", f"{len(model['parts'])} by {model['segmentation']['parts']} ({model['segmentation']['why']})"
    words = {"face": "over a face", "line": "along a line", "point": "in a point"}
    found = ", ".join(f"{kinds.count(kind)} {word}" for kind, word in words.items() if kind in kinds)
    uncounted = len(kinds) - len(model["contacts"])
    aside = f"; {uncounted} of them do not count, only kinds {', '.join(config.contact.kinds)}" if uncounted else ""
    yield "contacts", f"{len(kinds)}" + (f": {found}" if found else "") + aside
    yield "connected", "yes" if len(sizes) == 1 else f"no, pieces of {', '.join(map(str, sizes))} parts"
    if len(degrees) > 1:
        yield "degree", f"a part touches {degrees.min()} to {degrees.max()} others, {degrees.mean():.1f} on average"


def _table(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Lines with the first and the last column to the left and the others to the right."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for first, *middle, last in rows:
        cells = [first.ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(middle, widths[1:], strict=False))]
        yield "  ".join([*cells, last]).rstrip()


def _draw(seen: Observation, path: Path) -> Path:
    """The picture of everything seen, in a file."""
    title = " + ".join(each.name for each in seen.kit.exemplars)
    picture = kit_sheet(replace(seen.kit, name=title))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(picture)
    except OSError as error:
        raise ConfigError(f"{path}: the picture cannot be written there: {error.strerror}") from None
    return path


def _config(asked: argparse.Namespace) -> KitConfig:
    contact = {"tolerance": asked.tolerance, "kinds": asked.kinds}
    settings = {"types": asked.types, "up": asked.up}
    try:
        return KitConfig(
            name="inspected",
            shapes=tuple(asked.models),
            parts=asked.parts,
            contact=ContactConfig(**{key: value for key, value in contact.items() if value is not None}),
            **{key: value for key, value in settings.items() if value is not None},
        )
    except ValidationError as error:
        lines = [f"--{each['loc'][0]}: {each['msg']}" for each in error.errors(include_url=False)]
        raise ConfigError("\n".join(lines)) from None


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="pipeline inspect",
        description="Show what Shapemill sees in one model, or in several models of one kit: parts, part types, "
        "contacts, grammar, and what may go wrong.",
    )
    parser.add_argument("models", nargs="+", type=Path, metavar="MODEL", help="GLB, glTF, OBJ, PLY, STL, OFF or DAE")
    parser.add_argument("--json", action="store_true", help="print one JSON object, for programs")
    parser.add_argument("--parts", choices=get_args(Segmentation), default="auto", help="what makes a part")
    parser.add_argument("--types", choices=["congruence", "labels", "meaning"], help="what makes a part type")
    parser.add_argument("--tolerance", type=float, help="contact tolerance, as a share of the median part's diagonal")
    parser.add_argument("--kinds", type=_kinds, help="kinds of contact that count, such as face or line,face")
    parser.add_argument("--up", choices=["y", "z"], help="the axis that points up, for the picture")
    parser.add_argument("--picture", type=Path, metavar="FILE", help=f"where the PNG goes; {PICTURES}/<model>.png")
    return parser


def _kinds(text: str) -> tuple[ContactKind, ...]:
    known = get_args(ContactKind)
    asked = [each.strip() for each in text.split(",")]
    if not set(asked) <= set(known):
        raise argparse.ArgumentTypeError(f"{text!r} is no list of {', '.join(known)}")
    return tuple(kind for kind in known if kind in asked)
