"""Discover what stages declare: producers, languages, members, audits."""

from __future__ import annotations

import importlib
from functools import cache
from typing import TypeVar

import stages
from pipeline.errors import ConfigError
from pipeline.registry import folders_with
from stages.shape.collection.audit import Audit
from stages.shape.collection.language import Language
from stages.shape.collection.members import Members
from stages.shape.collection.producer import Producer

Discovered = TypeVar("Discovered")


def producers() -> dict[str, Producer]:
    """Return the producers by stage."""
    return _discovered("producer", Producer)


def languages() -> dict[str, Language]:
    """Return the languages by name."""
    return {language.name: language for language in _discovered("language", Language).values()}


def members() -> dict[str, Members]:
    """Return what is added to every sample, by the stage that adds it."""
    return _discovered("members", Members)


def member_modules() -> tuple[str, ...]:
    """Return the modules that declare members. A stage that reads them at run time names them as its code."""
    return tuple(f"{stages.__name__}.{folder}.members" for folder in members())


def audits() -> dict[str, Audit]:
    """Return the audits of finished samples, by stage."""
    return _discovered("audit", Audit)


def language_of(producer: str) -> Language:
    """Return the language of the samples of a producer. Raises ConfigError for one that no stage declares."""
    known, name = languages(), producers()[producer].language
    if name not in known:
        raise ConfigError(f"producer {producer} makes samples in the language {name!r}; there are {', '.join(known)}")
    return known[name]


@cache
def _discovered(what: str, kind: type[Discovered]) -> dict[str, Discovered]:
    """Return the `WHAT` of each `stages/<folder>/<what>.py`, by folder. Raises TypeError for a file without it."""
    discovered: dict[str, Discovered] = {}
    for folder in folders_with(stages.__name__, f"{what}.py"):
        declared = getattr(importlib.import_module(f"{stages.__name__}.{folder}.{what}"), what.upper(), None)
        if not isinstance(declared, kind):
            raise TypeError(f"stages/{folder}/{what}.py must hold {what.upper()} = {kind.__name__}(...)")
        discovered[folder] = declared
    return discovered
