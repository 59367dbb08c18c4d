"""Trained models of ShapeAssembly programs or of their cuboids, and the programs they were trained on."""

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
"""The kinds that generate programs; the others generate cuboids."""


def program_models(run: DatasetRun, top_p: float) -> list[TrainedModel[Any]]:
    """Load all of them, by category. `top_p`: as in `shapeassembly.sampled`."""
    loaders: dict[str, Callable[[Path, Mapping[str, Any]], Any]] = {
        "program_vae": load_program_vae,
        "program_lm": partial(load_program_lm, top_p=top_p),
        "cuboid_rnn": load_cuboid_rnn,
        "part_graph_vae": load_part_graph_vae,
    }
    models = [trained for kind, load in loaders.items() for trained in trained_models(run.models, kind, load)]
    return sorted(models, key=lambda trained: trained.kit)


def ablation_of(trained: TrainedModel[Any]) -> str:
    """Return the part of the language that is ablated in a model, or `nothing`."""
    return str(trained.model.header["settings"].get("ablate", "nothing"))


def read_category_programs(run: DatasetRun, category: str, split: str) -> list[AssemblyProgram]:
    """Read the programs of a category in a split of the dataset."""
    samples = (sample for shard in program_shards(run, split) for sample in read_samples(shard))
    return [parse(sample.text) for sample in samples if sample.kit == category]


def program_shards(run: DatasetRun, split: str) -> list[Path]:
    """Return the files of all programs in a split of the dataset."""
    return sorted(run.paths.stage("shapeassembly").root.glob(f"{run.config.name}-{split}-*.tar"))


def commonly_readable_programs(
    run: DatasetRun, category: str, split: str, max_programs: int, rng: np.random.Generator
) -> list[AssemblyProgram]:
    """Return random programs of a category in a split that every kind of model with a latent space can encode."""
    programs = read_category_programs(run, category, split)
    kept: list[AssemblyProgram] = []
    for index in rng.permutation(len(programs)).tolist():
        try:
            assembly_lines(programs[index])
            graph_nodes(execute(programs[index]))
        except (Rejected, ProgramError):
            continue
        kept.append(programs[index])
        if len(kept) == max_programs:
            break
    return kept
