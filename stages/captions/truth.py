"""Whether a stated fact holds for a sample: written separately from what states it, on vertices in place of boxes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from stages.captions.facts import Fact
from stages.captions.placement import ShapePlacement
from stages.captions.words import plain_color_name
from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.pose import transform_points
from stages.shape.shape import Shape

SLACK_SHARE = 0.011
"""Largest difference of places that a caption may call alike, as a share of the longest side."""
MAX_RATIO_ERROR = 0.07
"""Largest relative difference that `about` may hide."""


@dataclass(frozen=True)
class Witnessed:
    """A shape as truth sees it.

    points: vertices of each part in the world
    nouns: noun of each part, empty for none
    contacts: pairs of parts that touch, (m, 2)
    """

    shape: Shape
    points: Sequence[FloatArray]
    nouns: Sequence[str]
    contacts: IntArray
    physics: Mapping[str, Any]
    noun: str
    placement: ShapePlacement

    @property
    def cloud(self) -> FloatArray:
        """All vertices, float64 (v, 3)."""
        return np.concatenate(list(self.points))

    @property
    def slack(self) -> float:
        """Length that makes no difference."""
        return SLACK_SHARE * float(np.ptp(self.cloud, axis=0).max())

    def of(self, noun: str) -> list[int]:
        """Return the parts that a noun names."""
        return [index for index, name in enumerate(self.nouns) if name == noun]

    def middles(self, noun: str) -> list[tuple[float, float, float]]:
        """Return the middle of the box around each part of a noun."""
        spans = [(self.points[part].max(axis=0) + self.points[part].min(axis=0)) / 2 for part in self.of(noun)]
        return [(float(x), float(y), float(z)) for x, y, z in spans]


def witnessed(
    shape: Shape,
    contacts: IntArray,
    physics: Mapping[str, Any],
    nouns: Mapping[str, str],
    noun: str,
    placement: ShapePlacement,
) -> Witnessed:
    """Return a shape, y up, ready for questions; `nouns` is the noun of each label, and `noun` that of the shape."""
    points = [
        transform_points(pose, shape.meshes[kind].vertices)
        for kind, pose in zip(shape.assembly.types.tolist(), shape.assembly.poses, strict=True)
    ]
    names = [nouns.get(shape.meshes[kind].label, "") for kind in shape.assembly.types.tolist()]
    return Witnessed(shape, points, names, contacts, physics, noun, placement)


def holds(fact: Fact, seen: Witnessed) -> bool:
    """Return whether a fact holds. Raises KeyError for a kind that nobody can check."""
    return bool(CHECKS[fact.kind](seen, *fact.about))


def _side(seen: Witnessed, word: str) -> float:
    x, y, z = np.ptp(seen.cloud, axis=0).tolist()
    if word == "tall":
        return float(y)
    if word == "wide":
        return float(x) if seen.placement.front_known else float("nan")
    return float(max(x, z)) if word == "long" else float("nan")


def _adjective(seen: Witnessed, word: str) -> bool:
    across = _side(seen, "wide" if seen.placement.front_known else "long")
    return _side(seen, "tall") > 1.5 * across if word == "tall" else across > 1.5 * _side(seen, "tall")


def _grid(seen: Witnessed, count: str, noun: str, columns: str, rows: str) -> bool:
    """Every column holds as many parts, one above the other, at the heights of the first column."""
    middles = seen.middles(noun)
    if len(middles) != int(count):
        return False
    spread = [max(place[axis] for place in middles) - min(place[axis] for place in middles) for axis in (0, 2)]
    along, across = (0, 1) if spread[0] > spread[1] else (2, 0)
    if spread[across] > 3 * seen.slack:
        return False
    ordered = sorted(middles, key=lambda place: place[along])
    groups = [ordered[start : start + int(rows)] for start in range(0, len(ordered), int(rows))]
    heights = [sorted(place[1] for place in group) for group in groups]
    return (
        len(groups) == int(columns)
        and all(np.ptp([place[along] for place in group]) < 3 * seen.slack for group in groups)
        and all(len(own) == int(rows) for own in heights)
        and all(np.abs(np.subtract(own, heights[0])).max() < 3 * seen.slack for own in heights)
        and all(high - low > seen.slack / 2 for low, high in pairwise(heights[0]))
    )


def _stack(seen: Witnessed, count: str, noun: str) -> bool:
    parts = sorted(seen.of(noun), key=lambda part: float(seen.points[part][:, 1].mean()))
    middles = np.array(seen.middles(noun))
    above = all(
        seen.points[high][:, 1].min() >= seen.points[low][:, 1].max() - seen.slack / 2 for low, high in pairwise(parts)
    )
    return len(parts) == int(count) and above and bool((np.ptp(middles[:, [0, 2]], axis=0) < 3 * seen.slack).all())


def _row(seen: Witnessed, count: str, noun: str) -> bool:
    places = np.array(seen.middles(noun))
    if len(places) != int(count) or np.ptp(places[:, 1]) > 3 * seen.slack:
        return False
    ends = max(((a, b) for a in places for b in places), key=lambda pair: float(np.linalg.norm(pair[0] - pair[1])))
    expected = np.linspace(ends[0], ends[1], len(places))
    gaps = np.linalg.norm(places[:, None] - expected[None], axis=2)
    return bool((gaps.min(axis=0) < 3 * seen.slack).all())


def _circle(seen: Witnessed, count: str, noun: str) -> bool:
    places = np.array(seen.middles(noun))
    offsets = places - places.mean(axis=0)
    radii = np.linalg.norm(offsets[:, [0, 2]], axis=1)
    gaps = np.linalg.norm(offsets[:, None] - offsets[None], axis=2) + 2 * radii.max() * np.eye(len(places))
    level = np.ptp(places[:, 1]) < 3 * seen.slack
    even = level and np.ptp(radii) < 3 * seen.slack and np.ptp(gaps.min(axis=1)) < 3 * seen.slack
    return len(places) == int(count) and bool(even)


def _stands(seen: Witnessed) -> bool:
    return bool(seen.physics["stable"]) and not seen.placement.hangs


def _stands_on(seen: Witnessed, count: str, noun: str) -> bool:
    ground = seen.cloud[:, 1].min()
    low = [part for part in range(len(seen.points)) if seen.points[part][:, 1].min() < ground + seen.slack / 3]
    return _stands(seen) and len(low) == int(count) and low == seen.of(noun)


def _above(seen: Witnessed, count: str, noun: str, others: str, other: str) -> bool:
    upper, lower = seen.of(noun), seen.of(other)
    if len(upper) != int(count) or len(lower) != int(others):
        return False
    low = min(seen.points[part][:, 1].min() for part in upper)
    return bool(low >= max(seen.points[part][:, 1].max() for part in lower) - seen.slack / 2)


def _touches(seen: Witnessed, noun: str, count: str, other: str) -> bool:
    targets = set(seen.of(other))
    pairs = {(a, b) for a, b in seen.contacts.tolist()} | {(b, a) for a, b in seen.contacts.tolist()}
    touching = all(any((part, target) in pairs for target in targets) for part in seen.of(noun))
    return len(targets) == int(count) and touching


def _colored(seen: Witnessed, parts: Sequence[int], word: str) -> bool:
    """Return whether faces of another colour are less than a hundredth of the area."""
    area = other = 0.0
    for part in parts:
        mesh = seen.shape.meshes[int(seen.shape.assembly.types[part])]
        corners = seen.points[part][mesh.faces]
        sizes = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        named = np.array([plain_color_name(color) == word for color in mesh.face_colors.tolist()])
        area, other = area + float(sizes.sum()), other + float(sizes[~named].sum())
    return other < 0.01 * area


CHECKS: Mapping[str, Callable[..., Any]] = {
    "noun": lambda seen, noun: noun == seen.noun,
    "adjective": _adjective,
    "count": lambda seen, count, noun: len(seen.of(noun)) == int(count),
    "parts": lambda seen, count: len(seen.points) == int(count),
    "equal": lambda seen, word: abs(_side(seen, "tall") / _side(seen, word) - 1) < MAX_RATIO_ERROR,
    "longer": lambda seen, one, other: _side(seen, one) > _side(seen, other),
    "ratio": lambda seen, one, other, times: (
        abs(_side(seen, one) / _side(seen, other) / float(times) - 1) < MAX_RATIO_ERROR
    ),
    "height": lambda seen, metres: seen.shape.unit == "metre" and abs(_side(seen, "tall") - float(metres)) <= 0.005001,
    "grid": _grid,
    "stack": _stack,
    "row": _row,
    "circle": _circle,
    "stands on": _stands_on,
    "above": _above,
    "touches": _touches,
    "color": lambda seen, count, noun, word: len(seen.of(noun)) == int(count) and _colored(seen, seen.of(noun), word),
    "all color": lambda seen, word: _colored(seen, range(len(seen.points)), word),
    "stable": _stands,
    "unstable": lambda seen: not seen.physics["stable"] and not seen.placement.hangs,
    "not rooted": lambda seen: seen.physics["floating"] > 0 and not seen.placement.hangs,
    "tilt": lambda seen, degrees: _stands(seen) and seen.physics["tipping_degrees"] > float(degrees),
    "mirror": lambda seen: seen.physics["symmetry"] > 0.99,
}
