"""Clouds a second and core in the training of recovery, compared with the published DGCNN (geocode §3.3)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tests.bench.measure import Measure, rate

BATCH_SIZE = 8
OWN_POINTS = 1024
PUBLISHED_POINTS = 2300


def bench() -> Iterator[Measure]:
    """A step of the optimiser: forward, backward, Adam."""
    import torch
    from torch import Tensor, nn
    from torch.nn.functional import cross_entropy

    from stages.programs.program import find_program
    from stages.training.recovery.settings import RecoveryModelConfig
    from stages.training.recovery.training import new_network
    from tests.bench.published_dgcnn import PublishedDGCNN

    torch.set_num_threads(1)
    chair = find_program("chair")
    classes = [parameter.classes for parameter in chair.parameters]

    rng = np.random.default_rng(0)
    targets = torch.from_numpy(np.stack([rng.integers(0, count, BATCH_SIZE) for count in classes], axis=1))
    entry = RecoveryModelConfig(name="bench", points=OWN_POINTS)
    ours, peer = new_network(entry, chair, 0), PublishedDGCNN(classes)
    optimizers = {id(net): torch.optim.Adam(net.parameters()) for net in (ours, peer)}

    def step(net: nn.Module, clouds: Tensor) -> int:
        if isinstance(net, PublishedDGCNN):
            loss = net.loss(clouds, targets)
        else:
            loss = cross_entropy(net(clouds).flatten(0, 1), targets.flatten(), reduction="sum")
        optimizers[id(net)].zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimizers[id(net)].step()
        return len(clouds)

    few, many = (torch.from_numpy(_clouds(count)) for count in (OWN_POINTS, PUBLISHED_POINTS))
    equal = rate(lambda: step(ours, few), seconds=1.0, rounds=2)
    name = "recovery, a step of training"
    peer_rate = rate(lambda: step(peer, few), seconds=1.0, rounds=1)
    yield Measure(f"{name}, {OWN_POINTS} points", "clouds", equal, "DGCNN as published", peer_rate)
    peer_rate = rate(lambda: step(peer, many), seconds=1.0, rounds=1)
    ours_many = rate(lambda: step(ours, many), seconds=1.0, rounds=1)
    yield Measure(f"{name}, {PUBLISHED_POINTS} points", "clouds", ours_many, "DGCNN as published", peer_rate)

    yield Measure("recovery of a cloud, estimate and search", "clouds", _recoveries(), note="300 shapes of a chair")


def _recoveries() -> float:
    """Clouds a second recovered with the shipped model."""
    from stages.recovery.recover import recover
    from stages.training.recovery.trained import PRETRAINED_FOLDER, find_models

    models, _ = find_models(PRETRAINED_FOLDER)
    cloud = _clouds(2048)[0]

    def once() -> int:
        recover(cloud, "chair", models, up="y", budget=300)
        return 1

    return rate(once, seconds=1.0, rounds=1)


def _clouds(n: int) -> np.ndarray:
    """Clouds float32 (BATCH_SIZE, n, 3) on the base chair."""
    from stages.points.area_sampling import sample_shape
    from stages.programs.program import build_shape, find_program

    chair = find_program("chair")
    shape, rng = build_shape(chair, chair.schema.base), np.random.default_rng(0)
    return np.stack([sample_shape(shape, n, rng).points for _ in range(BATCH_SIZE)]).astype(np.float32)
