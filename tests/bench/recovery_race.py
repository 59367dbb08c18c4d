"""Accuracy of recovered chairs by seconds of training, compared with the published network (geocode §3.3).

python -m tests.bench.recovery_race [--seconds 60 300] [--shapes 4000]

Both learn on one core from the same shapes: ours by its settings (a subsample of the points, half of them corrupted),
the published DGCNN by its own (2,300 points, batches of 33, Adam at 0.01). Measured on held-out shapes by the
likeliest classes: nats, share of correct visible parameters, Chamfer distance in sides of the box.
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
from stages.training.recovery.shapes import (
    TRAIN_INTERVAL,
    VALIDATION_INTERVAL,
    nearest_valid_values,
    random_training_shapes,
)
from stages.training.recovery.surface import sample_points, shape_points
from stages.training.recovery.training import RecoveryTask, new_network
from tests.bench.published_dgcnn import PublishedDGCNN

PUBLISHED_POINTS, PUBLISHED_BATCH_SIZE, PUBLISHED_LEARNING_RATE = 2300, 33, 1e-2
"""As published."""
HELD_OUT_SHAPES = 64
CHAMFER_POINTS = 2048
MISSING_CLASS_LOGIT = -1e9


def main() -> None:
    """Train both networks and print a row for each mark."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench.recovery_race", description=__doc__)
    parser.add_argument("--seconds", type=float, nargs="+", default=[60.0, 300.0], help="of training, at marks")
    parser.add_argument("--shapes", type=int, default=4000, help="that they learn from")
    options = parser.parse_args()
    torch.set_num_threads(1)
    chair = find_program("chair")
    training_set, held_out = (
        _clouds(chair, *request)
        for request in ((TRAIN_INTERVAL, options.shapes), (VALIDATION_INTERVAL, HELD_OUT_SHAPES))
    )
    print("| network | CPU s | clouds | nats | right | Chamfer |\n|---|---|---|---|---|---|")
    for name, racer in (("ours", _ours(chair, training_set)), ("DGCNN as published", _published(chair, training_set))):
        module, step, read = racer
        spent, seen = 0.0, 0
        for mark in sorted(options.seconds):
            module.train()
            while spent < mark:
                before = process_time()
                seen += step()
                spent += process_time() - before
            module.eval()
            figures = _judged(chair, read, held_out)
            print(
                f"| {name} | {spent:.0f} | {seen:,} | " + " | ".join(f"{figure:.4g}" for figure in figures),
                "|",
                flush=True,
            )


Racer = tuple[nn.Module, Callable[[], int], Callable[[FloatArray], Tensor]]
"""A network; one step of its training, which returns the number of clouds; and the logits (n, parameters, classes) of
clouds float64 (n, PUBLISHED_POINTS, 3)."""
Clouds = tuple[FloatArray, np.ndarray, list[dict[str, object]]]
"""Clouds float64 (n, PUBLISHED_POINTS, 3) in their boxes, classes int64 (n, parameters), values."""


def _clouds(program: Program, interval: tuple[float, float], count: int) -> Clouds:
    rng = np.random.default_rng(0)
    shapes = list(islice(random_training_shapes(program, interval, rng), count))
    clouds = [sample_points(shape.parts, PUBLISHED_POINTS, rng) for shape in shapes]
    framed = np.array([frame_of(cloud).normalized(cloud) for cloud in clouds])
    return framed, np.array([shape.classes for shape in shapes]), [dict(shape.values) for shape in shapes]


def _ours(program: Program, training_set: Clouds) -> Racer:
    entry = RecoveryModelConfig(name="race")
    clouds, classes, _ = training_set
    inputs = np.array([quantized_cloud(cloud[: 2 * entry.points]) for cloud in clouds])
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
        few = [cloud[: entry.points] for cloud in shown]
        normalized = np.array([frame_of(cloud).normalized(cloud) for cloud in few])
        logits: Tensor = module(torch.from_numpy(normalized).float())
        return logits

    return module, step, read


def _published(program: Program, training_set: Clouds) -> Racer:
    clouds, classes, _ = training_set
    torch.manual_seed(0)
    module = PublishedDGCNN([parameter.classes for parameter in program.parameters])
    optimizer, rng = torch.optim.Adam(module.parameters(), lr=PUBLISHED_LEARNING_RATE), np.random.default_rng(0)

    def step() -> int:
        rows = rng.integers(len(clouds), size=PUBLISHED_BATCH_SIZE)
        _descend(optimizer, module.loss(torch.from_numpy(clouds[rows]).float(), torch.from_numpy(classes[rows])))
        return PUBLISHED_BATCH_SIZE

    def read(shown: FloatArray) -> Tensor:
        logits = module(torch.from_numpy(shown).float())
        count = max(rows.shape[1] for rows in logits)
        return torch.stack(
            [nn.functional.pad(rows, (0, count - rows.shape[1]), value=MISSING_CLASS_LOGIT) for rows in logits], dim=1
        )

    return module, step, read


def _descend(optimizer: torch.optim.Optimizer, loss: Tensor) -> None:
    optimizer.zero_grad()
    loss.backward()  # type: ignore[no-untyped-call]
    optimizer.step()


@torch.no_grad()
def _judged(program: Program, read: Callable[[FloatArray], Tensor], held_out: Clouds) -> tuple[float, float, float]:
    """Nats, share of correct visible parameters, and Chamfer distance."""
    clouds, classes, values = held_out
    truth = torch.from_numpy(classes)
    logits = torch.cat([read(clouds[start : start + 8]) for start in range(0, len(clouds), 8)])
    nats = nn.functional.cross_entropy(logits.flatten(0, 1), truth.flatten(), reduction="sum") / len(truth)
    best = logits.argmax(dim=-1)
    visible = truth < torch.tensor([len(parameter.values) for parameter in program.parameters])
    distances = []
    for classes_found, truth_values in zip(best.tolist(), values, strict=True):
        recovered = nearest_valid_values(program, program.schema.from_classes(classes_found))
        pair = (shape_points(program.parts(shape), CHAMFER_POINTS) for shape in (recovered, truth_values))
        distances.append(chamfer_squared(*(frame_of(points).normalized(points) for points in pair)))
    return float(nats), float((best == truth)[visible].float().mean()), float(np.mean(distances))


if __name__ == "__main__":
    main()
