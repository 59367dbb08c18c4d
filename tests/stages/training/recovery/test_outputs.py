"""What outputs of a network say of parameters, on stools and small numbers."""

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


def answers(**changes: object) -> ParameterOutputs:
    return ParameterOutputs.of(RecoveryModelConfig.model_validate({**SMALL, **changes}, strict=False), (LENGTH, LEGS))


def test_classes_are_cross_entropies_summed_over_the_parameters() -> None:
    outputs = torch.tensor([[[0.0, 0.0, 0.0], [0.0, 0.0, -torch.inf]]] * 2)
    told = answers()
    assert float(told.loss_in_nats(outputs, torch.tensor([[2, 0], [1, 1]]))) == pytest.approx(math.log(3) + math.log(2))
    assert told.probabilities(outputs)[0].sum(dim=-1).tolist() == pytest.approx([1.0, 1.0])


def test_what_is_regressed_is_a_place_among_the_classes() -> None:
    # 0.5 lies half of a half of the range above its middle, so a class and a half from the first
    outputs = torch.tensor([[[0.5, 9.0, 9.0], [0.0, 0.0, -torch.inf]]])
    told = answers(prediction="regression")
    assert told.positions(outputs)[0, 0] == 1.5
    assert told.probabilities(outputs)[0, 0].tolist() == [0.0, 0.5, 0.5]
    assert float(told.loss_in_nats(outputs, torch.tensor([[0, 0]]))) == pytest.approx(1.5**2 / 2 + math.log(2))
    beyond = torch.tensor([[[7.0, 0.0, 0.0], [0.0, 0.0, -torch.inf]]])
    assert told.probabilities(beyond)[0, 0].tolist() == [0.0, 0.0, 1.0]


def test_without_the_existence_label_nothing_is_learnt_of_what_is_hidden() -> None:
    outputs = torch.tensor([[[1.0, 2.0, 3.0], [0.0, 5.0, 1.0]]])
    hidden = torch.tensor([[1, 2]])
    both, one = answers().loss_in_nats(outputs, hidden), answers(learn_hidden=False).loss_in_nats(outputs, hidden)
    assert float(both - one) == pytest.approx(-float(torch.log_softmax(outputs[0, 1], dim=0)[2]))


def test_two_networks_share_no_weight_but_see_the_same_cloud() -> None:
    entry = RecoveryModelConfig.model_validate({**SMALL, "prediction": "separate_regression"}, strict=False)
    net = new_network(entry, STOOL, 0)
    told = ParameterOutputs.of(entry, STOOL.parameters)
    outputs = net(torch.rand(4, 64, 3))
    outputs[:, told.regressed, 0].sum().backward()
    assert net.other is not None
    assert all(each.grad is None or not each.grad.any() for each in net.encoder.parameters())
    assert any(each.grad is not None and each.grad.any() for each in net.other.parameters())


@pytest.mark.parametrize("prediction", ["classes", "regression"])
def test_a_guess_is_the_mean_of_what_is_likely(prediction: str) -> None:
    entry = RecoveryModelConfig.model_validate({**SMALL, "prediction": prediction}, strict=False)
    trained = TrainedRecovery(new_network(entry, STOOL, 0).eval(), STOOL, entry, {})
    guess = trained.estimate_from_cloud(np.random.default_rng(0).random((100, 3)), np.random.default_rng(0))
    values = guess.values(STOOL)
    continuous = [each for each in STOOL.parameters if each.kind == "continuous"]
    assert any(float(values[each.name]) not in [float(value) for value in each.values] for each in continuous)
    for each in continuous:
        chances = guess.probabilities[each.name]
        assert chances @ np.array(each.values, dtype=float) == pytest.approx(float(values[each.name]))
