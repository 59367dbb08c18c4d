"""What a training decides by the machine that it runs on, and what it draws."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import nn

from stages.training.loop import TrainState, resolve_precision, train
from stages.training.program_lm.settings import ProgramLmConfig


@pytest.mark.parametrize("asked", ["float32", "bfloat16"])
def test_explicit_precision_is_kept(asked: str) -> None:
    assert resolve_precision(asked, torch.device("cpu")) == asked


def test_auto_precision_is_bfloat16_only_with_hardware_support() -> None:
    words = set(Path("/proc/cpuinfo").read_text(encoding="utf-8").split())
    knows = bool(words & {"avx512_bf16", "amx_bf16", "bf16"})
    assert resolve_precision("auto", torch.device("cpu")) == ("bfloat16" if knows else "float32")


@dataclass(frozen=True)
class _Halving:
    """A task that learns to halve numbers, with a module that draws its own dropout."""

    module: nn.Module
    config: ProgramLmConfig
    header: Mapping[str, Any] = field(default_factory=dict)

    @property
    def device(self) -> torch.device:
        return torch.device("cpu")

    def batches(self, rng: np.random.Generator) -> Iterator[torch.Tensor]:
        while True:
            yield torch.from_numpy(rng.random((8, 4), dtype=np.float32))

    def losses(self, batch: torch.Tensor, step: int, noise: torch.Generator) -> dict[str, torch.Tensor]:
        return {"loss": ((self.module(batch) - 0.5 * batch) ** 2).mean()}

    def validate(self, noise: torch.Generator) -> dict[str, float]:
        return {}


def _trained(before: int, seed: int) -> torch.Tensor:
    """The weights after a round, where the process has drawn numbers before."""
    torch.manual_seed(before)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        module = nn.Sequential(nn.Linear(4, 4), nn.Dropout(0.5))
    config = ProgramLmConfig(name="halving", kind="program_lm", steps=5, max_rounds=1)
    state = TrainState.of(_Halving(module, config))
    train(state, np.random.default_rng(seed), lambda done, total: None)
    return module[0].weight.detach()


def test_dropout_depends_on_the_seed_of_the_round_alone() -> None:
    assert torch.equal(_trained(before=1, seed=3), _trained(before=2, seed=3))
    assert not torch.equal(_trained(before=1, seed=3), _trained(before=1, seed=4))


class _Half(nn.Module):
    """Of two layers one is used."""

    def __init__(self) -> None:
        super().__init__()
        self.used, self.idle = nn.Linear(4, 4), nn.Linear(4, 4)

    def forward(self, numbers: torch.Tensor) -> torch.Tensor:
        found: torch.Tensor = self.used(numbers)
        return found


def _rounds(stops: bool) -> dict[str, torch.Tensor]:
    """What is kept after two rounds, which are taken up again after each where it `stops`."""
    config = ProgramLmConfig(name="halving", kind="program_lm", steps=5, max_rounds=2)

    def fresh() -> TrainState:
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(0)
            return TrainState.of(_Halving(_Half(), config))

    state = fresh()
    for number in range(2):
        train(state, np.random.default_rng(number), lambda done, total: None)
        if stops:
            tensors, step = {name: tensor.clone() for name, tensor in state.tensors().items()}, state.step
            state = fresh()
            state.restore(tensors, step)
    return state.tensors()


def test_training_with_an_unused_layer_resumes_identically() -> None:
    through, stopped = _rounds(stops=False), _rounds(stops=True)
    assert [name for name in through if ".idle." in name] == ["weights.idle.weight", "weights.idle.bias"]
    assert through.keys() == stopped.keys()
    assert all(torch.equal(item, stopped[name]) for name, item in through.items())
