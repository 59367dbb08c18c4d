"""Finds the stages: every folder of a package that holds a `stage.py`, in the order in which they read each other."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import replace
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

from pipeline.stage import Stage


def find_stages(package: str = "stages") -> dict[str, Stage]:
    """The `STAGE` of each `<package>/<name>/stage.py`, earlier stages first.

    An input such as `*/producer.py` stands for every stage, other than the one that names it, whose folder holds such
    a file. Raises TypeError for a `stage.py` without a STAGE of its folder's name and for stages that read each other
    in a circle or read a stage that is not there.
    """
    found: dict[str, Stage] = {}
    for folder in folders_with(package, "stage.py"):
        stage = getattr(importlib.import_module(f"{package}.{folder}.stage"), "STAGE", None)
        if not isinstance(stage, Stage) or (stage.name, stage.module) != (folder, f"{package}.{folder}.stage"):
            raise TypeError(f"{package}/{folder}/stage.py must hold STAGE = Stage({folder!r}, __name__, ...)")
        found[folder] = stage
    found = {name: replace(stage, inputs=_named(package, found, stage)) for name, stage in found.items()}
    for stage in found.values():
        for name in stage.inputs:
            if name not in found:
                raise TypeError(f"stage {stage.name} reads stage {name}, which is not there")
    try:
        order = TopologicalSorter({name: stage.inputs for name, stage in found.items()}).static_order()
        return {name: found[name] for name in order}
    except CycleError as error:
        raise TypeError(f"stages read each other in a circle: {' -> '.join(error.args[1])}") from error


def folders_with(package: str, file: str) -> list[str]:
    """The folders of a package that hold `file`, by name; the package may lie in several places."""
    bases = [Path(base) for base in importlib.import_module(package).__path__]
    folders = {each.name for base in bases if base.is_dir() for each in base.iterdir() if (each / file).is_file()}
    return sorted(folders)


def _named(package: str, found: Mapping[str, Stage], stage: Stage) -> tuple[str, ...]:
    """The inputs of a stage, all by name, each once."""
    names: dict[str, None] = {}
    for each in stage.inputs:
        meant = [each]
        if each.startswith("*/"):
            meant = [name for name in folders_with(package, each[2:]) if name in found and name != stage.name]
        names.update(dict.fromkeys(meant))
    return tuple(names)


def upstream(stages: Mapping[str, Stage], name: str) -> list[str]:
    """The stages that `name` can read, its own among them, in the order of `stages`."""
    reached, fresh = {name}, [name]
    while fresh:
        for each in stages[fresh.pop()].inputs:
            if each not in reached:
                reached.add(each)
                fresh.append(each)
    return [each for each in stages if each in reached]
