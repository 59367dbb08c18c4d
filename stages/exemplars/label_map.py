"""Label parts by the config's label map, if their models have no labels or useless ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fnmatch import fnmatchcase

from pipeline.errors import ConfigError
from stages.exemplars.model import Model, RawPart
from stages.exemplars.settings import KitConfig

MAX_NAMES_SHOWN = 8


def apply_label_map(models: Sequence[Model], config: KitConfig) -> list[tuple[RawPart, ...]]:
    """Return the parts of each model with the first label of `config.label_map` that has a fitting pattern.

    A part without a fitting pattern keeps its label. A pattern is matched with the part's name, its label and the name
    of its mesh. A pattern with a slash, `chair/leg*`, is limited to the model of that file or folder. Raises
    ConfigError for a pattern that fits no part of any model: it is misspelt.
    """
    used: set[tuple[str, str]] = set()
    named = [tuple(_labelled(part, _model_names(model), config, used) for part in model.parts) for model in models]
    for label, patterns in config.label_map.items():
        for pattern in patterns:
            if (label, pattern) not in used:
                raise ConfigError(_unused(models, config, label, pattern))
    return named


def _labelled(part: RawPart, model_names: Sequence[str], config: KitConfig, used: set[tuple[str, str]]) -> RawPart:
    """Return the part with the first label that fits; add all its fitting patterns to `used`."""
    words = [word for word in (part.name, part.label, part.mesh_name) if word]
    words += [f"{name}/{word}" for name in model_names for word in words]
    fitting = [
        (label, pattern)
        for label, patterns in config.label_map.items()
        for pattern in patterns
        if any(fnmatchcase(word, pattern) for word in words)
    ]
    used.update(fitting)
    return replace(part, label=fitting[0][0]) if fitting else part


def _model_names(model: Model) -> tuple[str, str]:
    """Return the names of a model in patterns with a slash."""
    return model.path.stem, model.path.resolve().parent.name


def _unused(models: Sequence[Model], config: KitConfig, label: str, pattern: str) -> str:
    names = [part.name for model in models for part in model.parts]
    shown = ", ".join(names[:MAX_NAMES_SHOWN]) + (
        f" and {len(names) - MAX_NAMES_SHOWN} more" if len(names) > MAX_NAMES_SHOWN else ""
    )
    return (
        f"kit {config.name}: label_map.{label}: no part of its models is called {pattern!r}; parts are called {shown}"
    )
