"""The small datasets that chaos is let loose on: one of exemplars, one of a program, one of ShapeAssembly programs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pipeline.check import damaged_shards
from pipeline.config import load_config
from pipeline.places import Places
from pipeline.registry import find_stages
from tests.chaos.arena import Arena
from tests.stated import stated

__all__ = ["ARENAS", "arena_in", "damaged"]

_KIT = {
    "name": "castle",
    "shapes": ["datasets/exemplars/castle/keep.glb", "datasets/exemplars/castle/ward.glb"],
}

_AFTER = ("validity", "abstraction", "strings", "points", "sketches", "package")

_SMALL: dict[str, dict[str, Any]] = {
    "points": {"uniform": 128, "farthest": 64},
    "sketches": {"size": 48, "views": [{"name": "front"}]},
    "package": {"previewed": 2},
}

ARENAS: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {
    "kits": (
        ("exemplars", "variations", *_AFTER),
        {
            "exemplars": {"kits": [stated(_KIT)]},
            "variations": {"per_kit": 24, "splits": {"shards": 2}},
            "abstraction": {"programs": True},
            **_SMALL,
        },
    ),
    "vases": (
        ("programs", *_AFTER),
        {
            "programs": {
                "program": "vase",
                "mode": "sweep",
                "sweep": {"samples": 12, "val": 0.2, "test": 0.2},
                "splits": {"shards": 2},
            },
            **_SMALL,
        },
    ),
    "furniture": (
        ("shapeassembly", *_AFTER),
        {"shapeassembly": {"programs": [{"name": "furniture", "path": "datasets/exemplars/programs"}]}, **_SMALL},
    ),
    "texts": (
        ("shapeassembly", "validity"),
        {"shapeassembly": {"programs": [{"name": "furniture", "path": "datasets/exemplars/programs"}]}},
    ),
}
"""Stages and config of each. `texts` is for the tests: stages that are quick to start."""


def arena_in(folder: Path, name: str) -> Arena:
    """The dataset `name` made undisturbed in `folder`, without the stages that have nothing to do for it."""
    stages, sections = ARENAS[name]
    arena = Arena(folder, name, stages, sections)
    arena.settle()
    arena.stages = [stage for stage in stages if arena.shards(stage)]
    return arena


def damaged(arena: Arena) -> list[str]:
    """What the mill's part of `make verify` finds; it withdraws the records of what is damaged."""
    stages = find_stages()
    config = load_config(arena.config, {name: stage.config for name, stage in stages.items()})
    return list(damaged_shards(config, stages, Places(arena.out, config.name)))
