"""How near recovered chairs come after so many seconds of training, beside the published network (geocode §3.3).

python -m tests.bench.recovery_race [--seconds 60 300] [--shapes 4000]

Both learn on one core from the same shapes, ours by its settings (some points of each, half of them spoilt), the
published DGCNN by its own: 2,300 points, batches of 33, Adam at 0.01. They are judged by shapes that none has learnt
from, by the likeliest classes: nats, share of visible parameters that are right, Chamfer in sides of the box.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from itertools import islice
from time import process_time

import numpy as np
import torch
from torch import Tensor, nn

from stages.programs.program import Program, find_program
from stages.shape.arrays import FloatArray
from stages.shape.geometry.clouds import chamfer_squared
from stages.training.recovery.augmentation import quantized_cloud
from stages.training.recovery.clouds import frame_of
from stages.training.recovery.settings import RecoveryModelConfig
from stages.training.recovery.shapes import TRAIN_INTERVAL, VALIDATION_INTERVAL, nearest_valid_values, random_shapes
from stages.training.recovery.surface import sample_points, shape_points
from stages.training.recovery.training import RecoveryTask, new_network
from tests.bench.published_dgcnn import PublishedDGCNN

POINTS, BATCH, RATE = 2300, 33, 1e-2
"""As published."""
JUDGED = 64
MEASURED = 2048
HIDDEN = -1e9


def main() -> None:
    """Train both, print a row a mark and network."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench.recovery_race", description=__doc__)
    parser.add_argument("--seconds", type=float, nargs="+", default=[60.0, 300.0], help="of training, at marks")
    parser.add_argument("--shapes", type=int, default=4000, help="that they learn from")
    asked = parser.parse_args()
    torch.set_num_threads(1)
    chair = find_program("chair")
    learnt, judged = (_clouds(chair, *each) for each in ((TRAIN_INTERVAL, asked.shapes), (VALIDATION_INTERVAL, JUDGED)))
    print("| network | CPU s | clouds | nats | right | Chamfer |\n|---|---|---|---|---|---|")
    for name, racer in (("ours", _ours(chair, learnt)), ("DGCNN as published", _published(chair, learnt))):
        module, step, read = racer
        spent, seen = 0.0, 0
        for mark in sorted(asked.seconds):
            module.train()
            while spent < mark:
                before = process_time()
                seen += step()
                spent += process_time() - before
            module.eval()
            figures = _judged(chair, read, judged)
            print(
                f"| {name} | {spent:.0f} | {seen:,} | " + " | ".join(f"{each:.4g}" for each in figures), "|", flush=True
            )


Racer = tuple[nn.Module, Callable[[], int], Callable[[FloatArray], Tensor]]
"""A network, one step of its training, which answers how many clouds it saw, and the logits (n, parameters, classes) of
clouds float64 (n, POINTS, 3)."""
Clouds = tuple[FloatArray, np.ndarray, list[dict[str, object]]]
"""Clouds float64 (n, POINTS, 3) in their boxes, classes int64 (n, parameters), values."""


def _clouds(program: Program, interval: tuple[float, float], count: int) -> Clouds:
    rng = np.random.default_rng(0)
    shapes = list(islice(random_shapes(program, interval, rng), count))
    clouds = [sample_points(each.parts, POINTS, rng) for each in shapes]
    framed = np.array([frame_of(each).normalized(each) for each in clouds])
    return framed, np.array([each.classes for each in shapes]), [dict(each.values) for each in shapes]


def _ours(program: Program, learnt: Clouds) -> Racer:
    entry = RecoveryModelConfig(name="race")
    clouds, classes, _ = learnt
    inputs = np.array([quantized_cloud(each[: 2 * entry.points]) for each in clouds])
    module = new_network(entry, program, 0)
    learner = RecoveryTask(module, {}, entry, {"inputs": inputs, "classes": classes}, {}, program, ())
    optimizer = torch.optim.Adam(module.parameters(), lr=entry.learning_rate)
    batches: Iterator[tuple[Tensor, Tensor]] = learner.batches(np.random.default_rng(0))
    noise = torch.Generator().manual_seed(0)

    def step() -> int:
        batch = next(batches)
        _descend(optimizer, learner.losses(batch, 0, noise)["loss"])
        return len(batch[0])

    def read(shown: FloatArray) -> Tensor:
        few = [each[: entry.points] for each in shown]
        found: Tensor = module(torch.from_numpy(np.array([frame_of(each).normalized(each) for each in few])).float())
        return found

    return module, step, read


def _published(program: Program, learnt: Clouds) -> Racer:
    clouds, classes, _ = learnt
    torch.manual_seed(0)
    module = PublishedDGCNN([each.classes for each in program.parameters])
    optimizer, rng = torch.optim.Adam(module.parameters(), lr=RATE), np.random.default_rng(0)

    def step() -> int:
        rows = rng.integers(len(clouds), size=BATCH)
        _descend(optimizer, module.loss(torch.from_numpy(clouds[rows]).float(), torch.from_numpy(classes[rows])))
        return BATCH

    def read(shown: FloatArray) -> Tensor:
        logits = module(torch.from_numpy(shown).float())
        most = max(each.shape[1] for each in logits)
        return torch.stack([nn.functional.pad(each, (0, most - each.shape[1]), value=HIDDEN) for each in logits], dim=1)

    return module, step, read


def _descend(optimizer: torch.optim.Optimizer, loss: Tensor) -> None:
    optimizer.zero_grad()
    loss.backward()  # type: ignore[no-untyped-call]
    optimizer.step()


@torch.no_grad()
def _judged(program: Program, read: Callable[[FloatArray], Tensor], judged: Clouds) -> tuple[float, float, float]:
    """Nats, the share of the visible parameters that are right, and Chamfer."""
    clouds, classes, values = judged
    truth = torch.from_numpy(classes)
    logits = torch.cat([read(clouds[start : start + 8]) for start in range(0, len(clouds), 8)])
    nats = nn.functional.cross_entropy(logits.flatten(0, 1), truth.flatten(), reduction="sum") / len(truth)
    best = logits.argmax(dim=-1)
    visible = truth < torch.tensor([len(each.values) for each in program.parameters])
    distances = []
    for chosen, each in zip(best.tolist(), values, strict=True):
        found = nearest_valid_values(program, program.schema.from_classes(chosen))
        pair = (shape_points(program.parts(shown), MEASURED) for shown in (found, each))
        distances.append(chamfer_squared(*(frame_of(points).normalized(points) for points in pair)))
    return float(nats), float((best == truth)[visible].float().mean()), float(np.mean(distances))


if __name__ == "__main__":
    main()
