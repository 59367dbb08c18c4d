"""Sample new strings through the latent space.

The three methods of strings §5.2 start searches at different points and decode around them with growing offsets, until
they reach a valid string that is not known, or the maximum offset. Two more methods sample points, and decode each
once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from stages.training.latent import LatentPoints
from stages.training.string_vae.trained import TrainedStringVae

MAX_OFFSET = 0.25
"""Maximum offset of a perturbation in each dimension (strings §5.2)."""
MAX_OFFSET_BETWEEN = 0.1
"""The same around points between training samples; smaller, by a factor that the paper does not give."""
OFFSET_STEPS = 10
"""Equal steps to the maximum offset; not published."""
PATH_SEGMENTS = 32
"""Length of a path (strings §5.2)."""
STOPS_PER_SEGMENT = 4
"""Equidistant points on a line, and on each segment of a path; not published."""
SAMPLING_TEMPERATURE = 0.7
"""Token temperature at sampled points. For castles with a median of 44 parts, at `gaussian` points: the likeliest
tokens give 44 parts, and every third string is a repetition; 0.7 gives 51 parts and 98 % distinct strings, 1 gives 62
parts.
"""
MAX_ENCODED_STRINGS = 2048
"""Training strings that the Gaussian is fitted to."""


@dataclass(frozen=True)
class LatentSearchResult:
    """The result of a search.

    string: a valid string that was not known, or None.
    decoded: number of decoded strings.
    valid: how many of them were valid.
    point: float32 (latent,), of the last one.
    """

    string: str | None
    decoded: int
    valid: int
    point: LatentPoints = field(compare=False)


def perturb(
    model: TrainedStringVae,
    points: LatentPoints,
    known: Sequence[frozenset[str]],
    largest: float,
    rng: np.random.Generator,
) -> list[LatentSearchResult]:
    """Search around each point, float32 (n, latent), for a valid string that is not `known` there.

    Offsets grow in every dimension, with random signs. Strings are the likeliest of a point.
    """
    results = [LatentSearchResult(None, 0, 0, point) for point in points]
    searching = list(range(len(points)))
    bounds = np.linspace(0, largest, OFFSET_STEPS + 1)
    for low, high in pairwise(bounds.tolist()):
        shape = (len(searching), points.shape[1])
        offsets = rng.uniform(low, high, shape) * rng.choice([-1.0, 1.0], shape)
        moved = (points[searching] + offsets).astype(np.float32)
        still = []
        for index, string, point in zip(searching, model.decode(moved, None), moved, strict=True):
            valid = model.is_valid(string)
            is_new = valid and string not in known[index]
            before = results[index]
            results[index] = LatentSearchResult(
                string if is_new else None, before.decoded + 1, before.valid + valid, point
            )
            if not is_new:
                still.append(index)
        searching = still
        if not searching:
            break
    return results


def linear_points(first: LatentPoints, second: LatentPoints, stops: int) -> LatentPoints:
    """Return equidistant points between two others, float32 (stops, latent)."""
    shares = np.arange(1, stops + 1)[:, None] / (stops + 1)
    return (first + shares * (second - first)).astype(np.float32)


def path_points(first: LatentPoints, second: LatentPoints, samples: LatentPoints, segments: int) -> LatentPoints:
    """Return the corners of a path between two points along `samples`, float32 (segments + 1, latent).

    Each segment is split at the unused sample with the smallest sum of distances to both ends, until there are
    `segments`, a power of two. With too few samples the path has fewer.
    samples: float32 (n, latent).
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
    """Sample points of the Gaussian with mean and covariance of `samples`: float32 (count, latent)."""
    centre: LatentPoints = samples.mean(axis=0)
    weights = rng.standard_normal((count, len(samples))) / np.sqrt(len(samples))
    points: LatentPoints = (centre + weights @ (samples - centre)).astype(np.float32)
    return points


def sample(
    model: TrainedStringVae,
    method: str,
    strings: Sequence[str],
    count: int,
    rng: np.random.Generator,
    temperature: float = SAMPLING_TEMPERATURE,
) -> list[LatentSearchResult]:
    """Run `count` searches from training strings.

    method: one of SAMPLING_METHODS.
    temperature: of the tokens at sampled points.
    """
    if method in _SEARCHES:
        return _SEARCHES[method](model, strings, count, rng)
    points = _DRAWS[method](model, strings, count, rng)
    results = []
    for string, point in zip(model.decode(points, rng, temperature), points, strict=True):
        valid = model.is_valid(string)
        results.append(LatentSearchResult(string if valid else None, 1, int(valid), point))
    return results


def _prior(model: TrainedStringVae, strings: Sequence[str], count: int, rng: np.random.Generator) -> LatentPoints:
    return rng.standard_normal((count, model.latent)).astype(np.float32)


def _gaussian(model: TrainedStringVae, strings: Sequence[str], count: int, rng: np.random.Generator) -> LatentPoints:
    chosen = rng.choice(len(strings), min(len(strings), MAX_ENCODED_STRINGS), replace=False)
    return gaussian_points(model.encode([strings[int(index)] for index in chosen]), count, rng)


def _perturbation(
    model: TrainedStringVae, strings: Sequence[str], count: int, rng: np.random.Generator
) -> list[LatentSearchResult]:
    chosen = [strings[int(index)] for index in rng.choice(len(strings), count)]
    return perturb(model, model.encode(chosen), [frozenset({string}) for string in chosen], MAX_OFFSET, rng)


def _linear(
    model: TrainedStringVae, strings: Sequence[str], count: int, rng: np.random.Generator
) -> list[LatentSearchResult]:
    lines = -(-count // STOPS_PER_SEGMENT)
    pairs = [rng.choice(len(strings), 2, replace=False).tolist() for _ in range(lines)]
    ends = model.encode([strings[index] for pair in pairs for index in pair]).reshape(lines, 2, -1)
    points = np.concatenate([linear_points(first, second, STOPS_PER_SEGMENT) for first, second in ends])
    known = [frozenset(strings[index] for index in pair) for pair in pairs for _ in range(STOPS_PER_SEGMENT)]
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
"""The three published methods in their published order, then samples of the prior, and of the Gaussian of the encoded
training strings. With a weak divergence the latter differs from the prior, and works best.
"""
