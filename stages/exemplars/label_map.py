"""What parts mean by a config's word: names for parts whose models have none, or useless ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fnmatch import fnmatchcase

from pipeline.errors import ConfigError
from stages.exemplars.model import Model, RawPart
from stages.exemplars.settings import KitConfig

NAMED = 8
"""So many names of parts are shown to somebody whose pattern fits none."""


def apply_label_map(models: Sequence[Model], config: KitConfig) -> list[tuple[RawPart, ...]]:
    """The parts of each model, their labels replaced by what `config.meanings` calls them: the first meaning of which
    a pattern fits. A part that none fits keeps the label that it has.

    A pattern is held against the part's name, its label and the name of its mesh; one with a stroke, `chair/leg*`,
    against those in one model, which is called by its file or its folder. Raises ConfigError for a pattern that fits
    no part of any model: it is misspelt.
    """
    used: set[tuple[str, str]] = set()
    named = [tuple(_called(part, _places(model), config, used) for part in model.parts) for model in models]
    for meaning, patterns in config.label_map.items():
        for pattern in patterns:
            if (meaning, pattern) not in used:
                raise ConfigError(_unused(models, config, meaning, pattern))
    return named


def _called(part: RawPart, places: Sequence[str], config: KitConfig, used: set[tuple[str, str]]) -> RawPart:
    """The part with the label that its first fitting meaning gives it; all patterns that fit it go to `used`."""
    words = [each for each in (part.name, part.label, part.mesh_name) if each]
    words += [f"{place}/{word}" for place in places for word in words]
    fitting = [
        (meaning, pattern)
        for meaning, patterns in config.label_map.items()
        for pattern in patterns
        if any(fnmatchcase(word, pattern) for word in words)
    ]
    used.update(fitting)
    return replace(part, label=fitting[0][0]) if fitting else part


def _places(model: Model) -> tuple[str, str]:
    """What a model may be called before a stroke."""
    return model.path.stem, model.path.resolve().parent.name


def _unused(models: Sequence[Model], config: KitConfig, meaning: str, pattern: str) -> str:
    names = [part.name for model in models for part in model.parts]
    shown = ", ".join(names[:NAMED]) + (f" and {len(names) - NAMED} more" if len(names) > NAMED else "")
    return (
        f"kit {config.name}: label_map.{meaning}: no part of its models is called {pattern!r}; parts are called {shown}"
    )
