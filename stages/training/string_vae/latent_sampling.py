"""Ways to new strings through the latent space.

Those of strings §5.2 start searches at points of their own and ask the decoder around them, with offsets that grow,
until they find a valid string that is not known, or the offsets are as large as they may be. Two more draw points, and
decode each once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from stages.training.string_vae.trained import LatentPoints, TrainedStringVae

MAX_OFFSET = 0.25
"""Largest offset of a perturbation in each dimension (strings §5.2)."""
MAX_OFFSET_BETWEEN = 0.1
"""The same around points between training samples: smaller, as the paper has it, which does not say by how much."""
OFFSET_STEPS = 10
"""Offsets grow in so many equal steps to the largest; not published."""
PATH_SEGMENTS = 32
"""Length of a path, in segments (strings §5.2)."""
STOPS_PER_SEGMENT = 4
"""Points on a line, and on each segment of a path, at equal distances; not published."""
SAMPLING_TEMPERATURE = 0.7
"""Of the tokens at points that are drawn. Of castles of 44 parts in the median, at `gaussian` points, the likeliest
tokens give 44 parts, and one string in three comes twice; at 0.7 they have 51, and 98 of a hundred differ; at 1 they
have 62."""
MAX_ENCODED_STRINGS = 2048
"""Training strings that a Gaussian is fitted to at most."""


@dataclass(frozen=True)
class LatentSearchResult:
    """What a search has found: a valid string, not known where it started, or None; `asked`: strings that were decoded,
    `valid`: how many of them were valid; point: float32 (latent,), where the last was."""

    string: str | None
    asked: int
    valid: int
    point: LatentPoints = field(compare=False)


def perturb(
    model: TrainedStringVae,
    points: LatentPoints,
    known: Sequence[frozenset[str]],
    largest: float,
    rng: np.random.Generator,
) -> list[LatentSearchResult]:
    """A search around each point, float32 (n, latent), for a valid string other than those `known` there.

    Each offset is larger than the one before in every dimension, of random sign. Strings are the likeliest of a point.
    """
    found = [LatentSearchResult(None, 0, 0, each) for each in points]
    searching = list(range(len(points)))
    bounds = np.linspace(0, largest, OFFSET_STEPS + 1)
    for low, high in pairwise(bounds.tolist()):
        shape = (len(searching), points.shape[1])
        offsets = rng.uniform(low, high, shape) * rng.choice([-1.0, 1.0], shape)
        moved = (points[searching] + offsets).astype(np.float32)
        still = []
        for place, string, point in zip(searching, model.decode(moved, None), moved, strict=True):
            valid = model.is_valid(string)
            is_new = valid and string not in known[place]
            before = found[place]
            found[place] = LatentSearchResult(string if is_new else None, before.asked + 1, before.valid + valid, point)
            if not is_new:
                still.append(place)
        searching = still
        if not searching:
            break
    return found


def linear_points(first: LatentPoints, second: LatentPoints, stops: int) -> LatentPoints:
    """Points on the line between two others, float32 (latent,), at equal distances: (stops, latent)."""
    shares = np.arange(1, stops + 1)[:, None] / (stops + 1)
    return (first + shares * (second - first)).astype(np.float32)


def path_points(first: LatentPoints, second: LatentPoints, samples: LatentPoints, segments: int) -> LatentPoints:
    """A path between two points along `samples`, float32 (n, latent): its corners, (segments + 1, latent).

    Each segment is split at the sample that is nearest to both of its ends together, and that the path has not passed,
    again and again until there are as many segments; `segments` is a power of two. With too few samples the path ends
    with fewer.
    """
    path = [first, second]
    free = np.ones(len(samples), np.bool_)
    for end in (first, second):
        free &= (samples != end).any(axis=1)
    while len(path) - 1 < segments:
        grown = [path[0]]
        for begin, end in pairwise(path):
            if free.any():
                gaps = np.linalg.norm(samples - begin, axis=1) + np.linalg.norm(samples - end, axis=1)
                nearest = int(np.where(free, gaps, np.inf).argmin())
                free[nearest] = False
                grown.append(samples[nearest])
            grown.append(end)
        if len(grown) == len(path):
            break
        path = grown
    return np.stack(path).astype(np.float32)


def gaussian_points(samples: LatentPoints, count: int, rng: np.random.Generator) -> LatentPoints:
    """Points (count, latent) of the Gaussian with the mean and the covariance of `samples`, float32 (n, latent)."""
    centre: LatentPoints = samples.mean(axis=0)
    spread = rng.standard_normal((count, len(samples))) / np.sqrt(len(samples))
    points: LatentPoints = (centre + spread @ (samples - centre)).astype(np.float32)
    return points


def sample(
    model: TrainedStringVae,
    way: str,
    strings: Sequence[str],
    count: int,
    rng: np.random.Generator,
    temperature: float = SAMPLING_TEMPERATURE,
) -> list[LatentSearchResult]:
    """`count` searches of one of WAYS among training strings.

    temperature: of the tokens where points are drawn: 1 as the model says how likely they are, less for likelier ones.
    """
    if way in _SEARCHES:
        return _SEARCHES[way](model, strings, count, rng)
    points = _DRAWS[way](model, strings, count, rng)
    found = []
    for string, point in zip(model.decode(points, rng, temperature), points, strict=True):
        valid = model.is_valid(string)
        found.append(LatentSearchResult(string if valid else None, 1, int(valid), point))
    return found


def _prior(model: TrainedStringVae, strings: Sequence[str], count: int, rng: np.random.Generator) -> LatentPoints:
    return rng.standard_normal((count, model.latent)).astype(np.float32)


def _gaussian(model: TrainedStringVae, strings: Sequence[str], count: int, rng: np.random.Generator) -> LatentPoints:
    chosen = rng.choice(len(strings), min(len(strings), MAX_ENCODED_STRINGS), replace=False)
    return gaussian_points(model.encode([strings[int(place)] for place in chosen]), count, rng)


def _perturbation(
    model: TrainedStringVae, strings: Sequence[str], count: int, rng: np.random.Generator
) -> list[LatentSearchResult]:
    chosen = [strings[int(place)] for place in rng.choice(len(strings), count)]
    return perturb(model, model.encode(chosen), [frozenset({each}) for each in chosen], MAX_OFFSET, rng)


def _linear(
    model: TrainedStringVae, strings: Sequence[str], count: int, rng: np.random.Generator
) -> list[LatentSearchResult]:
    lines = -(-count // STOPS_PER_SEGMENT)
    pairs = [rng.choice(len(strings), 2, replace=False).tolist() for _ in range(lines)]
    ends = model.encode([strings[place] for pair in pairs for place in pair]).reshape(lines, 2, -1)
    points = np.concatenate([linear_points(first, second, STOPS_PER_SEGMENT) for first, second in ends])
    known = [frozenset(strings[place] for place in pair) for pair in pairs for _ in range(STOPS_PER_SEGMENT)]
    return perturb(model, points[:count], known[:count], MAX_OFFSET_BETWEEN, rng)


def _path(
    model: TrainedStringVae, strings: Sequence[str], count: int, rng: np.random.Generator
) -> list[LatentSearchResult]:
    samples = model.encode(strings)
    everything = frozenset(strings)
    points: list[LatentPoints] = []
    while sum(map(len, points)) < count:
        first, second = rng.choice(len(strings), 2, replace=False)
        corners = path_points(samples[first], samples[second], samples, PATH_SEGMENTS)
        points += [linear_points(begin, end, STOPS_PER_SEGMENT) for begin, end in pairwise(corners)]
    return perturb(model, np.concatenate(points)[:count], [everything] * count, MAX_OFFSET_BETWEEN, rng)


LatentSearch = Callable[[TrainedStringVae, Sequence[str], int, np.random.Generator], list[LatentSearchResult]]
PointSampler = Callable[[TrainedStringVae, Sequence[str], int, np.random.Generator], LatentPoints]

_SEARCHES: dict[str, LatentSearch] = {
    "perturbation": _perturbation,
    "linear": _linear,
    "path": _path,
}
_DRAWS: dict[str, PointSampler] = {"prior": _prior, "gaussian": _gaussian}

SAMPLING_METHODS = (*_SEARCHES, *_DRAWS)
"""The ways by name: the published three in their published order, the best last; beside them points of the prior, and
points where the training strings stand, as a Gaussian: a weak divergence lets them stand somewhat beside the prior."""
