"""Growth of a collection of shapes and strings during a search, round by round (strings Table 1)."""

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
    "Shapes, distinct graphs and strings after each iteration, which is one round of the search. Its parents come from "
    "earlier rounds and from the round itself. Strings: up to as many of each distinct graph as the config asks for. "
    "Deepest: the greatest generation so far. A shape is one generation above its parents; inputs are generation 0.",
    "The values of strings Table 1 are not in the text of the paper that we have, so there are no reference rows.",
)


@dataclass(frozen=True)
class KeptVariant:
    """A variant that the search kept."""

    round: int
    """Counted from 1."""
    generation: int
    """1 for a variant of inputs alone."""
    graph: bytes
    """Digest of its shape graph, 32 bytes."""
    found: FoundVariants
    """The variants of the search worker that found it."""
    index: int
    """Among these."""

    @property
    def assembly(self) -> Assembly:
        """The variant; its types are those of the kit."""
        return self.found.assembly(self.index)[0]


@dataclass(frozen=True)
class CollectionSize:
    """The size of a collection."""

    shapes: int
    graphs: int
    strings: int
    deepest: int


@dataclass(frozen=True)
class SearchGrowth:
    """The growth of one search."""

    triangles: int
    """Of its inputs."""
    parts: int
    """Of its inputs."""
    inputs: CollectionSize
    tries: Sequence[int]
    """Cumulative, by round."""
    rounds: Mapping[int, CollectionSize]
    """The collection after each round."""
    generations: Mapping[int, CollectionSize]
    """The collection up to each generation."""
    variants: Sequence[KeptVariant]


def read_kept_variants(folder: Path, kit: str) -> list[KeptVariant]:
    """Read the variants that the search of a kit kept, in order, from the folder of stage `variations`."""
    depths: dict[str, int] = {}
    variants: list[KeptVariant] = []
    pools = sorted(path.name for path in folder.glob(f"{kit}-r*-pool.kept.npy"))
    for number, pool in enumerate(pools, 1):
        stem = pool.removesuffix("pool.kept.npy")
        names = sorted(path.name.removesuffix(".keys.npy") for path in folder.glob(f"{stem}lane*.keys.npy"))
        workers = [_read_worker(folder, name) for name in names]
        for found in workers:
            for index in range(len(found)):
                parents = found.described(index)["parents"]
                depths[f"{found.name}-{index}"] = 1 + max((depths.get(parent, 0) for parent in parents), default=0)
        for worker, index in np.load(folder / pool, allow_pickle=False).tolist():
            found = workers[worker]
            depth = depths[f"{found.name}-{index}"]
            variants.append(KeptVariant(number, depth, bytes(found.digests[index, 0]), found, index))
    return variants


def _read_worker(folder: Path, name: str) -> FoundVariants:
    members = [field.name for field in fields(FoundVariants) if field.name not in ("name", "lineage_path")]
    arrays = {member: np.load(folder / f"{name}.{member}.npy", allow_pickle=False) for member in members}
    return FoundVariants(name, lineage_path=folder / f"{name}.lineage.jsonl", **arrays)


def sizes_by(
    variants: Iterable[KeptVariant], step: Callable[[KeptVariant], int], strings: Mapping[bytes, int]
) -> dict[int, CollectionSize]:
    """Return the size of the collection after each step. `strings`: their number by graph."""
    by_step: dict[int, list[KeptVariant]] = {}
    for variant in variants:
        by_step.setdefault(step(variant), []).append(variant)
    known: set[bytes] = set()
    num_shapes = num_strings = deepest = 0
    sizes = {}
    for number in sorted(by_step):
        for variant in by_step[number]:
            num_shapes, deepest = num_shapes + 1, max(deepest, variant.generation)
            if variant.graph not in known:
                known.add(variant.graph)
                num_strings += strings[variant.graph]
        sizes[number] = CollectionSize(num_shapes, len(known), num_strings, deepest)
    return sizes


def measure_growth(kit: Kit, folder: Path, config: StringsConfig, seed: int) -> SearchGrowth:
    """Measure the search of a kit, read from the folder of stage `variations`."""
    variants, writer = read_kept_variants(folder, kit.name), KitStrings(kit, config.edges)

    def count_strings(assembly: Assembly, name: str) -> int:
        rng = decision_rng(seed, "growth", kit.name, name)
        try:
            return len(writer.strings(writer.graph(assembly), config.strings_per_shape, rng))
        except NotConnectedError:
            return 0

    last_of_graph = {variant.graph: variant for variant in variants}
    strings = {graph: count_strings(variant.assembly, graph.hex()) for graph, variant in last_of_graph.items()}
    wholes = [exemplar.whole for exemplar in kit.exemplars]
    assemblies = [exemplar.assembly for exemplar in kit.exemplars]
    graphs = {graph_digest(kit.label_of[assembly.types], assembly.edges) for assembly in assemblies}
    num_strings = sum(count_strings(exemplar.assembly, exemplar.name) for exemplar in kit.exemplars)
    last = read_record(max((folder / "records").glob(f"{kit.name}-r*-pool.json")))
    return SearchGrowth(
        triangles=sum(len(kit.types[kind].faces) for whole in wholes for kind in whole.types.tolist()),
        parts=sum(map(len, wholes)),
        inputs=CollectionSize(len(wholes), len(graphs), num_strings, 0),
        tries=[tries for tries, *_ in last.summary["curve"]] if last else [],
        rounds=sizes_by(variants, lambda variant: variant.round, strings),
        generations=sizes_by(variants, lambda variant: variant.generation, strings),
        variants=variants,
    )


def growth_table(kits: Mapping[str, SearchGrowth]) -> Table:
    """Return one row for the inputs of each kit, and one for each round of its search."""
    rows: list[tuple[Cell, ...]] = []
    for kit, growth in kits.items():
        rows.append((f"{kit}, inputs", growth.triangles, growth.parts, "", *_cells(growth.inputs)))
        for number, size in growth.rounds.items():
            rows.append((f"{kit}, iteration {number}", "", "", growth.tries[number - 1], *_cells(size)))
    columns = ("collection", "triangles", "parts", "tries", "shapes", "graphs", "strings", "deepest")
    return Table("Growth by iteration", columns, tuple(rows), NOTES)


def generation_table(kits: Mapping[str, SearchGrowth]) -> Table:
    """Return one row for each generation: graphs and strings of each kit up to it, empty if the kit has no such one."""
    columns = [f"{kit} {quantity}" for kit in kits for quantity in ("graphs", "strings")]
    rows: list[tuple[Cell, ...]] = []
    for number in sorted({number for growth in kits.values() for number in growth.generations}):
        sizes = [growth.generations.get(number) for growth in kits.values()]
        cells = [cell for size in sizes for cell in ((size.graphs, size.strings) if size else ("", ""))]
        rows.append((f"generation {number}", *cells))
    return Table("Growth by generation", ("collection up to", *columns), tuple(rows))


def _cells(size: CollectionSize) -> tuple[Cell, ...]:
    return size.shapes, size.graphs, size.strings, size.deepest
