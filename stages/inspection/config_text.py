"""The config that `make inspect` writes: every resolved setting, with its reason as a comment."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from stages.autoconfig.yield_estimate import MAX_SAMPLES_REQUESTED
from stages.exemplars.model import Model
from stages.exemplars.settings import KitConfig
from stages.shape.resolved_settings import RESOLVED_HUB_SHARE

_DUPLICATES = (
    ("graph", "distinct shape graphs, not ways to turn a part in its place"),
    ("histogram", "distinct parts lists; a graph by meaning does not tell a turned leg from a square one"),
)
REQUESTED_LAYOUTS_FACTOR = 3
"""Samples requested as a multiple of the estimated layouts: rare layouts are missed by a short search."""


def dataset_name(models: Sequence[Path]) -> str:
    """Return a name for a dataset of some model files, in lower-case letters, digits and single dashes.

    It is the name of the first file, or of its folder if the file is called `model`, `scene` or `mesh`.
    """
    first = models[0]
    stem = first.resolve().parent.name if first.stem in {"model", "scene", "mesh"} else first.stem
    return re.sub(r"[^a-z0-9]+", "-", stem.lower()).strip("-")[:64].rstrip("-") or "shapes"


def config_text(
    name: str,
    config: KitConfig,
    models: Sequence[Model],
    reasons: Mapping[str, str],
    section: Sequence[str],
    estimate: str,
    is_refused: bool = False,
) -> str:
    """Return the YAML of a dataset of one kit.

    config: the kit's config with every key resolved.
    reasons: by key.
    section: the lines of the section that says what is made of the kit.
    estimate: the yield estimate, a sentence.
    is_refused: whether a run refuses the models.
    """
    state = "change the models first" if is_refused else "ready for `make dataset CONFIG=` this file"
    settings, keep = config.resolved(), config.appearance.keep
    segmentation = ", ".join(dict.fromkeys(model.segmentation for model in models))
    why = "; ".join(dict.fromkeys(model.why for model in models))
    kit: list[tuple[int, str, Any, str]] = [
        (3, "parts", config.parts, f"{segmentation}: {why}" if config.parts == "auto" else reasons.get("parts", "")),
        (3, "types", config.types, "what makes a part type"),
        *([(3, "label_map", None, "")] if config.label_map else []),
        *((4, _value(name), list(patterns), "") for name, patterns in config.label_map.items()),
        (3, "up", settings.up, reasons.get("up", "")),
        *([(3, "units", config.units, "")] if config.units != "auto" else []),
        *([(3, "appearance", keep, "the models have textures or see-through materials")] if keep != "colors" else []),
        (3, "contact", None, ""),
        (4, "tolerance", settings.tolerance, reasons.get("contact.tolerance", "")),
        (4, "kinds", list(settings.kinds), reasons.get("contact.kinds", "")),
        (3, "grammar", settings.grammar, reasons.get("grammar", "")),
        (3, "hubs", None, ""),
        (4, "types", list(settings.hubs) or "none", reasons.get("hubs.types", "")),
        (4, "restore", config.hubs.restore, "put back into finished shapes where they fit" if settings.hubs else ""),
        (3, "disconnected", settings.disconnected, reasons.get("disconnected", "")),
    ]
    lines = [
        f"# Written by `make inspect`; {state}. Every key is in configs/README.md.",
        f"# Expected: {estimate}.",
        f"name: {name}",
        "seed: 1",
        "license: unknown   # of the dataset, as an SPDX id such as CC-BY-4.0",
        "exemplars:",
        "  kits:",
        f"    - name: {name}",
        "      shapes:",
        *(f"        - {json.dumps(str(shape.path), ensure_ascii=False)}" for shape in config.shapes),
        "      credit:   # whose the models are: fill this in; card and manifest show it",
        '        author: ""',
        '        source: ""',
        '        license: ""',
        *(_line(*row) for row in kit),
        *section,
    ]
    return "\n".join(lines) + "\n"


def variations_section(
    config: KitConfig, reasons: Mapping[str, str], require: Mapping[str, Any], layouts: int | None
) -> list[str]:
    """Return the lines of a dataset of new layouts.

    reasons: by key.
    require: the requirements of variants, by REQUIREMENT_KEYS.
    layouts: estimated number of layouts; None if very many.
    """
    enough = MAX_SAMPLES_REQUESTED
    wanted = enough if layouts is None else max(1, min(enough, REQUESTED_LAYOUTS_FACTOR * layouts))
    lines = [
        "variations:",
        _line(1, "samples_per_kit", wanted, "more than there may be" if wanted < enough else "raise it for more"),
        "  search:",
        _line(2, "duplicates", *_DUPLICATES[config.types == "meaning"]),
        "  require:",
    ]
    if config.resolved().hubs and config.hubs.restore:
        comment = "a variant with a smaller share of the exemplars' hubs is rejected"
        lines.append(_line(2, "min_hubs", RESOLVED_HUB_SHARE, comment))
    return [
        *lines,
        *(_line(2, key.removeprefix("require."), value, reasons.get(key, "")) for key, value in require.items()),
    ]


def proportions_section(different: int, stable: bool, why: str, layouts: str, has_rows: bool) -> list[str]:
    """Return the lines of a dataset of resized exemplars.

    different: number of different shapes that can be found.
    stable: whether shapes must be stable; `why` is the reason.
    layouts: the yield estimate of new layouts, a sentence.
    has_rows: whether rows of the exemplars become longer and shorter, or fronts are divided.
    """
    more = "raise it for more" if different >= MAX_SAMPLES_REQUESTED else "that differ by proportions.min_difference"
    return [
        "variations:",
        _line(1, "samples_per_kit", 0, f"other layouts: {layouts}"),
        *(
            ["  rows:", _line(2, "use", True, "resized exemplars get other rows and divided fronts")]
            if has_rows
            else []
        ),
        "proportions:",
        _line(1, "samples_per_kit", min(different, MAX_SAMPLES_REQUESTED), f"the same parts resized; {more}"),
        "  require:",
        _line(2, "stable", stable, why),
    ]


def _line(depth: int, key: str, value: Any, comment: str) -> str:
    shown = "" if value is None else " " + _value(value)
    return f"{'  ' * depth}{key}:{shown}" + (f"   # {comment}" if comment else "")


def _value(value: Any) -> str:
    """Return a value as YAML: lists in one line, text in quotes if it would be read as another type."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    text = str(value)
    plain = re.fullmatch(r"[A-Za-z_][A-Za-z_-]*", text) and yaml.safe_load(text) == text  # `no` is false
    return text if not isinstance(value, str) or plain else json.dumps(text, ensure_ascii=False)
