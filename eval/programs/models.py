"""Models of ShapeAssembly programs, or of their cuboids, and the programs that they have learnt from, as tables see
them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from eval.engine.dataset_run import DatasetRun
from eval.engine.models import TrainedModel, trained_models
from pipeline.errors import Rejected
from stages.shape.sample import read_samples
from stages.shapeassembly.execution.interpreter import execute
from stages.shapeassembly.syntax.errors import ProgramError
from stages.shapeassembly.syntax.parser import parse
from stages.shapeassembly.syntax.program import AssemblyProgram
from stages.training.cuboid_rnn.trained import load_cuboid_rnn
from stages.training.part_graph_vae.corpus import graph_nodes
from stages.training.part_graph_vae.trained import load_part_graph_vae
from stages.training.program_lm.trained import load_program_lm
from stages.training.program_vae.lines import assembly_lines
from stages.training.program_vae.trained import load_program_vae

PROGRAM_KINDS = ("program_vae", "program_lm")
"""The kinds that write whole programs; the others write cuboids."""


def program_models(subject: DatasetRun, top_p: float) -> list[TrainedModel[Any]]:
    """All of them, category by category. top_p: as in `shapeassembly.sampled`."""
    loaders: dict[str, Callable[[Path, Mapping[str, Any]], Any]] = {
        "program_vae": load_program_vae,
        "program_lm": partial(load_program_lm, top_p=top_p),
        "cuboid_rnn": load_cuboid_rnn,
        "part_graph_vae": load_part_graph_vae,
    }
    found = [each for kind, load in loaders.items() for each in trained_models(subject.models, kind, load)]
    return sorted(found, key=lambda each: each.kit)


def told_without(trained: TrainedModel[Any]) -> str:
    """The part of the language without which a model tells programs, or `nothing`."""
    return str(trained.model.header["settings"].get("ablate", "nothing"))


def category_programs(subject: DatasetRun, category: str, split: str) -> list[AssemblyProgram]:
    """The programs of a category in a split of the dataset."""
    shards = program_shards(subject, split)
    return [parse(each.text) for shard in shards for each in read_samples(shard) if each.kit == category]


def program_shards(subject: DatasetRun, split: str) -> list[Path]:
    """The files of all programs in a split of the dataset."""
    return sorted(subject.paths.stage("shapeassembly").root.glob(f"{subject.config.name}-{split}-*.tar"))


def read_by_all(
    subject: DatasetRun, category: str, split: str, most: int, rng: np.random.Generator
) -> list[AssemblyProgram]:
    """At most so many random programs of a category in a split, of those that every kind of model with a latent space
    can read."""
    programs = category_programs(subject, category, split)
    kept: list[AssemblyProgram] = []
    for place in rng.permutation(len(programs)).tolist():
        try:
            assembly_lines(programs[place])
            graph_nodes(execute(programs[place]))
        except (Rejected, ProgramError):
            continue
        kept.append(programs[place])
        if len(kept) == most:
            break
    return kept
