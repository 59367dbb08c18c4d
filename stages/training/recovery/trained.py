"""A trained recovery model, read from its published weights alone; and the best ones in folders of models."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from pipeline.errors import ConfigError
from stages.programs.program import Program, find_program
from stages.shape.arrays import BoolArray, FloatArray
from stages.sketches.settings import SketchesConfig
from stages.training.checkpoint import CheckpointError, load_checkpoint, weights_of_kind
from stages.training.recovery.clouds import frame_of, subsample
from stages.training.recovery.estimate import ParameterEstimate, estimate_from_probabilities
from stages.training.recovery.model import RecoveryNet
from stages.training.recovery.outputs import ParameterOutputs
from stages.training.recovery.settings import RecoveryModelConfig
from stages.training.recovery.training import parameter_descriptions

RECOVERY_KIND = "recovery"
"""The kind in the header of the weights."""
PRETRAINED_FOLDER = Path(__file__).parents[3] / "datasets/exemplars/models"
"""Models that come with Shapemill; `ship.py` puts them there."""
STEP_SUFFIX = ".step"
"""A tensor stored as bytes has its step sizes in a tensor with this suffix."""
CLOUD_SUBSAMPLES = 4
"""An estimate is the mean over these subsamples of a cloud."""


@dataclass(frozen=True)
class TrainedRecovery:
    """A network with its program; header: of its weights."""

    module: RecoveryNet
    program: Program
    entry: RecoveryModelConfig
    header: Mapping[str, Any]

    @property
    def typical_distance(self) -> float:
        """The 95th percentile of the squared Chamfer distances of validation shapes, in sides of their boxes."""
        return float(self.header["figures"]["val_chamfer_p95"])

    @property
    def sketches(self) -> SketchesConfig:
        """The config of the drawings that it was trained on."""
        return SketchesConfig.model_validate_json(json.dumps(self.header["sketches"]))

    def estimate_from_cloud(self, points: FloatArray, rng: np.random.Generator) -> ParameterEstimate:
        """Estimate from a cloud (n, 3) with y up, of any position, size and number of points."""
        clouds = [subsample(points, self.entry.points, rng) for _ in range(CLOUD_SUBSAMPLES)]
        normalized = np.array([frame_of(cloud).normalized(cloud) for cloud in clouds])
        return self._estimate(torch.from_numpy(normalized).float())

    def estimate_from_drawing(self, ink: BoolArray) -> ParameterEstimate:
        """Estimate from fitted ink (side, side)."""
        return self._estimate(torch.from_numpy(ink[None, None].astype(np.float32)))

    @torch.no_grad()
    def _estimate(self, inputs: Tensor) -> ParameterEstimate:
        device = next(self.module.parameters()).device
        outputs = ParameterOutputs.of(self.entry, self.program.parameters).to(device)
        probabilities = outputs.probabilities(self.module(inputs.to(device)))
        return estimate_from_probabilities(self.program, probabilities.mean(dim=0).double().cpu().numpy())


RecoveryModels = Mapping[tuple[str, str], TrainedRecovery]
"""Trained models by program and kind of input, `points` or `sketch`."""


def load_recovery(path: Path, expected: Mapping[str, Any] | None = None) -> TrainedRecovery:
    """Load the model in a file of weights, on the CPU.

    Raises CheckpointError for a file that is no recovery model, differs from `expected`, such as
    `{"program": "chair"}`, or was trained when the program had other parameters.
    """
    tensors, header = load_checkpoint(path, {"kind": RECOVERY_KIND, **(expected or {})})
    program = find_program(header["program"])
    if header["parameters"] != parameter_descriptions(program):
        raise CheckpointError(f"{path} was trained when {program.name} had other parameters: train it again")
    # removed keys of the training do not change the network
    settings = {key: value for key, value in header["settings"].items() if key in RecoveryModelConfig.model_fields}
    entry = RecoveryModelConfig.model_validate({"name": "trained", **settings})
    module = RecoveryNet(entry, program.parameters)
    module.load_state_dict(_dequantized(tensors))
    return TrainedRecovery(module.eval(), program, entry, header)


def find_models(*folders: Path) -> tuple[dict[tuple[str, str], TrainedRecovery], list[str]]:
    """Find recovery models in folders of published models, or of datasets; and say what is wrong with others.

    For each program and kind of input, the first folder that has a model gives the one with the best validation loss,
    baselines excepted. With PRETRAINED_FOLDER last, Shapemill's models serve where a user has trained none.
    """
    models: dict[tuple[str, str], TrainedRecovery] = {}
    problems: list[str] = []
    for folder in folders:
        models = {**_models_in(folder, problems), **models}
    return models, problems


def _models_in(folder: Path, problems: list[str]) -> dict[tuple[str, str], TrainedRecovery]:
    """The best models in one folder; adds to `problems`."""
    models: dict[tuple[str, str], TrainedRecovery] = {}
    losses: dict[tuple[str, str], float] = {}
    folders = (folder, *sorted(folder.glob("*-models")))
    for path in chain.from_iterable(weights_of_kind(searched, RECOVERY_KIND) for searched in folders):
        try:
            model = load_recovery(path)
            if model.entry.is_baseline:
                continue
            key, loss = (model.header["program"], model.entry.input), float(model.header["figures"]["val_loss"])
        except CheckpointError as error:
            problems.append(str(error))
        except (ConfigError, ImportError, LookupError, TypeError, ValueError, RuntimeError) as error:
            problems.append(f"{path} cannot be used: {type(error).__name__}: {error}")
        else:
            if key not in models or loss < losses[key]:
                models[key], losses[key] = model, loss
    return models


def quantized_to_bytes(name: str, tensor: Tensor) -> dict[str, Tensor]:
    """Quantize weights, float (..., before, after), to int8 with a step size for each column."""
    step = (tensor.float().abs().amax(dim=-2, keepdim=True) / 127.0).clamp(min=1e-12)
    return {name: (tensor.float() / step).round().to(torch.int8), f"{name}{STEP_SUFFIX}": step}


def _dequantized(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The state of a module from tensors of any precision."""
    state = {}
    for name, tensor in tensors.items():
        if f"{name}{STEP_SUFFIX}" in tensors:
            state[name] = tensor.float() * tensors[f"{name}{STEP_SUFFIX}"]
        elif not name.endswith(STEP_SUFFIX):
            state[name] = tensor.float() if tensor.is_floating_point() else tensor
    return state
