"""All replacements between small graphs held against brute force, with figures.

python -m tests.stages.variations.substructures.oracle [--pairs 500] [--most 9]

Pairs of random graphs, of such whose types follow a pattern, and of crops of shipped kits and of real models, whose
graphs are in tests/data/shape_graphs.json. Pairs that fail are printed as they stand in tests/data/replacements.json,
a corpus that is tried in every run. `--build-graphs` builds the graphs of the models again, for half a minute.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from stages.exemplars.build import build_kit
from stages.exemplars.read import read_parts
from stages.exemplars.settings import STRICTEST, ContactConfig, KitConfig, ShapeFile
from stages.variations.substructures.docking_sites import docking_graph
from stages.variations.substructures.operations import find_operations
from stages.variations.substructures.ordered_graph import OrderedGraph, ordered_graph
from stages.variations.substructures.replacement import replace_piece
from tests.stages.variations.substructures import brute_force
from tests.stages.variations.substructures.graphs import code, crop, is_connected, patterned_graph, random_graph

CORPUS = Path("tests/data/replacements.json")
GRAPHS = Path("tests/data/shape_graphs.json")
SHIPPED = Path("datasets/exemplars")
SHIPPED_KITS = ("castle", "facade", "playground", "space-base", "temple")
"""Crops of their graphs need three operations in a row at most; one of a hub with eight leaves may need four."""
REAL = Path("../shared/exemplars")
REAL_MODELS = (
    "a01_castle_tower",
    "a08_ball_track",
    "a12_dungeon_room_large",
    "a13_dungeon_junction",
    "a17_temple_peripteros",
    "a20_bridge_side_span",
    "a22_ring_segment_10",
    "a25_dome",
    "a26_crossvault",
)
MAX_STEPS = 3

Code = tuple[tuple[int, ...], ...]


class Unlike(AssertionError):
    """Operations and brute force disagree."""


@dataclass(frozen=True)
class Figures:
    """Of one pair: listed operations, both ways within one graph; those with connected results that were held against
    brute force, and those that are no exchange of two connected pieces with one boundary cycle each, which brute force
    does not know; results of brute force, by how many operations in a row make them; and operations for each k n²."""

    listed: int
    held: int
    missed: int
    made_in: tuple[int, ...]
    per_k_n2: float


def made(base: OrderedGraph, giver: OrderedGraph, violations: int = 0) -> dict[Code, OrderedGraph]:
    """The connected results of all operations, both ways within one graph, by their codes; without the base."""
    operations = find_operations(base, giver, violations)
    found: dict[Code, OrderedGraph] = {}
    for number in range(len(operations)):
        boundary = operations.boundary(number)
        for turned in (boundary, boundary[:, ::-1]) if base is giver else (boundary,):
            result = replace_piece(base, giver, turned)
            if result is not None and is_connected(result.graph):
                found.setdefault(code(result.graph), result.graph)
    found.pop(code(base), None)
    return found


def composed(
    base: OrderedGraph, giver: OrderedGraph, wanted: set[Code], steps: int, violations: int = 0
) -> list[set[Code]]:
    """Those of the wanted codes that no sequence of 0, 1, ... or `steps` operations makes."""
    known = made(base, giver, violations)
    fresh, left = list(known.values()), [wanted, wanted - set(known)]
    while left[-1] and len(left) <= steps:
        later: dict[Code, OrderedGraph] = {}
        for graph in fresh:
            for other in {id(giver): giver, id(base): base}.values():
                later |= {key: entry for key, entry in made(graph, other, violations).items() if key not in known}
        known |= later
        fresh = list(later.values())
        left.append(left[-1] - set(later))
    return left


def judge(base: OrderedGraph, giver: OrderedGraph) -> Figures:
    """Hold all operations of two graphs against brute force. Raises Unlike.

    Which way round a part its neighbours are counted hangs on the part alone, so the walks round the inside and the
    outside of a piece may meet its cut edges in other orders: boundaries agree that do so in one of the two.
    """
    operations = find_operations(base, giver)
    degree = max(int(np.diff(entry.starts).max()) for entry in (base, giver))
    per_k_n2 = len(operations) / (degree * len(base.types) * len(giver.types))
    if per_k_n2 > 1:
        raise Unlike(f"{len(operations)} operations are more than k n²")
    seen = _edge_types(base) | _edge_types(giver)
    here = {frozenset(piece.cuts): piece for piece in brute_force.pieces(base)}
    there = here if base is giver else {frozenset(piece.cuts): piece for piece in brute_force.pieces(giver)}
    held = missed = 0
    ways = [operations.boundary(number) for number in range(len(operations))]
    ways += [entry[:, ::-1] for entry in ways] if base is giver else []
    for boundary in ways:
        result = replace_piece(base, giver, boundary)
        if result is None or not is_connected(result.graph):
            continue
        if not _edge_types(result.graph) <= seen:
            raise Unlike(f"{boundary.tolist()} makes an edge that neither graph has")
        piece, other = here.get(_cuts(base, boundary[:, 0])), there.get(_cuts(giver, boundary[:, 1]))
        if piece is None or other is None:
            missed += 1
            continue
        outer, outer_there = brute_force.round_outside(piece), brute_force.round_outside(other)
        key = code(result.graph)
        if key in _replacements(base, giver, piece, other):
            held += 1
        elif outer is None or outer_there is None:
            missed += 1
        elif key in _replacements(base, giver, outer, outer_there):
            held += 1
        else:
            raise Unlike(f"{boundary.tolist()} makes what brute force does not")
    wanted = brute_force.results(base, giver, same_outside=True) - {code(base)}
    left = composed(base, giver, wanted, MAX_STEPS)
    if left[-1]:
        raise Unlike(f"{len(left[-1])} of {len(wanted)} results of brute force are no composition of operations")
    counts = [len(entry) for entry in left] + [0] * (MAX_STEPS + 1 - len(left))
    return Figures(len(ways), held, missed, tuple((-np.diff(counts)).tolist()), per_k_n2)


def _cuts(graph: OrderedGraph, darts: np.ndarray) -> frozenset[brute_force.Cut]:
    """The cut edges that darts point along into a piece."""
    return frozenset(zip(graph.tails[graph.twins[darts]].tolist(), graph.tails[darts].tolist(), strict=True))


def _edge_types(graph: OrderedGraph) -> set[tuple[int, ...]]:
    return {tuple(sorted(pair)) for pair in graph.types[graph.edges()].tolist()}


def _replacements(
    base: OrderedGraph, giver: OrderedGraph, piece: brute_force.Piece, other: brute_force.Piece
) -> Iterator[Code]:
    """The codes of all that comes of two pieces whose boundaries agree."""
    for turn in range(len(piece.cuts)) if len(piece.cuts) == len(other.cuts) else ():
        if brute_force.matches(base, giver, piece, other, turn, same_outside=False):
            result = brute_force.replaced(base, giver, piece, other, turn)
            if result is not None:
                yield code(result)


def pair_of(seed: int, most: int) -> tuple[str, OrderedGraph, OrderedGraph]:
    """What a pair is of, and two graphs of at most `most` nodes, which in half of the cases are one."""
    rng = np.random.default_rng(seed)
    kind = seed % 4
    if kind < 2:
        name, draw = (("random", random_graph), ("patterned", patterned_graph))[kind]
        base = draw(rng, most)
        return name, base, base if rng.random() < 0.5 else draw(rng, most)
    origin = ("shipped", "real")[kind - 2]
    wholes = shape_graphs(origin)
    whole = wholes[int(rng.integers(len(wholes)))]
    base = crop(rng, whole, most)
    return origin, base, base if rng.random() < 0.5 else crop(rng, whole, most)


@cache
def shape_graphs(origin: str) -> list[OrderedGraph]:
    """Return the shape graphs of models from an origin, `shipped` or `real`."""
    graphs = json.loads(GRAPHS.read_text(encoding="utf-8"))[origin]
    return [ordered_graph(types, orders) for types, orders in graphs.values()]


def build_graphs() -> None:
    """Write the shape graphs of the models, which must be next to the project."""
    shipped = [path for kit in SHIPPED_KITS for path in sorted((SHIPPED / kit).glob("*.glb"))]
    origins = {"shipped": shipped, "real": [REAL / name / "model.glb" for name in REAL_MODELS]}
    built = {
        origin: {f"{path.parent.name}/{path.stem}": _rows(_shape_graph(path)) for path in paths}
        for origin, paths in origins.items()
    }
    text = json.dumps(built, separators=(",", ":")).replace(']]],"', ']]],\n"')  # a line for each graph
    GRAPHS.write_text(text + "\n", encoding="utf-8")


def _shape_graph(path: Path) -> OrderedGraph:
    contact = ContactConfig(kinds=("point", "line", "face"))
    config = KitConfig(name="oracle", shapes=(ShapeFile(path=path),), contact=contact)
    kit, _ = build_kit(config.resolve(STRICTEST), [read_parts(path)])
    whole = kit.exemplars[0].assembly
    return docking_graph(kit, whole, np.zeros_like(whole.edges))


def corpus() -> list[tuple[str, OrderedGraph, OrderedGraph]]:
    """The kept pairs, with what each has shown; of one graph, which is both, it stands there once."""
    pairs = []
    for kept in json.loads(CORPUS.read_text(encoding="utf-8")):
        graphs = [ordered_graph(types, orders) for types, orders in kept["graphs"]]
        pairs.append((kept["why"], graphs[0], graphs[-1]))
    return pairs


def described(base: OrderedGraph, giver: OrderedGraph) -> str:
    """A pair as it stands in the corpus."""
    return json.dumps([_rows(graph) for graph in ([base] if base is giver else [base, giver])])


def _rows(graph: OrderedGraph) -> list[list[object]]:
    """The types of a graph's nodes and the neighbours of each in order, as they stand in files."""
    return [graph.types.tolist(), [graph.neighbours(node) for node in range(len(graph.types))]]


def main() -> None:
    """Judge pairs and print figures; the exit status is 1 where one fails."""
    parser = argparse.ArgumentParser(prog="python -m tests.stages.variations.substructures.oracle")
    parser.add_argument("--pairs", type=int, default=500)
    parser.add_argument("--most", type=int, default=9, help="most nodes of a graph")
    parser.add_argument("--seed", type=int, default=0, help="that of the first pair")
    parser.add_argument("--build-graphs", action="store_true", help="write the graphs of the models")
    asked = parser.parse_args()
    if asked.build_graphs:
        build_graphs()
    totals: dict[str, Counter[str]] = {}
    greatest, failed, start = 0.0, 0, time.process_time()
    for seed in range(asked.seed, asked.seed + asked.pairs):
        name, base, giver = pair_of(seed, asked.most)
        total = totals.setdefault(name, Counter())
        try:
            figures = judge(base, giver)
        except Unlike as unlike:
            failed += 1
            print(f"{seed}: {unlike}: {described(base, giver)}")
            continue
        greatest = max(greatest, figures.per_k_n2)
        total.update({"pairs": 1, "operations": figures.listed, "held": figures.held, "missed": figures.missed})
        total.update({f"made in {steps}": count for steps, count in enumerate(figures.made_in, 1)})
    for name, total in totals.items():
        print(f"{name}: {dict(total)}")
    took = time.process_time() - start
    print(f"all: {dict(sum(totals.values(), Counter()))}; at most {greatest:.2f} k n² operations; {took:.0f} CPU s")
    raise SystemExit(failed > 0)


if __name__ == "__main__":
    main()
