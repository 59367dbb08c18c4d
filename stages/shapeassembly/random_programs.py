"""Random ShapeAssembly programs: hierarchies of plates, posts, layers, rows and shelves, and the shards that draw them.

Each assembly follows one of four schemes, chosen at random. Sizes are uniform shares of its bounding box, whose own are
log-uniform. A cuboid that is large enough may become an assembly itself.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from pipeline.errors import Rejected, ShardFailed
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Shard, Task
from stages.shapeassembly.settings import RandomPrograms, ShapeAssemblyConfig
from stages.shapeassembly.syntax.errors import ProgramError
from stages.shapeassembly.syntax.printer import print_program
from stages.shapeassembly.syntax.program import (
    BBOX,
    AssemblyProgram,
    Attach,
    Axis,
    Block,
    Cuboid,
    Line,
    Point,
    Reflect,
    Squeeze,
    Translate,
)

PROGRAMS_PER_SHARD = 64
MAX_TRIES_PER_PROGRAM = 100
MIN_BBOX_SIDE, MAX_BBOX_SIDE = 0.4, 1.6
MIN_EXPANDED_SIZE = 0.07
"""Shortest side of a cuboid that may become an assembly."""
MIN_SIDE = 0.012
NUMBER_DIGITS = 4


def random_program(config: RandomPrograms, rng: np.random.Generator) -> AssemblyProgram:
    """Return a random program that keeps the rules; its shape may reach out of the bounding box or fall over."""
    drawing = _Drawing(config, rng)
    width, height, depth = np.exp(rng.uniform(np.log(MIN_BBOX_SIDE), np.log(MAX_BBOX_SIDE), 3)).tolist()
    drawing.fill("Shape", (width, height, depth), 1)
    return AssemblyProgram(tuple(drawing.blocks))


class _Drawing:
    """The assemblies of one program while they are drawn, the root first."""

    def __init__(self, config: RandomPrograms, rng: np.random.Generator) -> None:
        self.blocks: list[Block] = []
        self._config = config
        self._rng = rng
        self._names: Counter[str] = Counter()

    def fill(self, name: str, dims: Point, level: int) -> None:
        """Draw an assembly of some size, and those of its cuboids."""
        schemes: tuple[Callable[[_Assembly], None], ...] = (_plates_and_posts, _layers, _row, _shelves)
        assembly = _Assembly(dims, self._rng, lambda role, size: self._expanded(role, size, level))
        schemes[int(self._rng.integers(len(schemes)))](assembly)
        place = len(self.blocks)
        self.blocks.append(Block(name, Cuboid(BBOX, _rounded(dims), True), tuple(assembly.lines())))
        for own, size in assembly.expanded.items():
            self.fill(own, size, level + 1)
        assert self.blocks[place].name == name

    def _expanded(self, role: str, dims: Point, level: int) -> str:
        """Return the name of the assembly that a cuboid becomes, or nothing."""
        large = min(dims) >= MIN_EXPANDED_SIZE
        if not large or level >= self._config.max_levels or self._rng.random() >= self._config.expanded:
            return ""
        self._names[role] += 1
        return role.capitalize() + (f"_{self._names[role]}" if self._names[role] > 1 else "")


class _Assembly:
    """Lines of an assembly that a scheme adds, in the order that the language asks for."""

    def __init__(self, dims: Point, rng: np.random.Generator, expand: Callable[[str, Point], str]) -> None:
        self.dims = dims
        self.rng = rng
        self.expanded: dict[str, Point] = {}
        self._expand = expand
        self._cuboids: list[Cuboid] = []
        self._joins: list[Line] = []
        self._copies: list[Line] = []

    def share(self, low: float, high: float) -> float:
        """Return a random share."""
        return float(self.rng.uniform(low, high))

    def cuboid(self, role: str, dims: Sequence[float], expandable: bool = False) -> str:
        """Declare a cuboid; return its name, that of an assembly if it becomes one."""
        width, height, depth = (max(float(side), MIN_SIDE) for side in dims)
        name = (self._expand(role, (width, height, depth)) if expandable else "") or role
        if name != role:
            self.expanded[name] = (width, height, depth)
        self._cuboids.append(Cuboid(name, _rounded((width, height, depth)), True))
        return name

    def attach(self, moved: str, target: str, source: Sequence[float], goal: Sequence[float]) -> None:
        """Attach a point of a cuboid to a point of another."""
        self._joins.append(Attach(moved, target, _rounded(source), _rounded(goal)))

    def squeeze(self, moved: str, above: str, below: str, u: float, v: float) -> None:
        """Put a cuboid between one above and one below it."""
        self._joins.append(Squeeze(moved, above, below, "top", round(u, NUMBER_DIGITS), round(v, NUMBER_DIGITS)))

    def reflect(self, moved: str, axis: Axis) -> None:
        """Mirror a cuboid."""
        self._copies.append(Reflect(moved, axis))

    def translate(self, moved: str, axis: Axis, copies: int, distance: float) -> None:
        """Repeat a cuboid."""
        self._copies.append(Translate(moved, axis, copies, round(distance, NUMBER_DIGITS)))

    def lines(self) -> Iterator[Line]:
        """Yield the lines."""
        yield from (*self._cuboids, *self._joins, *self._copies)


def _rounded(numbers: Sequence[float]) -> Point:
    x, y, z = (round(float(number), NUMBER_DIGITS) for number in numbers)
    return x, y, z


def _plates_and_posts(assembly: _Assembly) -> None:
    """A plate on posts: one in the middle, two or three pairs, or walls; sometimes with a base."""
    width, height, depth = assembly.dims
    thickness = height * assembly.share(0.05, 0.2)
    plate = assembly.cuboid("plate", (width, thickness, depth), expandable=True)
    assembly.attach(plate, BBOX, (0.5, 1, 0.5), (0.5, 1, 0.5))
    below, rest = BBOX, height - thickness
    if assembly.rng.random() < 0.4:
        foot = height * assembly.share(0.04, 0.2)
        below, rest = assembly.cuboid("base", (width, foot, depth), expandable=True), rest - foot
        assembly.attach(below, BBOX, (0.5, 0, 0.5), (0.5, 0, 0.5))
    way = assembly.rng.integers(3)
    if way == 0:
        size = assembly.share(0.25, 0.6)
        post = assembly.cuboid("core", (width * size, rest, depth * size), expandable=True)
        assembly.squeeze(post, plate, below, 0.5, 0.5)
    elif way == 1:
        side = width * assembly.share(0.04, 0.15)
        wall = assembly.cuboid("wall", (side, rest, depth), expandable=True)
        assembly.squeeze(wall, plate, below, side / width / 2 + assembly.share(0, 0.15), 0.5)
        assembly.reflect(wall, "X")
    else:
        side = min(width, depth) * assembly.share(0.05, 0.15)
        u = side / width / 2 + assembly.share(0, 0.1)
        rows = ["front_post", "back_post", "middle_post"][: 2 + int(assembly.rng.integers(2))]
        v = side / depth / 2
        for role, place in zip(rows, (1 - v, v, 0.5), strict=False):
            post = assembly.cuboid(role, (side, rest, side))
            assembly.squeeze(post, plate, below, u, place)
            assembly.reflect(post, "X")


def _layers(assembly: _Assembly) -> None:
    """Layers on each other, some of them with a pair of wings."""
    width, height, depth = assembly.dims
    count = int(assembly.rng.integers(2, 5))
    heights = height * assembly.rng.dirichlet(np.full(count, 3.0))
    under = ""
    for number, tall in enumerate(heights.tolist()):
        wide, deep = assembly.share(0.35, 1), assembly.share(0.35, 1)
        layer = assembly.cuboid(f"layer{number + 1}", (width * wide, tall, depth * deep), expandable=True)
        if under:
            assembly.attach(layer, under, (0.5, 0, 0.5), (0.5, 1, assembly.share(0.42, 0.58)))
        else:
            assembly.attach(layer, BBOX, (0.5, 0, 0.5), (0.5, 0, 0.5))
        under, wing = layer, width * (1 - wide) / 2
        if wing > 0.05 * width and assembly.rng.random() < 0.4:
            name = assembly.cuboid(
                f"wing{number + 1}", (wing * assembly.share(0.5, 1), tall * assembly.share(0.3, 1), depth * deep)
            )
            assembly.attach(name, layer, (1, 0.5, 0.5), (0, 0.5, 0.5))
            assembly.reflect(name, "X")


def _row(assembly: _Assembly) -> None:
    """Equal slabs in a row on a base, sometimes under a plate."""
    width, height, depth = assembly.dims
    foot = height * assembly.share(0.04, 0.2)
    base = assembly.cuboid("base", (width, foot, depth), expandable=True)
    assembly.attach(base, BBOX, (0.5, 0, 0.5), (0.5, 0, 0.5))
    above, rest = BBOX, height - foot
    if assembly.rng.random() < 0.5:
        thickness = height * assembly.share(0.04, 0.15)
        above, rest = assembly.cuboid("plate", (width, thickness, depth), expandable=True), rest - thickness
        assembly.attach(above, BBOX, (0.5, 1, 0.5), (0.5, 1, 0.5))
    copies = int(assembly.rng.integers(1, 7))
    axis: Axis = "X" if width >= depth else "Z"
    thick, across = assembly.share(0.3, 0.9) / (copies + 1), assembly.share(0.3, 1)
    sides = (width * thick, rest, depth * across) if axis == "X" else (width * across, rest, depth * thick)
    slab = assembly.cuboid("slab", sides, expandable=True)
    start = thick / 2
    assembly.squeeze(slab, above, base, *((start, 0.5) if axis == "X" else (0.5, start)))
    assembly.translate(slab, axis, copies, 1 - 2 * start)


def _shelves(assembly: _Assembly) -> None:
    """Shelves between two sides, with a rear or without."""
    width, height, depth = assembly.dims
    side, thickness = width * assembly.share(0.03, 0.12), height * assembly.share(0.02, 0.08)
    wall = assembly.cuboid("side", (side, height, depth))
    assembly.squeeze(wall, BBOX, BBOX, side / width / 2, 0.5)
    inner, low = width - 2 * side, thickness / height / 2
    copies = int(assembly.rng.integers(1, 6))
    if assembly.rng.random() < 0.5:
        rear = depth * assembly.share(0.02, 0.1)
        back = assembly.cuboid("rear", (inner, height, rear))
        assembly.attach(back, wall, (0, 0.5, 0), (1, 0.5, 0))
        shelf = assembly.cuboid("shelf", (inner, thickness, depth - rear))
        assembly.attach(shelf, back, (0.5, 0.5, 0), (0.5, low, 1))
    else:
        shelf = assembly.cuboid("shelf", (inner, thickness, depth))
        assembly.attach(shelf, wall, (0, 0.5, 0.5), (1, low, 0.5))
    assembly.reflect(wall, "X")
    assembly.translate(shelf, "Y", copies, 1 - 2 * low)


def random_shards(dataset: str, sources: Sequence[RandomPrograms]) -> list[Shard]:
    """Return the shards that draw programs, `<dataset>-random-<number>`."""
    shards: list[Shard] = []
    for entry, source in enumerate(sources):
        for first in range(0, source.samples, PROGRAMS_PER_SHARD):
            count = min(PROGRAMS_PER_SHARD, source.samples - first)
            params = {"job": "random", "entry": entry, "first": first, "count": count}
            shards.append(Shard(f"{dataset}-random-{len(shards):06d}", params))
    return shards


def run_random(task: Task) -> Outcome:
    """Write `.jsonl`: category, name and text of programs that the config accepts and that stand, if they must.

    Raises ShardFailed where too many tries in a row are refused.
    """
    from stages.shapeassembly.acceptance import accepted_text

    config, params = task.config.section(ShapeAssemblyConfig), task.shard.params
    source = config.random[params["entry"]]
    require = config.require.model_copy(update={"stable": config.require.stable or source.stable})
    refused: Counter[str] = Counter()
    with task.output(f"{task.shard.name}.jsonl") as stream:
        for number in range(params["first"], params["first"] + params["count"]):
            rng = task.rng(number)
            for _ in range(MAX_TRIES_PER_PROGRAM):
                try:
                    text = accepted_text(print_program(random_program(source, rng)), config, require)
                    break
                except (ProgramError, Rejected) as error:
                    refused[error.reason] += 1
            else:
                reasons = ", ".join(f"{count:,} {reason}" for reason, count in refused.most_common(3))
                raise ShardFailed(f"{MAX_TRIES_PER_PROGRAM} random programs in a row were refused: {reasons}")
            stream.write(json_bytes({"kit": source.name, "name": f"random/{number:06d}", "text": text}))
            task.progress(number + 1 - params["first"], params["count"])
    for reason, count in sorted(refused.items()):
        task.reject(source.name, reason, count=count)
    return Outcome(0, {"programs": params["count"]})
