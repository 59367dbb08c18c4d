"""Facts about a shape that captions may state. All of them hold; what is near a limit is no fact."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stages.captions.placement import ShapePlacement
from stages.captions.words import color_name
from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.contact import world_boxes
from stages.shape.geometry.triangles import triangle_areas
from stages.shape.shape import Shape

PLACE_TOLERANCE_SHARE = 0.01
"""Places that differ by less than this share of the longest side are alike."""
RATIO_TOLERANCE = 0.06
"""Largest relative difference of `about twice` from twice."""
CLEAR_RATIO = 1.1
"""A side is longer than another if it is this much longer."""
TALL_RATIO = 1.5
MIRROR_SHARE = 0.999
"""Share of the weight that a mirror maps to its like, above which a shape counts as symmetric."""
MIN_TILT_DEGREES = 2
MIN_COLOR_SHARE = 0.995
RATIOS = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0)
MIN_RING_PARTS = 5


@dataclass(frozen=True)
class Fact:
    """One statement about a shape: its kind, and what it is about: nouns, numbers or words, as text."""

    kind: str
    about: tuple[str, ...] = ()


@dataclass(frozen=True)
class ShapeFacts:
    """A shape as facts are derived from it.

    nouns: noun of each part, empty for a part whose label has none
    boxes: world boxes of the parts, float64 (n, 2, 3)
    neighbours: parts that touch each part
    """

    shape: Shape
    nouns: tuple[str, ...]
    boxes: FloatArray
    neighbours: Sequence[frozenset[int]]
    physics: Mapping[str, Any]
    placement: ShapePlacement

    @classmethod
    def of(
        cls,
        shape: Shape,
        contacts: IntArray,
        physics: Mapping[str, Any],
        nouns: Mapping[str, str],
        placement: ShapePlacement,
    ) -> ShapeFacts:
        """Return a shape, y up, ready for facts.

        contacts: pairs of parts that touch, int32 (m, 2)
        physics: fields of the record
        nouns: noun of each label
        placement: what is known of its front, and of how it is placed
        """
        names = tuple(nouns.get(shape.labels[label], "") for label in shape.part_labels.tolist())
        touching: list[set[int]] = [set() for _ in names]
        for first, second in contacts.tolist():
            touching[first].add(second)
            touching[second].add(first)
        boxes = world_boxes(shape.meshes, shape.assembly.types, shape.assembly.poses)
        return cls(shape, names, boxes, tuple(map(frozenset, touching)), physics, placement)

    def parts(self, noun: str) -> list[int]:
        """Return the parts of a noun."""
        return [part for part, name in enumerate(self.nouns) if name == noun]

    @property
    def groups(self) -> Mapping[str, list[int]]:
        """The parts of each noun, those first that are largest seen from the front and from above."""
        x, y, z = np.ptp(self.boxes, axis=1).T
        extents = (
            x * y * (1.0 if self.placement.front_known else 0.5)
            + z * y * (0.0 if self.placement.front_known else 0.5)
            + x * z / 2
        )
        found = {noun: self.parts(noun) for noun in dict.fromkeys(filter(None, self.nouns))}
        return dict(sorted(found.items(), key=lambda item: (-round(float(extents[item[1]].sum()), 9), item[0])))

    @property
    def sides(self) -> FloatArray:
        """Width, height and depth of the shape, float64 (3,)."""
        sides: FloatArray = self.boxes[:, 1].max(axis=0) - self.boxes[:, 0].min(axis=0)
        return sides

    @property
    def tolerance(self) -> float:
        """Length that makes no difference."""
        return PLACE_TOLERANCE_SHARE * float(self.sides.max())


def facts_of(shape: ShapeFacts) -> list[Fact]:
    """Return the facts about a shape, grouped by kind, the most important of each kind first."""
    found = [Fact("count", (str(len(parts)), noun)) for noun, parts in shape.groups.items()]
    found.append(Fact("parts", (str(len(shape.shape)),)))
    found += _proportions(shape)
    for noun, parts in shape.groups.items():
        found += _arrangement(shape, noun, parts)
    found += _relations(shape)
    found += _colors(shape)
    return [*found, *_statics(shape)]


def _proportions(shape: ShapeFacts) -> Iterator[Fact]:
    width, height, depth = shape.sides.tolist()
    across = "wide" if shape.placement.front_known else "long"
    length = width if shape.placement.front_known else max(width, depth)
    if not min(length, height) > 0:
        return
    ratio = height / length
    if abs(ratio - 1) < RATIO_TOLERANCE:
        yield Fact("equal", (across,))
    for one, other, times in (("tall", across, ratio), (across, "tall", 1 / ratio)):
        about = RATIOS[int(np.abs(np.log(times / np.array(RATIOS))).argmin())]
        if abs(times / about - 1) < RATIO_TOLERANCE and about > 1:
            yield Fact("ratio", (one, other, f"{about:g}"))
        elif times > CLEAR_RATIO:
            yield Fact("longer", (one, other))
    if ratio > TALL_RATIO:
        yield Fact("adjective", ("tall",))
    if ratio < 1 / TALL_RATIO:
        yield Fact("adjective", ("low",))
    if shape.shape.unit == "metre":
        yield Fact("height", (f"{height:.2f}",))


def _arrangement(shape: ShapeFacts, noun: str, parts: Sequence[int]) -> Iterator[Fact]:
    """Yield how the parts of a noun are arranged: in columns, one above the other, in a row or in a circle."""
    if len(parts) < 2:
        return
    centres, near = shape.boxes[parts].mean(axis=1), shape.tolerance
    x, y, z = (_levels(centres[:, axis], near) for axis in range(3))
    for level, other in ((x, z), (z, x)):
        columns, rows = int(level.max()) + 1, int(y.max()) + 1
        cells = {(int(a), int(b)) for a, b in zip(level, y, strict=True)}
        if other.max() == 0 and min(columns, rows) > 1 and len(cells) == columns * rows == len(parts):
            yield Fact("grid", (str(len(parts)), noun, str(columns), str(rows)))
            return
    if x.max() == 0 and z.max() == 0:
        order = np.argsort(centres[:, 1])
        low, high = shape.boxes[parts][order, 0, 1], shape.boxes[parts][order, 1, 1]
        if (low[1:] >= high[:-1] - near / 4).all():
            yield Fact("stack", (str(len(parts)), noun))
        return
    if len(parts) < 3 or y.max() > 0:
        return
    if _in_a_row(centres[:, [0, 2]], near):
        yield Fact("row", (str(len(parts)), noun))
    elif len(parts) >= MIN_RING_PARTS and _in_a_circle(centres[:, [0, 2]], near):
        yield Fact("circle", (str(len(parts)), noun))


def _levels(values: FloatArray, near: float) -> np.ndarray:
    """Return the level of each value, from 0: the values of a level differ by less than `near`."""
    levels = np.zeros(len(values), dtype=np.int64)
    level, lowest = 0, float(values.min())
    for index in np.argsort(values, kind="stable").tolist():
        if values[index] - lowest >= near:
            level, lowest = level + 1, float(values[index])
        levels[index] = level
    return levels


def _in_a_row(points: FloatArray, near: float) -> bool:
    """Return whether points (n, 2) are on a line at equal steps."""
    axis = np.linalg.svd(points - points.mean(axis=0))[2]
    along, across = np.sort(points @ axis[0]), points @ axis[1]
    steps = np.diff(along)
    return bool(np.ptp(across) < near and np.ptp(steps) < near and steps.min() > 4 * near)


def _in_a_circle(points: FloatArray, near: float) -> bool:
    """Return whether points (n, 2) are on a circle at equal steps."""
    offsets = points - points.mean(axis=0)
    radii, angles = np.linalg.norm(offsets, axis=1), np.sort(np.arctan2(offsets[:, 1], offsets[:, 0]))
    steps = np.diff(np.concatenate([angles, angles[:1] + 2 * np.pi]))
    return bool(np.ptp(radii) < near and radii.min() > 4 * near and np.ptp(steps) * radii.max() < near)


def _relations(shape: ShapeFacts) -> Iterator[Fact]:
    groups, near = shape.groups, shape.tolerance
    ground = float(shape.boxes[:, 0, 1].min())
    lowest = [part for part in range(len(shape.nouns)) if shape.boxes[part, 0, 1] < ground + near]
    standing = {shape.nouns[part] for part in lowest}
    stands = shape.physics["stable"] and not shape.placement.hangs
    if stands and len(standing) == 1 and "" not in standing:
        noun = standing.pop()
        if len(lowest) == len(groups[noun]) and (shape.boxes[lowest, 0, 1] < ground + near / 4).all():
            yield Fact("stands on", (str(len(lowest)), noun))
    for noun, parts in groups.items():
        for other, others in groups.items():
            if noun == other or not any(shape.neighbours[part] & set(others) for part in parts):
                continue
            if shape.boxes[parts, 0, 1].min() >= shape.boxes[others, 1, 1].max() - near / 4:
                yield Fact("above", (str(len(parts)), noun, str(len(others)), other))
            elif len(parts) > 1 and all(shape.neighbours[part] & set(others) for part in parts):
                yield Fact("touches", (noun, str(len(others)), other))


def _colors(shape: ShapeFacts) -> Iterator[Fact]:
    found = {noun: _color_of(shape, parts) for noun, parts in shape.groups.items()}
    whole = _color_of(shape, range(len(shape.nouns)))
    if whole:
        yield Fact("all color", (whole,))
        return
    yield from (Fact("color", (str(len(shape.parts(noun))), noun, color)) for noun, color in found.items() if color)


def _color_of(shape: ShapeFacts, parts: Sequence[int]) -> str:
    """Return the name of the colour that all but a trace of some parts have, or nothing."""
    areas: dict[str, float] = {}
    for kind in shape.shape.assembly.types[list(parts)].tolist():
        mesh = shape.shape.meshes[kind]
        colors, color_of = np.unique(mesh.face_colors, axis=0, return_inverse=True)
        sums = np.bincount(color_of.reshape(-1), weights=triangle_areas(mesh.vertices[mesh.faces]))
        for color, area in zip(colors.tolist(), sums.tolist(), strict=True):
            name = color_name(color)
            areas[name] = areas.get(name, 0.0) + area
    name, area = max(areas.items(), key=lambda item: (item[1], item[0]))
    return name if area >= MIN_COLOR_SHARE * sum(areas.values()) else ""


def _statics(shape: ShapeFacts) -> Iterator[Fact]:
    physics = shape.physics
    if physics["symmetry"] > MIRROR_SHARE:
        yield Fact("mirror")
    if shape.placement.hangs:
        return
    if not physics["rooted"]:
        yield Fact("not rooted")
    yield Fact("stable" if physics["stable"] else "unstable")
    tilt = int(physics["tipping_degrees"])
    if physics["stable"] and tilt >= MIN_TILT_DEGREES and physics["tipping_degrees"] - tilt > 1e-3:
        yield Fact("tilt", (str(tilt),))
