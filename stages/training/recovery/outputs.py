"""The outputs of the network for each parameter, and their loss (geocode §3.3, Table 3).

A classified parameter has a logit for each class. A regressed one has a position among its classes: the first value is
at 0, and only the first output counts.
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
    return [entry.prediction != "classes" and parameter.kind == "continuous" for parameter in parameters]


@dataclass(frozen=True)
class ParameterOutputs:
    """How outputs are read.

    counts: int64 (parameters,), values of each; the class after them is the hidden one
    regressed: bool (parameters,)
    learn_hidden: whether the hidden class is learnt
    """

    counts: Tensor
    regressed: Tensor
    learn_hidden: bool

    @classmethod
    def of(cls, entry: RecoveryModelConfig, parameters: Sequence[Parameter]) -> ParameterOutputs:
        counts = torch.tensor([len(parameter.values) for parameter in parameters])
        return cls(counts, torch.tensor(regressed(entry, parameters)), entry.learn_hidden)

    def to(self, device: torch.device) -> ParameterOutputs:
        return replace(self, counts=self.counts.to(device), regressed=self.regressed.to(device))

    def loss_in_nats(self, outputs: Tensor, classes: Tensor) -> Tensor:
        """The loss, summed over the parameters, mean over the inputs.

        Cross-entropies, and for regressed parameters half the squared distance in classes: the nats of a normal
        distribution as wide as a class.

        outputs: float (n, parameters, most classes)
        classes: int64 (n, parameters)
        """
        visible = classes < self.counts
        # Masked, not left out: nobody waits until a GPU has counted what is left.
        entropies = cross_entropy(outputs.flatten(0, 1), classes.flatten(), reduction="none").view(classes.shape)
        squares = 0.5 * (self.positions(outputs) - classes) ** 2
        zero = torch.zeros((), device=classes.device)
        classified = torch.where(~self.regressed & (visible | self.learn_hidden), entropies, zero)
        distances = torch.where(self.regressed & visible, squares, zero)
        return (classified.sum() + distances.sum()) / len(classes)

    def positions(self, outputs: Tensor) -> Tensor:
        """The position of each parameter among its classes, were it regressed, float (n, parameters)."""
        middle = (self.counts - 1) / 2.0
        return middle * (1.0 + outputs[..., 0].float())

    def probabilities(self, outputs: Tensor) -> Tensor:
        """The probability of each class, float (n, parameters, most classes).

        That of a regressed parameter is shared by the two classes that its position is between.
        """
        positions = torch.minimum(self.positions(outputs).clamp(min=0.0), (self.counts - 1).float())
        indices = torch.arange(outputs.shape[-1], device=outputs.device)
        shared = (1.0 - (indices - positions[..., None]).abs()).clamp(min=0)
        return torch.where(self.regressed[:, None], shared, torch.softmax(outputs.float(), dim=-1))
