"""How many graphs become shapes, what each step of the way is worth, and how many tries it takes (strings §6)."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np

from eval.engine.dataset_run import DatasetRun
from eval.engine.models import TrainedModel, trained_models
from eval.engine.table import Cell, ReferenceRow, Table
from pipeline.randomness import decision_rng
from stages.shape.assembly_faults import assembly_faults
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit import Assembly, Kit
from stages.string_sampling.instantiation.guidance import WITHOUT_GUIDE, Guide, guide_of
from stages.string_sampling.instantiation.instantiate import Instantiator
from stages.string_sampling.instantiation.state import STANDARD_METHOD, SolverMethod
from stages.strings.alphabet import Alphabet
from stages.strings.decoder import Decoded, decode
from stages.training.checkpoint import read_header, weights_of_kind
from stages.training.edge_categories.trained import TrainedEdgeCategories, load_edge_categories
from stages.variations.settings import VariationsConfig

DRAWS = 4
"""So many strings are drawn from a model for each graph that is wanted of it."""

METHODS: Mapping[str, SolverMethod] = {
    "all steps": STANDARD_METHOD,
    "without looking ahead to where cycles close": STANDARD_METHOD._replace(closes=False),
    "without the most constrained part first": STANDARD_METHOD._replace(constrained=False),
    "without steps back": STANDARD_METHOD._replace(backtracks=False),
    "parts in random order, begun anew at dead ends (§6)": SolverMethod(
        constrained=False, backtracks=False, closes=False
    ),
    "random dockings, no check until the end (figure 8)": SolverMethod(
        checked=False, constrained=False, backtracks=False, closes=False
    ),
}
"""The ways that are compared: ours, ours without each step beyond the paper, and theirs."""

PUBLISHED = (
    ReferenceRow("one shape of 14 uncertain dockings, at random", "strings fig. 8", {"shapes %": 100 / 5**14}),
)

RANKS = {"trees %": (0, 0), "1-2 cycles %": (1, 2), "3-5 %": (3, 5), "6+ %": (6, 1 << 30)}
SIZES = {"to 30 parts %": (1, 30), "31-60 %": (31, 60), "61+ %": (61, 1 << 30)}


@dataclass(frozen=True)
class Attempt:
    """One graph, put together or not. reason: why not, or nothing; faults: what is wrong with the shape by its meshes;
    tries: parts that were put down; seconds: without the look at the meshes."""

    parts: int
    rank: int
    assembly: Assembly | None
    reason: str
    faults: int
    tries: int
    seconds: float

    @property
    def good(self) -> bool:
        """Whether it has become a shape that is valid by its meshes."""
        return self.assembly is not None and not self.faults


def distinct_graphs(
    strings: Iterable[str], alphabet: Alphabet, most: int, known: set[str] | None = None
) -> list[Decoded]:
    """The first `most` strings of different graphs, none of them `known` by its digest, decoded."""
    seen, found = set(known or ()), []
    for string in strings:
        decoded = decode(string, alphabet)
        digest = graph_digest(decoded.types, decoded.edges)
        if digest not in seen:
            seen.add(digest)
            found.append(decoded)
            if len(found) == most:
                break
    return found


def dream_rng(seed: int, model: str) -> np.random.Generator:
    """The random stream by which strings are drawn from a model."""
    return decision_rng(seed, "eval", "instantiation", model)


def instantiator_of(subject: DatasetRun, kit: Kit) -> Instantiator:
    """What puts graphs of a kit together, its parts upright where variants of the config are."""
    return Instantiator(ContactOracle(kit), subject.config.section(VariationsConfig).search.upright)


def edge_categories(folder: Path, kit: Kit) -> list[TrainedModel[TrainedEdgeCategories]]:
    """The models of edge categories of a kit among published models, the first seed of each."""
    own = {path for path in weights_of_kind(folder, "edge_categories") if read_header(path).get("kit") == kit.name}

    def load(path: Path, _: Mapping[str, Any]) -> TrainedEdgeCategories | None:
        return load_edge_categories(path, kit) if path in own else None

    found = trained_models(folder, "edge_categories", load)
    return [
        TrainedModel(each.name, each.kit, each.seed, each.model)
        for each in found
        if each.model is not None and not each.seed
    ]


def guides_of(model: TrainedEdgeCategories, graphs: Sequence[Decoded]) -> list[Guide]:
    """What a model of edge categories says of each graph along its string; none of what it cannot read."""
    found = []
    for graph in graphs:
        try:
            found.append(guide_of(model.space, graph, model.scores("".join(graph.texts))))
        except ValueError:  # which a StringError is
            found.append(WITHOUT_GUIDE)
    return found


def attempts(
    maker: Instantiator, graphs: Sequence[Decoded], method: SolverMethod, seed: int, guides: Sequence[Guide] = ()
) -> list[Attempt]:
    """Put each graph together, and look at what comes out by the means of verification."""
    found = []
    for place, (graph, guide) in enumerate(zip(graphs, guides or [WITHOUT_GUIDE] * len(graphs), strict=True)):
        rng = decision_rng(seed, "eval", "instantiation", place)
        begun = time.perf_counter()
        made = maker.instantiate(graph.types, graph.edges, rng, method, guide)
        seconds = time.perf_counter() - begun
        faults = 0 if made.assembly is None else len(assembly_faults(maker.kit, made.assembly, maker.upright))
        rank = len(graph.edges) - len(graph.types) + 1
        found.append(Attempt(len(graph.types), rank, made.assembly, made.reason, faults, made.tries, seconds))
    return found


def outcome_table(rows: Sequence[tuple[str, Sequence[Attempt]]]) -> Table:
    """Shapes of graphs, by cycle rank and size."""
    columns = (
        "graphs of",
        "graphs",
        "shapes %",
        *RANKS,
        *SIZES,
        "impossible %",
        "tries a part",
        "ms a graph",
        "faulty",
    )
    cells: list[tuple[Cell, ...]] = []
    for name, of_row in rows:
        by_rank = [_share([each for each in of_row if low <= each.rank <= high]) for low, high in RANKS.values()]
        by_size = [_share([each for each in of_row if low <= each.parts <= high]) for low, high in SIZES.values()]
        impossible = 100 * fmean(each.reason == "no arrangement" for each in of_row)
        faulty = sum(each.faults > 0 for each in of_row)
        cells.append((name, len(of_row), _share(of_row), *by_rank, *by_size, impossible, *_cost(of_row), faulty))
    notes = (
        "Graphs of strings that no model has learnt from, put together at the dockings of their kit; shapes: those "
        "whose contacts, found anew from the meshes, are the edges of the graph, and which are valid by all means of "
        "verification. Impossible: graphs of which every arrangement was tried and none goes. Tries: parts put down, "
        "at least one a part. Faulty: arrangements that the meshes refute. Trees, cycles: by cycle rank.",
    )
    return Table("Instantiation", columns, tuple(cells), notes)


def methods_table(rows: Sequence[tuple[str, str, Sequence[Attempt]]]) -> Table:
    """What each step is worth: shapes of a kit's unseen graphs by each method, within one budget."""
    columns = ("kit", "method", "graphs", "shapes %", *RANKS, "tries a part", "ms a graph")
    cells = []
    for kit, method, of_row in rows:
        by_rank = [_share([each for each in of_row if low <= each.rank <= high]) for low, high in RANKS.values()]
        cells.append((kit, method, len(of_row), _share(of_row), *by_rank, *_cost(of_row)))
    notes = (
        "The graphs of unseen variations, each method within the same number of parts put down. At dead ends steps "
        "back are taken, or the shape is begun anew. The paper has the chance of its random assembly, and says that "
        "trees and small cycles nearly always succeed.",
    )
    return Table("Instantiation: what each step is worth", columns, tuple(cells), notes, PUBLISHED)


def _share(of_row: Sequence[Attempt]) -> Cell:
    return 100 * fmean(each.good for each in of_row) if of_row else ""


def _cost(of_row: Sequence[Attempt]) -> tuple[float, float]:
    return fmean(each.tries / each.parts for each in of_row), 1000 * fmean(each.seconds for each in of_row)
