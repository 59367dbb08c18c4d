"""The training loop: steps of Adam with a linearly falling learning rate."""

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
from stages.training.training_task import TrainingTask

FINAL_RATE_SHARE = 0.05
MAX_GRADIENT_NORM = 1.0
"""Longer gradients are clipped to this norm: recurrent nets have rare ones that undo hours."""

_BFLOAT16_FLAGS = frozenset({"amx_bf16", "avx512_bf16", "bf16"})
_MOMENTS = ("exp_avg", "exp_avg_sq")


def set_deterministic(threads: int) -> None:
    """Make torch sum in one order, with a number of threads, so that equal seeds give equal weights.

    Call it before anything runs on a GPU: matrix products read the environment on first use.
    """
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")
    torch.set_num_threads(threads)
    torch.set_deterministic_debug_mode("error")  # unlike use_deterministic_algorithms, it imports no compiler
    torch.utils.deterministic.fill_uninitialized_memory = False  # type: ignore[attr-defined]  # it only costs time


def resolve_precision(setting: str, device: torch.device) -> str:
    """Return the precision of a config's `precision` on a device.

    `auto` is bfloat16 where the hardware supports it; emulation by float32 takes several times as long.
    """
    if setting != "auto":
        return setting
    if device.type == "cuda":
        return "bfloat16" if torch.cuda.is_bf16_supported(including_emulation=False) else "float32"
    return "bfloat16" if _BFLOAT16_FLAGS & _processor_flags() else "float32"


@cache
def _processor_flags() -> frozenset[str]:
    """Read the features of the processor, as Linux names them."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return frozenset()
    flags = (line.partition(":")[2] for line in lines if line.startswith(("flags", "Features")))
    return frozenset(next(flags, "").split())


@dataclass
class TrainState:
    """A task with its optimiser and the number of steps taken."""

    task: TrainingTask
    optimizer: torch.optim.Adam
    step: int = 0

    @classmethod
    def of(cls, task: TrainingTask) -> TrainState:
        """Start training a task."""
        return cls(task, torch.optim.Adam(task.module.parameters(), lr=task.config.learning_rate))

    def tensors(self) -> dict[str, Tensor]:
        """Return weights as `weights.<name>`, moments of the optimiser as `exp_avg.<name>` and `exp_avg_sq.<name>`.

        A parameter that no sample has used yet has no moments.
        """
        module = self.task.module
        tensors = {f"weights.{name}": tensor for name, tensor in module.state_dict().items()}
        for name, parameter in module.named_parameters():
            for moment in _MOMENTS if parameter in self.optimizer.state else ():
                tensors[f"{moment}.{name}"] = self.optimizer.state[parameter][moment]
        return tensors

    def restore(self, tensors: dict[str, Tensor], step: int) -> None:
        """Resume from `tensors()` as they were after `step` steps."""
        module = self.task.module
        module.load_state_dict(tensors_below(tensors, "weights"))
        moments = {moment: tensors_below(tensors, moment) for moment in _MOMENTS}
        state = {
            number: {"step": torch.tensor(float(step)), **{moment: moments[moment][name] for moment in _MOMENTS}}
            for number, (name, _) in enumerate(module.named_parameters())
            if name in moments[_MOMENTS[0]]
        }
        self.optimizer.load_state_dict({"state": state, "param_groups": self.optimizer.state_dict()["param_groups"]})
        self.step = step


def train(state: TrainState, rng: np.random.Generator, progress: Callable[[int, int], None]) -> dict[str, float]:
    """Train one round, `config.steps` steps. Returns the mean of each figure of the task."""
    task, optimizer, config = state.task, state.optimizer, state.task.config
    device = task.device
    seed = int(rng.integers(2**63))
    noise = torch.Generator(device).manual_seed(seed)
    torch.manual_seed(seed)  # modules draw dropout from the global generator
    half = resolve_precision(config.precision, device) == "bfloat16"
    batches = task.batches(rng)
    sums: dict[str, Tensor] = {}
    task.module.train()
    for done in range(config.steps):
        for group in optimizer.param_groups:
            group["lr"] = config.learning_rate * _rate(state.step, config.steps * config.max_rounds)
        with torch.autocast(device.type, torch.bfloat16, enabled=half):
            losses = task.losses(next(batches), state.step, noise)
        optimizer.zero_grad()
        losses["loss"].backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(task.module.parameters(), MAX_GRADIENT_NORM)
        optimizer.step()
        state.step += 1
        for name, value in losses.items():
            sums[name] = sums.get(name, torch.zeros((), device=device)) + value.detach()
        progress(done + 1, config.steps)
    return {name: float(total) / config.steps for name, total in sums.items()}


def _rate(step: int, steps: int) -> float:
    """Return the share of the learning rate at a step; it falls linearly."""
    return 1.0 - (1.0 - FINAL_RATE_SHARE) * step / steps
