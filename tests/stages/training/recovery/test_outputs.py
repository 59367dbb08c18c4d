"""Outputs of the network as classes and numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from stages.programs.parameters import Parameter
from stages.programs.program import find_program
from stages.training.recovery.outputs import ParameterOutputs
from stages.training.recovery.settings import RecoveryModelConfig
from stages.training.recovery.trained import TrainedRecovery
from stages.training.recovery.training import new_network
from tests.stages.training.recovery.toy import PROGRAM, SMALL

STOOL = find_program(PROGRAM)
LENGTH = Parameter("length", "continuous", (0.0, 1.0, 2.0), 0.0, "all", "How long.")
LEGS = Parameter("legs", "discrete", (3, 4), 3, "all", "How many.")


def outputs_of(**changes: object) -> ParameterOutputs:
    return ParameterOutputs.of(RecoveryModelConfig.model_validate({**SMALL, **changes}, strict=False), (LENGTH, LEGS))


def test_loss_of_classes_is_the_sum_of_cross_entropies() -> None:
    outputs = torch.tensor([[[0.0, 0.0, 0.0], [0.0, 0.0, -torch.inf]]] * 2)
    reading = outputs_of()
    assert float(reading.loss_in_nats(outputs, torch.tensor([[2, 0], [1, 1]]))) == pytest.approx(
        math.log(3) + math.log(2)
    )
    assert reading.probabilities(outputs)[0].sum(dim=-1).tolist() == pytest.approx([1.0, 1.0])


def test_regressed_output_is_a_position_among_the_classes() -> None:
    # 0.5 lies half of a half of the range above its middle, so a class and a half from the first
    outputs = torch.tensor([[[0.5, 9.0, 9.0], [0.0, 0.0, -torch.inf]]])
    reading = outputs_of(prediction="regression")
    assert reading.positions(outputs)[0, 0] == 1.5
    assert reading.probabilities(outputs)[0, 0].tolist() == [0.0, 0.5, 0.5]
    assert float(reading.loss_in_nats(outputs, torch.tensor([[0, 0]]))) == pytest.approx(1.5**2 / 2 + math.log(2))
    beyond = torch.tensor([[[7.0, 0.0, 0.0], [0.0, 0.0, -torch.inf]]])
    assert reading.probabilities(beyond)[0, 0].tolist() == [0.0, 0.0, 1.0]


def test_hidden_class_is_not_learnt_without_learn_hidden() -> None:
    outputs = torch.tensor([[[1.0, 2.0, 3.0], [0.0, 5.0, 1.0]]])
    hidden = torch.tensor([[1, 2]])
    both, visible = (
        outputs_of().loss_in_nats(outputs, hidden),
        outputs_of(learn_hidden=False).loss_in_nats(outputs, hidden),
    )
    assert float(both - visible) == pytest.approx(-float(torch.log_softmax(outputs[0, 1], dim=0)[2]))


def test_separate_encoders_share_no_weights() -> None:
    entry = RecoveryModelConfig.model_validate({**SMALL, "prediction": "separate_regression"}, strict=False)
    net = new_network(entry, STOOL, 0)
    reading = ParameterOutputs.of(entry, STOOL.parameters)
    outputs = net(torch.rand(4, 64, 3))
    outputs[:, reading.regressed, 0].sum().backward()
    assert net.other is not None
    assert all(weight.grad is None or not weight.grad.any() for weight in net.encoder.parameters())
    assert any(weight.grad is not None and weight.grad.any() for weight in net.other.parameters())


@pytest.mark.parametrize("prediction", ["classes", "regression"])
def test_estimate_is_the_mean_of_the_probabilities(prediction: str) -> None:
    entry = RecoveryModelConfig.model_validate({**SMALL, "prediction": prediction}, strict=False)
    trained = TrainedRecovery(new_network(entry, STOOL, 0).eval(), STOOL, entry, {})
    estimate = trained.estimate_from_cloud(np.random.default_rng(0).random((100, 3)), np.random.default_rng(0))
    values = estimate.values(STOOL)
    continuous = [parameter for parameter in STOOL.parameters if parameter.kind == "continuous"]
    assert any(float(values[parameter.name]) not in map(float, parameter.values) for parameter in continuous)
    for parameter in continuous:
        probabilities = estimate.probabilities[parameter.name]
        assert probabilities @ np.array(parameter.values, dtype=float) == pytest.approx(float(values[parameter.name]))
