"""What a network says of each parameter, and what it is told of the truth (geocode §3.3, Table 3).

A parameter that is classified has a logit a class. One that is regressed has its place among the classes, a number:
that of the first value is 0, and only the first of its outputs is looked at.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor
from torch.nn.functional import cross_entropy

from stages.programs.parameters import Parameter
from stages.training.recovery.settings import RecoveryModelConfig


def regressed(entry: RecoveryModelConfig, parameters: Sequence[Parameter]) -> list[bool]:
    """Which parameters are regressed: the continuous ones, if any."""
    return [entry.answers != "classes" and each.kind == "continuous" for each in parameters]


@dataclass(frozen=True)
class ParameterOutputs:
    """counts: int64 (parameters,), values of each, after which comes the class of what is hidden; regressed: bool
    (parameters,); existence: whether the class of what is hidden is learnt, too."""

    counts: Tensor
    regressed: Tensor
    existence: bool

    @classmethod
    def of(cls, entry: RecoveryModelConfig, parameters: Sequence[Parameter]) -> ParameterOutputs:
        counts = torch.tensor([len(each.values) for each in parameters])
        return cls(counts, torch.tensor(regressed(entry, parameters)), entry.existence)

    def to(self, device: torch.device) -> ParameterOutputs:
        """The same on a device."""
        return replace(self, counts=self.counts.to(device), regressed=self.regressed.to(device))

    def loss_in_nats(self, outputs: Tensor, classes: Tensor) -> Tensor:
        """The loss, summed over the parameters, mean over the inputs: cross-entropies, and of what is regressed half
        the squared distance in classes, the nats of a normal distribution as wide as a class. Outputs float (n,
        parameters, most classes); classes int64 (n, parameters)."""
        seen = classes < self.counts
        # what is not learnt is set to nothing, not left out: nobody waits until a GPU has counted what is left
        entropies = cross_entropy(outputs.flatten(0, 1), classes.flatten(), reduction="none").view(classes.shape)
        squares = 0.5 * (self.positions(outputs) - classes) ** 2
        nothing = torch.zeros((), device=classes.device)
        classified = torch.where(~self.regressed & (seen | self.existence), entropies, nothing)
        told = torch.where(self.regressed & seen, squares, nothing)
        return (classified.sum() + told.sum()) / len(classes)

    def positions(self, outputs: Tensor) -> Tensor:
        """Where each parameter lies among its classes, were it regressed, float (n, parameters)."""
        middle = (self.counts - 1) / 2.0
        return middle * (1.0 + outputs[..., 0].float())

    def probabilities(self, outputs: Tensor) -> Tensor:
        """The probability of each class, float (n, parameters, most classes); of what is regressed, of the two that it
        lies between."""
        places = self.positions(outputs).clamp(min=0.0)
        places = torch.minimum(places, (self.counts - 1).float())
        between = (1.0 - (torch.arange(outputs.shape[-1], device=outputs.device) - places[..., None]).abs()).clamp(
            min=0
        )
        numbers = self.regressed[:, None]
        return torch.where(numbers, between, torch.softmax(outputs.float(), dim=-1))
