"""Read a trained model of any kind; its header names the kind."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stages.shape.kit import Kit
from stages.shapeassembly.settings import DEFAULT_TOP_P
from stages.training.checkpoint import CheckpointError, read_header

if TYPE_CHECKING:
    from stages.training.cuboid_rnn.trained import TrainedCuboidRnn
    from stages.training.edge_categories.trained import TrainedEdgeCategories
    from stages.training.part_graph_vae.trained import TrainedPartGraphVae
    from stages.training.point_encoder.trained import TrainedPointEncoder
    from stages.training.program_lm.trained import TrainedProgramLm
    from stages.training.program_vae.trained import TrainedProgramVae
    from stages.training.recovery.trained import TrainedRecovery
    from stages.training.string_vae.trained import TrainedStringVae

    ProgramSampler = TrainedProgramVae | TrainedProgramLm
    TrainedModel = (
        TrainedStringVae | TrainedEdgeCategories | ProgramSampler | TrainedCuboidRnn | TrainedPartGraphVae
        | TrainedPointEncoder | TrainedRecovery
    )  # fmt: skip

KINDS = (
    "string_vae", "edge_categories", "program_vae", "program_lm", "cuboid_rnn", "part_graph_vae", "point_encoder",
    "recovery"
)  # fmt: skip


def load_model(
    path: Path, expected: Mapping[str, Any] | None = None, *, kit: Kit | None = None, top_p: float = DEFAULT_TOP_P
) -> TrainedModel:
    """Read the model in a file of weights, on the CPU.

    path: a `weights.safetensors`, or the folder that holds it.
    expected: entries that the header must hold, such as `{"kit": "castle"}`.
    kit: the kit that a model of edge categories was trained on; only these need one.
    top_p: a language model samples numbers from the likeliest ones with this total probability.
    Raises CheckpointError for a file that is no model of a known kind, differs from `expected`, or lacks its kit.
    """
    weights = path / "weights.safetensors" if path.is_dir() else path
    kind = read_header(weights).get("kind")
    if kind not in KINDS:
        raise CheckpointError(f"{weights} is of kind {kind!r}; kinds are {', '.join(KINDS)}")
    load = getattr(import_module(f"stages.training.{kind}.trained"), f"load_{kind}")
    if kind == "edge_categories":
        if kit is None:
            raise CheckpointError(f"{weights} is a model of edge categories: pass the kit that it was trained on")
        model: TrainedModel = load(weights, kit)
    else:
        model = load(weights, expected, top_p) if kind == "program_lm" else load(weights, expected)
    return model


def load_program_sampler(path: Path, expected: Mapping[str, Any], top_p: float) -> ProgramSampler:
    """Read a model that samples ShapeAssembly programs, as `load_model`. Raises CheckpointError for another kind."""
    kind = read_header(path).get("kind")
    if kind not in ("program_vae", "program_lm"):
        raise CheckpointError(f"{path} is of kind {kind!r}; kinds that sample programs are program_vae, program_lm")
    model: ProgramSampler = load_model(path, expected, top_p=top_p)  # type: ignore[assignment]
    return model
