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

from stages.training.loop import Trainee, precision_of, train
from stages.training.program_lm.settings import ProgramLmEntry


@pytest.mark.parametrize("asked", ["float32", "bfloat16"])
def test_numbers_that_are_asked_for_by_name_are_taken(asked: str) -> None:
    assert precision_of(asked, torch.device("cpu")) == asked


def test_half_precision_is_chosen_only_where_the_processor_reckons_with_it() -> None:
    words = set(Path("/proc/cpuinfo").read_text().split())
    knows = bool(words & {"avx512_bf16", "amx_bf16", "bf16"})
    assert precision_of("auto", torch.device("cpu")) == ("bfloat16" if knows else "float32")


@dataclass(frozen=True)
class _Halving:
    """A learner that shall halve numbers, with modules that draw by themselves what they leave out."""

    module: nn.Module
    header: Mapping[str, Any] = field(default_factory=dict)

    def batches(self, rng: np.random.Generator) -> Iterator[torch.Tensor]:
        while True:
            yield torch.from_numpy(rng.random((8, 4), dtype=np.float32))

    def losses(self, batch: torch.Tensor, step: int, noise: torch.Generator) -> dict[str, torch.Tensor]:
        return {"loss": ((self.module(batch) - 0.5 * batch) ** 2).mean()}

    def validate(self, noise: torch.Generator) -> dict[str, float]:
        return {}


def _trained(before: int, seed: int) -> torch.Tensor:
    """The weights after a round, where the process has drawn so many numbers before."""
    torch.manual_seed(before)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        module = nn.Sequential(nn.Linear(4, 4), nn.Dropout(0.5))
    entry = ProgramLmEntry(name="halving", kind="program_lm", steps=5, rounds=1)
    trainee = Trainee.of(_Halving(module), entry)
    train(trainee, entry, np.random.default_rng(seed), lambda done, total: None)
    return module[0].weight.detach()


def test_what_modules_leave_out_hangs_on_the_seed_of_the_round_alone() -> None:
    assert torch.equal(_trained(before=1, seed=3), _trained(before=2, seed=3))
    assert not torch.equal(_trained(before=1, seed=3), _trained(before=1, seed=4))
