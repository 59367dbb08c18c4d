"""A trained recovery model, read from its published weights alone."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from stages.programs.program import Program, find_program
from stages.shape.arrays import BoolArray, FloatArray
from stages.sketches.settings import SketchesConfig
from stages.training.checkpoint import CheckpointError, load_checkpoint
from stages.training.recovery.clouds import frame_of, subsample
from stages.training.recovery.estimate import ParameterEstimate, estimate_from_probabilities
from stages.training.recovery.model import RecoveryNet
from stages.training.recovery.outputs import ParameterOutputs
from stages.training.recovery.settings import RecoveryModelConfig
from stages.training.recovery.training import parameter_descriptions

RECOVERY_KIND = "recovery"
"""What weights say of their kind."""

STEP = ".step"
"""Behind the name of a tensor of bytes: that of the sizes of their steps."""
LOOKS = 4
"""A cloud is looked at so often, each time at other points of it."""


@dataclass(frozen=True)
class TrainedRecovery:
    """header: what the weights say of themselves."""

    module: RecoveryNet
    program: Program
    entry: RecoveryModelConfig
    header: Mapping[str, Any]

    @property
    def typical_distance(self) -> float:
        """How far validation shapes come back at most, all but one in twenty: mean squared distance both ways, in
        sides of their boxes."""
        return float(self.header["figures"]["val_chamfer_high"])

    @property
    def sketches(self) -> SketchesConfig:
        """How the drawings that it has learnt from were drawn."""
        return SketchesConfig.model_validate_json(json.dumps(self.header["sketches"]))

    def estimate_from_cloud(self, points: FloatArray, rng: np.random.Generator) -> ParameterEstimate:
        """Of a cloud (n, 3) of any number of points, y up, anywhere and of any size."""
        looks = [subsample(points, self.entry.points, rng) for _ in range(LOOKS)]
        return self._guess(torch.from_numpy(np.array([frame_of(each).normalized(each) for each in looks])).float())

    def estimate_from_drawing(self, ink: BoolArray) -> ParameterEstimate:
        """Of fitted ink (SIDE, SIDE)."""
        return self._guess(torch.from_numpy(ink[None, None].astype(np.float32)))

    @torch.no_grad()
    def _guess(self, inputs: Tensor) -> ParameterEstimate:
        device = next(self.module.parameters()).device
        outputs, answers = (
            self.module(inputs.to(device)),
            ParameterOutputs.of(self.entry, self.program.parameters).to(device),
        )
        chances = answers.probabilities(outputs).mean(dim=0).double().cpu().numpy()
        return estimate_from_probabilities(self.program, chances)


def load_recovery(path: Path, expected: Mapping[str, Any] | None = None) -> TrainedRecovery:
    """The model in a file of weights, on the CPU.

    Raises CheckpointError for whatever is not one, says something else of itself than `expected`, such as
    `{"program": "chair"}`, or was trained when the program had other parameters.
    """
    tensors, header = load_checkpoint(path, {"kind": RECOVERY_KIND, **(expected or {})})
    program = find_program(header["program"])
    if header["parameters"] != parameter_descriptions(program):
        raise CheckpointError(f"{path} is of a {program.name} with other parameters than it has now: train it anew")
    # what a network is has not changed where keys of its training have gone
    settings = {key: value for key, value in header["settings"].items() if key in RecoveryModelConfig.model_fields}
    entry = RecoveryModelConfig.model_validate({"name": "trained", **settings})
    module = RecoveryNet(entry, program.parameters)
    module.load_state_dict(_in_floats(tensors))
    return TrainedRecovery(module.eval(), program, entry, header)


def quantized_to_bytes(name: str, tensor: Tensor) -> dict[str, Tensor]:
    """A tensor of weights, float (..., before, after), as int8 with the size of a step for each column."""
    step = (tensor.float().abs().amax(dim=-2, keepdim=True) / 127.0).clamp(min=1e-12)
    return {name: (tensor.float() / step).round().to(torch.int8), f"{name}{STEP}": step}


def _in_floats(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The state of a module from tensors of any precision."""
    found = {}
    for name, each in tensors.items():
        if f"{name}{STEP}" in tensors:
            found[name] = each.float() * tensors[f"{name}{STEP}"]
        elif not name.endswith(STEP):
            found[name] = each.float() if each.is_floating_point() else each
    return found
