"""Instantiation of graphs: how many become shapes, what each step contributes, and at what cost (strings §6)."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean

import numpy as np

from eval.engine.dataset_run import DatasetRun
from eval.engine.models import TrainedModel
from eval.engine.table import Cell, ReferenceRow, Table
from eval.generated.edge_categories import category_models
from pipeline.randomness import decision_rng
from stages.shape.assembly_faults import assembly_faults
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit import Assembly, Kit
from stages.string_sampling.instantiation.guidance import WITHOUT_GUIDE, Guide, guide_of
from stages.string_sampling.instantiation.instantiate import Instantiator
from stages.string_sampling.instantiation.state import STANDARD_METHOD, SolverMethod
from stages.strings.decoder import Decoded, decode
from stages.strings.tokens import Alphabet
from stages.training.edge_categories.trained import TrainedEdgeCategories
from stages.variations.settings import VariationsConfig

DRAWS_PER_GRAPH = 4
"""Strings sampled from a model for each graph that is wanted."""

METHODS: Mapping[str, SolverMethod] = {
    "all steps": STANDARD_METHOD,
    "without look-ahead to where cycles close": STANDARD_METHOD._replace(closes=False),
    "without most constrained part first": STANDARD_METHOD._replace(constrained=False),
    "without backtracking": STANDARD_METHOD._replace(backtracks=False),
    "parts in random order, restarted at dead ends (§6)": SolverMethod(
        constrained=False, backtracks=False, closes=False
    ),
    "random dockings, no check until the end (figure 8)": SolverMethod(
        checked=False, constrained=False, backtracks=False, closes=False
    ),
}
"""Ours, ours without each step that goes beyond the paper, and those of the paper."""

PUBLISHED = (
    ReferenceRow("one shape of 14 uncertain dockings, at random", "strings fig. 8", {"shapes %": 100 / 5**14}),
)

RANKS = {"trees %": (0, 0), "1-2 cycles %": (1, 2), "3-5 %": (3, 5), "6+ %": (6, 1 << 30)}
SIZES = {"to 30 parts %": (1, 30), "31-60 %": (31, 60), "61+ %": (61, 1 << 30)}


@dataclass(frozen=True)
class InstantiationAttempt:
    """The instantiation of one graph."""

    parts: int
    rank: int
    """Cycle rank of the graph."""
    assembly: Assembly | None
    reason: str
    """Why there is no assembly; else empty."""
    faults: int
    """Of the assembly, by its meshes."""
    placements: int
    """Parts placed, also those taken back."""
    seconds: float
    """Without the check of the meshes."""

    @property
    def is_valid(self) -> bool:
        """Whether there is a shape that is valid by its meshes."""
        return self.assembly is not None and not self.faults


def distinct_graphs(
    strings: Iterable[str], alphabet: Alphabet, max_graphs: int, known: set[str] | None = None
) -> list[Decoded]:
    """Return the first `max_graphs` different graphs of strings, without those whose digest is `known`."""
    seen, graphs = set(known or ()), []
    for string in strings:
        decoded = decode(string, alphabet)
        digest = graph_digest(decoded.types, decoded.edges)
        if digest not in seen:
            seen.add(digest)
            graphs.append(decoded)
            if len(graphs) == max_graphs:
                break
    return graphs


def sampling_rng(seed: int, model: str) -> np.random.Generator:
    """Return the random stream of the strings sampled from a model."""
    return decision_rng(seed, "eval", "instantiation", model)


def instantiator_of(run: DatasetRun, kit: Kit) -> Instantiator:
    """Return the instantiator of a kit; its parts are upright if variations of the config are."""
    return Instantiator(ContactOracle(kit), run.config.section(VariationsConfig).search.upright)


def edge_categories(folder: Path, kit: Kit) -> list[TrainedModel[TrainedEdgeCategories]]:
    """Load the models of edge categories of a kit among published models, the first seed of each."""
    models = category_models(folder, {kit.name: kit})
    return [trained for trained in models if not trained.seed]


def guides_of(model: TrainedEdgeCategories, graphs: Sequence[Decoded]) -> list[Guide]:
    """Return the guide of a model for each graph along its string; no guide for a string that it cannot read."""
    guides = []
    for graph in graphs:
        try:
            guides.append(guide_of(model.space, graph, model.scores("".join(graph.texts))))
        except ValueError:  # StringError is one
            guides.append(WITHOUT_GUIDE)
    return guides


def attempts(
    instantiator: Instantiator, graphs: Sequence[Decoded], method: SolverMethod, seed: int, guides: Sequence[Guide] = ()
) -> list[InstantiationAttempt]:
    """Instantiate each graph, and check the results as verification does."""
    results = []
    for number, (graph, guide) in enumerate(zip(graphs, guides or [WITHOUT_GUIDE] * len(graphs), strict=True)):
        rng = decision_rng(seed, "eval", "instantiation", number)
        start = time.perf_counter()
        instance = instantiator.instantiate(graph.types, graph.edges, rng, method, guide)
        seconds = time.perf_counter() - start
        assembly, faults = instance.assembly, 0
        if assembly is not None:
            faults = len(assembly_faults(instantiator.kit, assembly, instantiator.upright))
        parts, rank = len(graph.types), len(graph.edges) - len(graph.types) + 1
        results.append(
            InstantiationAttempt(parts, rank, assembly, instance.reason, faults, instance.placements, seconds)
        )
    return results


def outcome_table(rows: Sequence[tuple[str, Sequence[InstantiationAttempt]]]) -> Table:
    """Return one row for each group of graphs: shares of shapes by cycle rank and size."""
    columns = (
        "graphs of",
        "graphs",
        "shapes %",
        *RANKS,
        *SIZES,
        "impossible %",
        "placements a part",
        "ms a graph",
        "faulty",
    )
    cells: list[tuple[Cell, ...]] = []
    for name, tried in rows:
        by_size = [
            _share([attempt for attempt in tried if low <= attempt.parts <= high]) for low, high in SIZES.values()
        ]
        impossible = 100 * fmean(attempt.reason == "no arrangement" for attempt in tried)
        faulty = sum(attempt.faults > 0 for attempt in tried)
        shares = (_share(tried), *_by_rank(tried), *by_size, impossible)
        cells.append((name, len(tried), *shares, *_cost(tried), faulty))
    notes = (
        "Graphs of strings that no model was trained on, instantiated with the dockings of their kit. Shapes: valid by "
        "all checks of verification, with contacts, computed from the meshes, that are the edges of the graph. "
        "Impossible: graphs whose search space was exhausted. Placements: parts placed, at least one per part. Faulty: "
        "arrangements that the meshes refute. Trees, cycles: by cycle rank.",
    )
    return Table("Instantiation", columns, tuple(cells), notes)


def methods_table(rows: Sequence[tuple[str, str, Sequence[InstantiationAttempt]]]) -> Table:
    """Return one row for each kit and method: shapes of unseen graphs within one budget."""
    columns = ("kit", "method", "graphs", "shapes %", *RANKS, "placements a part", "ms a graph")
    cells = [(kit, method, len(tried), _share(tried), *_by_rank(tried), *_cost(tried)) for kit, method, tried in rows]
    notes = (
        "The graphs of unseen variations, with an equal number of placements for each method. At dead ends the solver "
        "backtracks or restarts. The paper reports the chance of its random assembly, and that trees and small cycles "
        "nearly always succeed.",
    )
    return Table("Instantiation: contribution of each step", columns, tuple(cells), notes, PUBLISHED)


def _by_rank(tried: Sequence[InstantiationAttempt]) -> list[Cell]:
    return [_share([attempt for attempt in tried if low <= attempt.rank <= high]) for low, high in RANKS.values()]


def _share(tried: Sequence[InstantiationAttempt]) -> Cell:
    return 100 * fmean(attempt.is_valid for attempt in tried) if tried else ""


def _cost(tried: Sequence[InstantiationAttempt]) -> tuple[float, float]:
    return fmean(attempt.placements / attempt.parts for attempt in tried), 1000 * fmean(
        attempt.seconds for attempt in tried
    )
