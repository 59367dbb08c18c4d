"""Rounds of a training, and what it decides by the machine that it runs on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from stages.training.entry import ModelEntry
from stages.training.loop import Trainee, precision_of, train


@pytest.mark.parametrize("asked", ["float32", "bfloat16"])
def test_numbers_that_are_asked_for_by_name_are_taken(asked: str) -> None:
    assert precision_of(asked, torch.device("cpu")) == asked


def test_half_precision_is_chosen_only_where_the_processor_reckons_with_it() -> None:
    words = set(Path("/proc/cpuinfo").read_text().split())
    knows = bool(words & {"avx512_bf16", "amx_bf16", "bf16"})
    assert precision_of("auto", torch.device("cpu")) == ("bfloat16" if knows else "float32")


class Half(torch.nn.Module):
    """Of two layers one is used."""

    def __init__(self) -> None:
        super().__init__()
        self.used, self.idle = torch.nn.Linear(2, 1), torch.nn.Linear(2, 1)


@dataclass
class Learning:
    """Makes what the one layer says small."""

    module: Half
    header: Mapping[str, Any] = field(default_factory=dict)

    def batches(self, rng: np.random.Generator) -> Iterator[torch.Tensor]:
        while True:
            yield torch.from_numpy(rng.random((4, 2))).float()

    def losses(self, batch: torch.Tensor, step: int, noise: torch.Generator) -> dict[str, torch.Tensor]:
        return {"loss": (self.module.used(batch) ** 2).mean()}

    def validate(self, noise: torch.Generator) -> dict[str, float]:
        return {"loss": 0.0}


def test_a_training_with_a_layer_that_nothing_uses_goes_on_as_if_it_had_not_stopped() -> None:
    entry = ModelEntry(name="half", steps=5, rounds=2, device="cpu")

    def trained(stops: bool) -> dict[str, torch.Tensor]:
        torch.manual_seed(0)
        trainee = Trainee.of(Learning(Half()), entry)
        for number in range(2):
            train(trainee, entry, np.random.default_rng(number), lambda done, of: None)
            if stops:
                tensors, step = {name: each.clone() for name, each in trainee.tensors().items()}, trainee.step
                trainee = Trainee.of(Learning(Half()), entry)
                trainee.restore(tensors, step)
        return trainee.tensors()

    through, stopped = trained(False), trained(True)
    assert {name.partition(".")[0] for name in through if ".idle." in f".{name}."} == {"weights"}
    assert through.keys() == stopped.keys()
    assert all(torch.equal(each, stopped[name]) for name, each in through.items())
