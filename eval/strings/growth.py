"""How a search grows a collection of shapes and strings out of its inputs, iteration by iteration (strings Table 1)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from eval.engine.table import Cell, Table
from pipeline.randomness import decision_rng
from pipeline.records import read_record
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit import Assembly, Kit
from stages.strings.encoder import NotConnectedError
from stages.strings.kit_strings import KitStrings
from stages.strings.settings import StringsConfig
from stages.variations.search.pool import FoundVariants

NOTES = (
    "Shapes, distinct graphs and strings after each iteration: a round of the search, with parents from what "
    "earlier rounds have found, and from its own. Strings: as many of each distinct graph as the config asks for. "
    "Deepest: the greatest generation so far; a shape is one generation above its parents, inputs are generation 0.",
    "The figures of strings Table 1 are not in the text of the paper that we have: none stand beside ours.",
)


@dataclass(frozen=True)
class Find:
    """A variant that a search has kept. round: counted from 1; generation: 1 of what was made of inputs alone;
    graph: digest of its shape graph, 32 bytes; lane, index: where the search wrote it."""

    round: int
    generation: int
    graph: bytes
    lane: FoundVariants
    index: int

    @property
    def assembly(self) -> Assembly:
        """The variant itself, its types being those of the kit."""
        return self.lane.assembly(self.index)[0]


@dataclass(frozen=True)
class Size:
    """How large a collection is."""

    shapes: int
    graphs: int
    strings: int
    deepest: int


@dataclass(frozen=True)
class Grown:
    """One search. triangles, parts: of its inputs; tries: so far, after each round; rounds, generations: the size of
    the collection after each."""

    triangles: int
    parts: int
    inputs: Size
    tries: Sequence[int]
    rounds: Mapping[int, Size]
    generations: Mapping[int, Size]
    finds: Sequence[Find]


def read_finds(folder: Path, kit: str) -> list[Find]:
    """What the search of a kit has kept, in order, read from the folder of stage `variations`."""
    depths: dict[str, int] = {}
    finds: list[Find] = []
    pools = sorted(path.name for path in folder.glob(f"{kit}-r*-pool.kept.npy"))
    for number, pool in enumerate(pools):
        stem = pool.removesuffix("pool.kept.npy")
        names = sorted(path.name.removesuffix(".keys.npy") for path in folder.glob(f"{stem}lane*.keys.npy"))
        lanes = [_lane(folder, name) for name in names]
        for lane in lanes:
            for index in range(len(lane)):
                parents = lane.described(index)["parents"]
                depths[f"{lane.name}-{index}"] = 1 + max((depths.get(parent, 0) for parent in parents), default=0)
        for place, index in np.load(folder / pool, allow_pickle=False).tolist():
            lane = lanes[place]
            depth = depths[f"{lane.name}-{index}"]
            finds.append(Find(number + 1, depth, bytes(lane.digests[index, 0]), lane, index))
    return finds


def sizes_by(finds: Iterable[Find], step: Callable[[Find], int], strings: Mapping[bytes, int]) -> dict[int, Size]:
    """The size of the collection after each step, `step` being that in which a find comes; strings: of each graph."""
    by_step: dict[int, list[Find]] = {}
    for each in finds:
        by_step.setdefault(step(each), []).append(each)
    known: set[bytes] = set()
    shapes = written = deepest = 0
    sizes = {}
    for number in sorted(by_step):
        for each in by_step[number]:
            shapes, deepest = shapes + 1, max(deepest, each.generation)
            if each.graph not in known:
                known.add(each.graph)
                written += strings[each.graph]
        sizes[number] = Size(shapes, len(known), written, deepest)
    return sizes


def grown(kit: Kit, folder: Path, config: StringsConfig, seed: int) -> Grown:
    """How the search of `kit` has grown, read from the folder of stage `variations`; `config` says which strings shapes
    get, and how many."""
    finds, writer = read_finds(folder, kit.name), KitStrings(kit, config.edges)

    def strings(assembly: Assembly, name: str) -> int:
        rng = decision_rng(seed, "growth", kit.name, name)
        try:
            return len(writer.strings(writer.graph(assembly), config.strings_per_shape, rng))
        except NotConnectedError:
            return 0

    written = {each.graph: strings(each.assembly, each.graph.hex()) for each in {f.graph: f for f in finds}.values()}
    wholes = [each.whole for each in kit.exemplars]
    graphs = {graph_digest(kit.label_of[each.assembly.types], each.assembly.edges) for each in kit.exemplars}
    last = read_record(max((folder / "records").glob(f"{kit.name}-r*-pool.json")))
    return Grown(
        triangles=sum(len(kit.types[kind].faces) for whole in wholes for kind in whole.types.tolist()),
        parts=sum(map(len, wholes)),
        inputs=Size(len(wholes), len(graphs), sum(strings(each.assembly, each.name) for each in kit.exemplars), 0),
        tries=[tries for tries, *_ in last.summary["curve"]] if last else [],
        rounds=sizes_by(finds, lambda find: find.round, written),
        generations=sizes_by(finds, lambda find: find.generation, written),
        finds=finds,
    )


def growth_table(kits: Mapping[str, Grown]) -> Table:
    """For each kit a row for its inputs and one after each round of its search."""
    rows: list[tuple[Cell, ...]] = []
    for kit, each in kits.items():
        rows.append((f"{kit}, inputs", each.triangles, each.parts, "", *_cells(each.inputs)))
        for number, size in each.rounds.items():
            rows.append((f"{kit}, iteration {number}", "", "", each.tries[number - 1], *_cells(size)))
    columns = ("collection", "triangles", "parts", "tries", "shapes", "graphs", "strings", "deepest")
    return Table("Growth by iteration", columns, tuple(rows), NOTES)


def generation_table(kits: Mapping[str, Grown]) -> Table:
    """A row for each generation: graphs and strings of each kit's collection without later ones; no figures where a kit
    has no such generation."""
    columns = [f"{kit} {what}" for kit in kits for what in ("graphs", "strings")]
    rows: list[tuple[Cell, ...]] = []
    for number in sorted({number for each in kits.values() for number in each.generations}):
        sizes = [each.generations.get(number) for each in kits.values()]
        cells = [cell for size in sizes for cell in ((size.graphs, size.strings) if size else ("", ""))]
        rows.append((f"generation {number}", *cells))
    return Table("Growth by generation", ("collection up to", *columns), tuple(rows))


def _cells(size: Size) -> tuple[Cell, ...]:
    return size.shapes, size.graphs, size.strings, size.deepest


def _lane(folder: Path, name: str) -> FoundVariants:
    members = [each.name for each in fields(FoundVariants) if each.name not in ("name", "lineage_path")]
    arrays = {each: np.load(folder / f"{name}.{each}.npy", allow_pickle=False) for each in members}
    return FoundVariants(name, lineage_path=folder / f"{name}.lineage.jsonl", **arrays)
