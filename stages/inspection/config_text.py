"""The config that `make inspect` writes: every choice typed out, with its reason as a comment."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from stages.exemplars.model import Model
from stages.exemplars.settings import KitConfig
from stages.shape.resolved_settings import RESOLVED_HUB_SHARE

MAX_SAMPLES_REQUESTED = 200
"""Variants that the config asks for, if there are as many."""
_DUPLICATES = (
    ("graph", "distinct shape graphs, not ways to turn a part in its place"),
    ("histogram", "distinct parts lists; a graph by meaning does not tell a turned leg from a square one"),
)
UNSEEN = 3
"""So many times the layouts of the forecast are asked for: some are far rarer than others, and a short search counts
those that come again and again."""


def dataset_name(models: Sequence[Path]) -> str:
    """A name for a dataset of some model files: that of the first, or of its folder where the file has no telling one.

    Lower-case letters, digits and single dashes, as a config demands.
    """
    first = models[0]
    stem = first.resolve().parent.name if first.stem in {"model", "scene", "mesh"} else first.stem
    return re.sub(r"[^a-z0-9]+", "-", stem.lower()).strip("-")[:64].rstrip("-") or "shapes"


def config_text(
    name: str,
    config: KitConfig,
    models: Sequence[Model],
    reasons: Mapping[str, str],
    asked: Sequence[str],
    said: str,
) -> str:
    """The YAML of a dataset of one kit. `config` leaves nothing open; `reasons` are by key; `asked`: the lines that say
    what is made of it; `said`: the forecast in a sentence."""
    made = config.resolved()
    segmentation = ", ".join(dict.fromkeys(model.segmentation for model in models))
    why = "; ".join(dict.fromkeys(model.why for model in models))
    kit: list[tuple[int, str, Any, str]] = [
        (3, "parts", config.parts, f"{segmentation}: {why}" if config.parts == "auto" else reasons.get("parts", "")),
        (3, "types", config.types, "what makes a part type"),
        *([(3, "label_map", None, "")] if config.label_map else []),
        *((4, _value(name), list(patterns), "") for name, patterns in config.label_map.items()),
        (3, "up", made.up, reasons.get("up", "")),
        (3, "contact", None, ""),
        (4, "tolerance", made.tolerance, reasons.get("contact.tolerance", "")),
        (4, "kinds", list(made.kinds), reasons.get("contact.kinds", "")),
        (3, "grammar", made.grammar, reasons.get("grammar", "")),
        (3, "hubs", None, ""),
        (4, "types", list(made.hubs) or "none", reasons.get("hubs.types", "")),
        (4, "restore", config.hubs.restore, "put back into finished shapes where they fit" if made.hubs else ""),
        (3, "disconnected", made.disconnected, reasons.get("disconnected", "")),
    ]
    lines = [
        "# Written by `make inspect`; ready for `make dataset CONFIG=` this file. Every key is in configs/README.md.",
        f"# Forecast: {said}.",
        f"name: {name}",
        "seed: 1",
        "license: unknown   # of the dataset, as an SPDX id such as CC-BY-4.0",
        "exemplars:",
        "  kits:",
        f"    - name: {name}",
        "      shapes:",
        *(f"        - {json.dumps(str(shape.path), ensure_ascii=False)}" for shape in config.shapes),
        "      credit:   # whose the models are: fill this in, card and manifest say it",
        '        author: ""',
        '        source: ""',
        '        license: ""',
        *(_line(*each) for each in kit),
        *asked,
    ]
    return "\n".join(lines) + "\n"


def variations_section(
    config: KitConfig, reasons: Mapping[str, str], require: Mapping[str, Any], layouts: int | None
) -> list[str]:
    """The lines of a dataset of other layouts. `reasons`: of `require`, what variants must be, by REQUIREMENTS;
    `layouts`: about how many there are, None for very many."""
    wanted = MAX_SAMPLES_REQUESTED if layouts is None else max(1, min(MAX_SAMPLES_REQUESTED, UNSEEN * layouts))
    lines = [
        "variations:",
        _line(
            1,
            "samples_per_kit",
            wanted,
            "more than there may be" if wanted < MAX_SAMPLES_REQUESTED else "raise it for more",
        ),
        "  search:",
        _line(2, "duplicates", *_DUPLICATES[config.types == "meaning"]),
        "  require:",
    ]
    if config.resolved().hubs and config.hubs.restore:
        lines.append(
            _line(2, "hubs", RESOLVED_HUB_SHARE, "a variant with a smaller share of what the exemplars have is refused")
        )
    return [
        *lines,
        *(_line(2, key.removeprefix("require."), value, reasons.get(key, "")) for key, value in require.items()),
    ]


def proportions_section(different: int, stable: bool, why: str, layouts: str) -> list[str]:
    """The lines of a dataset of other proportions. different: how many are to be had; stable: whether shapes must
    stand, and why; layouts: what is to be said of other layouts."""
    more = "raise it for more" if different >= MAX_SAMPLES_REQUESTED else "that differ by proportions.min_difference"
    return [
        "variations:",
        _line(1, "samples_per_kit", 0, f"other layouts: {layouts}"),
        "proportions:",
        _line(
            1,
            "samples_per_kit",
            min(different, MAX_SAMPLES_REQUESTED),
            f"the same parts longer, wider, thicker; {more}",
        ),
        "  require:",
        _line(2, "stable", stable, why),
    ]


def _line(depth: int, key: str, value: Any, comment: str) -> str:
    shown = "" if value is None else " " + _value(value)
    return f"{'  ' * depth}{key}:{shown}" + (f"   # {comment}" if comment else "")


def _value(value: Any) -> str:
    """A value as YAML: lists in one line, text in quotes where it would be read as something else."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(each) for each in value) + "]"
    text = str(value)
    plain = re.fullmatch(r"[A-Za-z_][A-Za-z_-]*", text) and yaml.safe_load(text) == text  # `no` is false
    return text if not isinstance(value, str) or plain else json.dumps(text)
