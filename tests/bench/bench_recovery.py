"""Clouds a second and core that a recovery network learns from, beside a plain DGCNN as published (geocode §3.3)."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from tests.bench.measure import Measure, rate

BATCH = 8
POINTS = 1024
PUBLISHED_POINTS = 2300


def bench() -> Iterator[Measure]:
    """A step of the optimiser: forward, backward, Adam. The peer is the published network in plain torch, with a graph
    made anew of all distances before each convolution, and every edge in memory."""
    import torch
    from torch import Tensor, nn
    from torch.nn.functional import cross_entropy

    from stages.programs.program import find_program
    from stages.training.recovery.settings import RecoveryEntry
    from stages.training.recovery.training import new_model

    torch.set_num_threads(1)
    chair = find_program("chair")
    classes = [each.classes for each in chair.parameters]

    class Published(nn.Module):
        """DGCNN: k 20, widths 16, 16, 32, 64, embedding 64; a perceptron 128-128-64-n a parameter, dropout a half."""

        def __init__(self) -> None:
            super().__init__()
            widths = (3, 16, 16, 32, 64)
            self.edges = nn.ModuleList(
                nn.Sequential(nn.Conv2d(2 * a, b, 1, bias=False), nn.BatchNorm2d(b), nn.LeakyReLU(0.2))
                for a, b in pairwise(widths)
            )
            self.mixed = nn.Sequential(nn.Conv1d(128, 64, 1, bias=False), nn.BatchNorm1d(64), nn.LeakyReLU(0.2))
            self.decoders = nn.ModuleList(
                nn.Sequential(
                    nn.Linear(128, 128), nn.ReLU(), nn.Dropout(0.5),
                    nn.Linear(128, 64), nn.ReLU(), nn.Dropout(0.5), nn.Linear(64, count),
                )
                for count in classes
            )  # fmt: skip

        def forward(self, clouds: Tensor) -> list[Tensor]:
            features, found = clouds.transpose(1, 2), []
            for convolution in self.edges:
                inner = 2.0 * features.transpose(1, 2) @ features
                squares = (features**2).sum(dim=1)
                nearest = (inner - squares[:, :, None] - squares[:, None, :]).topk(20, dim=-1).indices
                batch = torch.arange(len(features))[:, None, None]
                others = features.transpose(1, 2)[batch, nearest]
                own = features.transpose(1, 2)[:, :, None].expand_as(others)
                edges = torch.cat([others - own, own], dim=-1).permute(0, 3, 1, 2)
                features = convolution(edges).amax(dim=-1)
                found.append(features)
            mixed = self.mixed(torch.cat(found, dim=1))
            embedded = torch.cat([mixed.amax(dim=-1), mixed.mean(dim=-1)], dim=1)
            return [decoder(embedded) for decoder in self.decoders]

    rng = np.random.default_rng(0)
    targets = torch.from_numpy(np.stack([rng.integers(0, count, BATCH) for count in classes], axis=1))
    entry = RecoveryEntry(name="bench", points=POINTS)
    ours, peer = new_model(entry, chair, 0), Published()
    optimizers = {id(net): torch.optim.Adam(net.parameters()) for net in (ours, peer)}

    def step(net: nn.Module, clouds: Tensor) -> int:
        logits = net(clouds)
        if isinstance(logits, Tensor):
            loss = cross_entropy(logits.flatten(0, 1), targets.flatten(), reduction="sum")
        else:
            loss = torch.stack([cross_entropy(a, b) for a, b in zip(logits, targets.T, strict=True)]).sum()
        optimizers[id(net)].zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimizers[id(net)].step()
        return len(clouds)

    few, many = (torch.from_numpy(_clouds(count)) for count in (POINTS, PUBLISHED_POINTS))
    equal = rate(lambda: step(ours, few), seconds=1.0, rounds=2)
    name = "recovery, a step of training"
    peer_rate = rate(lambda: step(peer, few), seconds=1.0, rounds=1)
    yield Measure(f"{name}, {POINTS} points", "clouds", equal, "DGCNN as published", peer_rate)
    peer_rate = rate(lambda: step(peer, many), seconds=1.0, rounds=1)
    ours_many = rate(lambda: step(ours, many), seconds=1.0, rounds=1)
    yield Measure(f"{name}, {PUBLISHED_POINTS} points", "clouds", ours_many, "DGCNN as published", peer_rate)

    yield Measure("recovery of a cloud, guessed and searched", "clouds", _recoveries(), note="300 shapes of a chair")


def _recoveries() -> float:
    """Clouds a second that the model which ships recovers."""
    from stages.training.recovery.recover import SHIPPED, find_models, recover

    models, _ = find_models(SHIPPED)
    cloud = _clouds(2048)[0]

    def once() -> int:
        recover(cloud, "chair", models, up="y", budget=300)
        return 1

    return rate(once, seconds=1.0, rounds=1)


def _clouds(n: int) -> np.ndarray:
    """Clouds float32 (BATCH, n, 3) on the base chair."""
    from stages.points.area_sampling import sample_shape
    from stages.programs.program import find_program, shape_of

    chair = find_program("chair")
    shape, rng = shape_of(chair, chair.schema.base), np.random.default_rng(0)
    return np.stack([sample_shape(shape, n, rng).points for _ in range(BATCH)]).astype(np.float32)
