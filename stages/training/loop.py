"""The training loop: so many steps of Adam."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from stages.training.checkpoint import tensors_below
from stages.training.model_config import ModelConfig
from stages.training.training_task import TrainingTask

FINAL_RATE_SHARE = 0.05
"""Share of the learning rate that is left at the last step."""
MAX_GRADIENT_NORM = 1.0
"""Longer gradients are shortened to this norm: recurrent nets have rare ones that undo hours."""

_BFLOAT16 = frozenset({"amx_bf16", "avx512_bf16", "bf16"})
_MOMENTS = ("exp_avg", "exp_avg_sq")


def set_deterministic(threads: int) -> None:
    """Let torch sum in one order, with so many threads: equal seeds give equal weights. To be called before anything
    runs on a GPU, whose matrix products read the environment when they are first used."""
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")
    torch.set_num_threads(threads)
    torch.use_deterministic_algorithms(True)
    torch.utils.deterministic.fill_uninitialized_memory = False  # type: ignore[attr-defined]  # it only costs time


def resolve_device(asked: str) -> torch.device:
    """The device that a config asks for."""
    return torch.device("cuda" if asked == "cuda" or (asked == "auto" and torch.cuda.is_available()) else "cpu")


def resolve_precision(asked: str, device: torch.device) -> str:
    """The numbers that a config asks for on a device: `auto` is bfloat16 where it is reckoned with as it stands, and
    not by way of float32, which takes several times as long."""
    if asked != "auto":
        return asked
    if device.type == "cuda":
        return "bfloat16" if torch.cuda.is_bf16_supported(including_emulation=False) else "float32"
    return "bfloat16" if _BFLOAT16 & _processor_flags() else "float32"


@cache
def _processor_flags() -> frozenset[str]:
    """What the processor says that it can do, as Linux names it."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return frozenset()
    told = (line.partition(":")[2] for line in lines if line.startswith(("flags", "Features")))
    return frozenset(next(told, "").split())


@dataclass
class TrainState:
    """A learner on its way: with its optimiser, after so many steps."""

    learner: TrainingTask
    optimizer: torch.optim.Adam
    step: int = 0

    @classmethod
    def of(cls, learner: TrainingTask, entry: ModelConfig) -> TrainState:
        return cls(learner, torch.optim.Adam(learner.module.parameters(), lr=entry.learning_rate))

    def tensors(self) -> dict[str, Tensor]:
        """Weights as `weights.<name>` and the optimiser's moments as `exp_avg.<name>` and `exp_avg_sq.<name>`; what no
        sample has used yet has none."""
        module = self.learner.module
        tensors = {f"weights.{name}": tensor for name, tensor in module.state_dict().items()}
        for name, parameter in module.named_parameters():
            for moment in _MOMENTS if parameter in self.optimizer.state else ():
                tensors[f"{moment}.{name}"] = self.optimizer.state[parameter][moment]
        return tensors

    def restore(self, tensors: dict[str, Tensor], step: int) -> None:
        """Go on from `tensors()` as they were after `step` steps."""
        module = self.learner.module
        module.load_state_dict(tensors_below(tensors, "weights"))
        moments = {moment: tensors_below(tensors, moment) for moment in _MOMENTS}
        state = {
            number: {"step": torch.tensor(float(step)), **{moment: moments[moment][name] for moment in _MOMENTS}}
            for number, (name, _) in enumerate(module.named_parameters())
            if name in moments[_MOMENTS[0]]
        }
        self.optimizer.load_state_dict({"state": state, "param_groups": self.optimizer.state_dict()["param_groups"]})
        self.step = step


def train(
    trainee: TrainState, entry: ModelConfig, rng: np.random.Generator, progress: Callable[[int, int], None]
) -> dict[str, float]:
    """One round: `entry.steps` steps. Answers the mean of each figure of the learner."""
    learner, optimizer = trainee.learner, trainee.optimizer
    device = next(learner.module.parameters()).device
    seed = int(rng.integers(2**63))
    noise = torch.Generator(device).manual_seed(seed)
    torch.manual_seed(seed)  # of what modules draw by themselves: dropout
    stream = learner.batches(rng)
    sums: dict[str, Tensor] = {}
    learner.module.train()
    for done in range(entry.steps):
        for group in optimizer.param_groups:
            group["lr"] = entry.learning_rate * _rate(trainee.step, entry.steps * entry.max_rounds)
        with torch.autocast(
            device.type, torch.bfloat16, enabled=resolve_precision(entry.precision, device) == "bfloat16"
        ):
            losses = learner.losses(next(stream), trainee.step, noise)
        optimizer.zero_grad()
        losses["loss"].backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(learner.module.parameters(), MAX_GRADIENT_NORM)
        optimizer.step()
        trainee.step += 1
        for name, value in losses.items():
            sums[name] = sums.get(name, torch.zeros((), device=device)) + value.detach()
        progress(done + 1, entry.steps)
    return {name: float(total) / entry.steps for name, total in sums.items()}


def _rate(step: int, steps: int) -> float:
    """The share of the learning rate at a step: it falls in a straight line."""
    return 1.0 - (1.0 - FINAL_RATE_SHARE) * step / steps
