"""Finds the stages: every folder of a package that holds a `stage.py`, in the order in which they read each other."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

from pipeline.stage import Stage

__all__ = ["find_stages", "upstream"]


def find_stages(package: str = "stages") -> dict[str, Stage]:
    """The `STAGE` of each `<package>/<name>/stage.py`, earlier stages first.

    Raises TypeError for a `stage.py` without a STAGE of its folder's name and for stages that read each other in a
    circle or read a stage that is not there.
    """
    found: dict[str, Stage] = {}
    root = importlib.import_module(package)
    for folder in sorted(each.name for each in pkgutil.iter_modules(root.__path__) if each.ispkg):
        if not any((Path(base) / folder / "stage.py").is_file() for base in root.__path__):
            continue
        stage = getattr(importlib.import_module(f"{package}.{folder}.stage"), "STAGE", None)
        if not isinstance(stage, Stage) or (stage.name, stage.module) != (folder, f"{package}.{folder}.stage"):
            raise TypeError(f"{package}/{folder}/stage.py must hold STAGE = Stage({folder!r}, __name__, ...)")
        found[folder] = stage
    for stage in found.values():
        for name in stage.inputs:
            if name not in found:
                raise TypeError(f"stage {stage.name} reads stage {name}, which is not there")
    try:
        order = TopologicalSorter({name: stage.inputs for name, stage in found.items()}).static_order()
        return {name: found[name] for name in order}
    except CycleError as error:
        raise TypeError(f"stages read each other in a circle: {' -> '.join(error.args[1])}") from error


def upstream(stages: Mapping[str, Stage], name: str) -> list[str]:
    """The stages that `name` can read, its own among them, in the order of `stages`."""
    reached, fresh = {name}, [name]
    while fresh:
        for each in stages[fresh.pop()].inputs:
            if each not in reached:
                reached.add(each)
                fresh.append(each)
    return [each for each in stages if each in reached]
