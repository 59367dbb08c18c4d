"""The small datasets of chaos tests; together they use every stage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.config import load_config
from pipeline.integrity import corrupted_shards
from pipeline.paths import DatasetPaths
from pipeline.registry import find_stages
from tests.chaos.sandbox import Sandbox, Step
from tests.stated import stated


@dataclass(frozen=True)
class Datasets:
    """The datasets of a sandbox.

    made: stages and config sections of each dataset, in order
    edited: edits of the configs
    tests: whether it is only for the tests
    """

    made: Mapping[str, tuple[Sequence[str], Mapping[str, Any]]]
    edited: Sequence[Mapping[str, Mapping[str, Any]]]
    tests: bool = False


_CASTLE = {
    "name": "castle",
    "shapes": ["datasets/exemplars/castle/keep.glb", "datasets/exemplars/castle/ward.glb"],
}
_OPEN = {key: value for key, value in stated(_CASTLE).items() if key not in ("grammar", "up")}
"""Stage `autoconfig` is left two keys."""

_SAMPLES = ("validity", "points", "sketches", "package")

_SMALL: dict[str, dict[str, Any]] = {
    "points": {"uniform": 128, "farthest": 64},
    "sketches": {"size": 48, "views": [{"name": "front"}]},
    "package": {"previewed": 2},
}
_PROGRAMS = {"programs": [{"name": "furniture", "path": "datasets/exemplars/programs"}], "splits": {"shards": 2}}
_TINY = {"batch_size": 4, "steps": 3, "max_rounds": 2, "hidden": 16, "latent": 8}


def _edits(dataset: str) -> list[dict[str, dict[str, Any]]]:
    changed = [{"points": {"uniform": 100}}, {"sketches": {"size": 40}}, {"package": {"previewed": 1}}]
    return [{dataset: item} for item in changed]


SANDBOXES: dict[str, Datasets] = {
    "kits": Datasets(
        {
            "castles": (
                ("autoconfig", "exemplars", "variations", "abstraction", "strings", *_SAMPLES),
                {
                    "autoconfig": {"max_tries": 100},
                    "exemplars": {"kits": [_OPEN]},
                    "variations": {"samples_per_kit": 12, "splits": {"shards": 2}},
                    "abstraction": {"programs": True},
                    **_SMALL,
                },
            )
        },
        _edits("castles"),
    ),
    "vases": Datasets(
        {
            "vases": (
                ("programs", *_SAMPLES),
                {
                    "programs": {
                        "program": "vase",
                        "mode": "random",
                        "random": {"samples": 12, "val": 0.2, "test": 0.2},
                        "splits": {"shards": 2},
                    },
                    **_SMALL,
                },
            )
        },
        _edits("vases"),
    ),
    "furniture": Datasets(
        {"furniture": (("shapeassembly", *_SAMPLES), {"shapeassembly": _PROGRAMS, **_SMALL})}, _edits("furniture")
    ),
    "sampled": Datasets(
        {
            "parent": (
                ("exemplars", "variations", "strings", "training"),
                {
                    "exemplars": {"kits": [stated(_CASTLE)]},
                    "variations": {"samples_per_kit": 12, "splits": {"shards": 1}},
                    "training": {"models": [{"name": "tiny", "kind": "string_vae", "embedding": 4, **_TINY}]},
                },
            ),
            "sampled": (
                ("exemplars", "string_sampling", "validity"),
                {
                    "exemplars": {"kits": [stated(_CASTLE)]},
                    "variations": {"samples_per_kit": 0},
                    "string_sampling": {
                        "sources": [{"dataset": "parent", "model": "tiny", "kit": "castle", "samples": 4}],
                        "draws": 8,
                        "parallel_searches": 2,
                        "max_rounds": 3,
                        "splits": {"shards": 1},
                    },
                },
            ),
        },
        [{"sampled": {"string_sampling": {"draws": 7}}}],
    ),
    "scribes": Datasets(
        {
            "read": (
                ("shapeassembly", "training"),
                {
                    "shapeassembly": _PROGRAMS,
                    "training": {"models": [{"name": "tiny", "kind": "program_vae", **_TINY}]},
                },
            ),
            "programs": (
                ("program_sampling", "shapeassembly", "validity"),
                {
                    "program_sampling": {"programs_per_shard": 4},
                    "shapeassembly": {
                        "sampled": [
                            {"name": "stool", "dataset": "read", "model": "tiny", "kit": "furniture", "samples": 12}
                        ],
                        "max_overflow": 100,
                        "splits": {"shards": 1},
                    },
                },
            ),
        },
        [{"programs": {"program_sampling": {"programs_per_shard": 5}}}],
    ),
    "texts": Datasets(
        {"texts": (("shapeassembly", "validity"), {"shapeassembly": _PROGRAMS})},
        [{"texts": {"shapeassembly": {"min_parts": 8}}}],
        tests=True,
    ),
}


def sandbox_in(folder: Path, name: str) -> Sandbox:
    """The datasets of a sandbox made undisturbed in `folder`. Raises AssertionError where a stage has nothing to do."""
    wanted = SANDBOXES[name]
    steps: list[Step] = [(dataset, stage) for dataset, (stages, _) in wanted.made.items() for stage in stages]
    sandbox = Sandbox(folder, name, steps, {dataset: sections for dataset, (_, sections) in wanted.made.items()})
    sandbox.edited = wanted.edited
    sandbox.settle()
    idle = [step for step in steps if not sandbox.shards(step)]
    assert not idle, f"{name}: nothing to do for {idle}"
    return sandbox


def damaged(sandbox: Sandbox) -> list[str]:
    """Return the corrupted shards; removes their records."""
    stages = find_stages()
    found = []
    for dataset in sandbox.sections:
        config = load_config(sandbox.config(dataset), {name: stage.config for name, stage in stages.items()})
        found += list(corrupted_shards(config, stages, DatasetPaths(sandbox.out, config.name)))
    return found
