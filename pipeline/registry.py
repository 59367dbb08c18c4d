"""Discovery of stages: every folder of a package that holds a `stage.py`, ordered by their inputs."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import replace
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

from pipeline.stage import Stage


def find_stages(package: str = "stages") -> dict[str, Stage]:
    """Return the `STAGE` of each `<package>/<name>/stage.py`, earlier stages first.

    An input `*/producer.py` means every other stage whose folder holds such a file. Raises TypeError for a `stage.py`
    without a STAGE of its folder's name, for circular inputs and for inputs that do not exist.
    """
    stages: dict[str, Stage] = {}
    for folder in folders_with(package, "stage.py"):
        stage = getattr(importlib.import_module(f"{package}.{folder}.stage"), "STAGE", None)
        if not isinstance(stage, Stage) or (stage.name, stage.module) != (folder, f"{package}.{folder}.stage"):
            raise TypeError(f"{package}/{folder}/stage.py must hold STAGE = Stage({folder!r}, __name__, ...)")
        stages[folder] = stage
    stages = {name: replace(stage, inputs=_named(package, stages, stage)) for name, stage in stages.items()}
    for stage in stages.values():
        for name in stage.inputs:
            if name not in stages:
                raise TypeError(f"stage {stage.name} reads stage {name}, which does not exist")
    try:
        order = TopologicalSorter({name: stage.inputs for name, stage in stages.items()}).static_order()
        return {name: stages[name] for name in order}
    except CycleError as error:
        raise TypeError(f"stages read each other in a circle: {' -> '.join(error.args[1])}") from error


def folders_with(package: str, file: str) -> list[str]:
    """The folders of a package that hold `file`, by name; the package may lie in several paths."""
    bases = [Path(base) for base in importlib.import_module(package).__path__]
    return sorted({path.parent.name for base in bases for path in base.glob(f"*/{file}") if path.is_file()})


def _named(package: str, stages: Mapping[str, Stage], stage: Stage) -> tuple[str, ...]:
    """Return the inputs of a stage by name, without duplicates."""
    names: list[str] = []
    for wanted in stage.inputs:
        if wanted.startswith("*/"):
            names += [name for name in folders_with(package, wanted[2:]) if name in stages and name != stage.name]
        else:
            names.append(wanted)
    return tuple(dict.fromkeys(names))


def upstream(stages: Mapping[str, Stage], name: str) -> list[str]:
    """Return stage `name` and all stages that it reads, directly or not, in the order of `stages`."""
    reached, waiting = {name}, [name]
    while waiting:
        fresh = set(stages[waiting.pop()].inputs) - reached
        reached |= fresh
        waiting += fresh
    return [stage for stage in stages if stage in reached]
