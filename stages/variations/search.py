"""The search for variants of a kit: cut, match, dock, join, validate, over and over (strings §4)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stages.shape.arrays import IntArray
from stages.shape.kit import Assembly
from stages.variations import kernels
from stages.variations.answers import ContactAnswers
from stages.variations.centroids import match_centroids
from stages.variations.correction import correct_orientations
from stages.variations.kernels import BOUNDARY, EDGES, PARTS, UNKNOWNS, Outcome, ShapeTables
from stages.variations.settings import SearchConfig
from stages.variations.tables import kit_tables, shape_tables, workspace

__all__ = ["Parent", "Search", "Variant"]

REASONS = {
    Outcome.WHOLE: "cut took the whole shape",
    Outcome.NO_SUCH_PART: "boundary part missing in the other shape",
    Outcome.NO_MATCH: "boundary not matched",
    Outcome.NOTHING_ATTACHED: "nothing attached",
    Outcome.TOO_SMALL: "too few parts",
    Outcome.TOO_LARGE: "too many parts",
    Outcome.CLASH: "parts clash",
    Outcome.GRAMMAR: "neighbourhood not in the grammar",
}


@dataclass(frozen=True)
class Parent:
    """A shape that pieces are cut from and docked to; `name` is an exemplar's name or a variant's place in the pool."""

    name: str
    assembly: Assembly
    labels: IntArray
    tables: ShapeTables


@dataclass(frozen=True)
class Variant:
    """A valid new shape. labels: int32 (m, 2), directed docking labels of its edges; graph and docked: its two keys
    by colour refinement; lineage: parents, number of parts from each, boundary and docking motion, as JSON."""

    assembly: Assembly
    labels: IntArray
    graph: int
    docked: int
    lineage: dict[str, Any]


class Search:
    """One line of search: its parents, what it has seen, what it has learnt about contacts."""

    def __init__(self, answers: ContactAnswers, config: SearchConfig) -> None:
        kit = answers.kit
        self.kit = kit
        self.answers = answers
        self.config = config
        sizes = [len(each.assembly) for each in kit.exemplars]
        self.smallest = max(2, round(config.smallest * min(sizes)))
        self.largest = max(3, round(config.largest * max(sizes)))
        self.tables = kit_tables(kit, config.upright)
        self._ws = workspace(max(self.largest, *sizes))
        self.exemplars = [self.parent(each.name, each.assembly) for each in kit.exemplars]
        self.parents: list[Parent] = []
        self.seen: set[int] = {self.key(each.assembly.types, *self.keys_of(each)) for each in self.exemplars}
        self.rejects: Counter[str] = Counter()

    def parent(self, name: str, assembly: Assembly, labels: IntArray | None = None) -> Parent:
        """A shape made ready for cutting and docking."""
        if labels is None:
            labels = self.answers.dockings.label_edges(assembly.types, assembly.poses, assembly.edges)
        return Parent(name, assembly, labels, shape_tables(assembly, labels, len(self.kit.types)))

    def keys_of(self, parent: Parent) -> tuple[int, int]:
        """The two refinement keys of a shape."""
        self._load(parent)
        graph, docked = kernels.refinement_keys(self._ws)
        return int(graph), int(docked)

    def run(
        self, rng: np.random.Generator, tries: int, wanted: int, name: str, progress: Callable[[int], None]
    ) -> tuple[list[Variant], int]:
        """Try until `wanted` new variants are found or `tries` are used up; the variants and the number of tries.

        New variants become parents at once; in lineages they are called `<name>-<number>`. `progress` is told how
        many there are.
        """
        found: list[Variant] = []
        for number in range(tries):
            a, b = self._pick(rng), self._pick(rng)
            variant = self._attempt(rng, a, b)
            if isinstance(variant, str):
                self.rejects[variant] += 1
                continue
            found.append(variant)
            self.seen.add(self.key(variant.assembly.types, variant.graph, variant.docked))
            self.parents.append(self.parent(f"{name}-{len(found) - 1}", variant.assembly, variant.labels))
            progress(len(found))
            if len(found) >= wanted:
                return found, number + 1
        return found, tries

    def _pick(self, rng: np.random.Generator) -> Parent:
        pool: Sequence[Parent] = self.parents
        if not pool or rng.random() < self.config.exemplar_share:
            pool = self.exemplars
        return pool[int(rng.integers(len(pool)))]

    def _attempt(self, rng: np.random.Generator, a: Parent, b: Parent) -> Variant | str:
        """One try: a new variant, or the reason why there is none."""
        ws, kit = self._ws, self.tables
        outcome = kernels.cut(rng, a.tables, b.tables, ws, self.config.growth_share)
        if outcome == Outcome.OK:
            if self.config.matching == "pose":
                outcome = kernels.match_poses(rng, kit, a.tables, b.tables, a is b, ws)
            else:
                outcome = match_centroids(rng, kit, a.tables, b.tables, ws)
        if outcome == Outcome.OK:
            outcome = kernels.join(rng, kit, a.tables, b.tables, ws, self.smallest, self.largest)
            corrected = self.config.matching == "pose" or outcome != Outcome.OK
            if not corrected and not correct_orientations(self.answers.dockings, ws):
                return "orientation cannot be corrected"
        if outcome == Outcome.OK:
            outcome = self._ask_until_known(kernels.connect)
        if outcome != Outcome.OK:
            return REASONS[outcome]
        graph, docked = kernels.refinement_keys(ws)
        if self.key(ws.types[: ws.counts[PARTS]], int(graph), int(docked)) in self.seen:
            return "duplicate"
        outcome = self._ask_until_known(kernels.validate)
        if outcome != Outcome.OK:
            return REASONS[outcome]
        return self._variant(a, b, int(graph), int(docked))

    def key(self, types: np.ndarray, graph: int, docked: int) -> int:
        """What two shapes have in common when they count as the same."""
        if self.config.duplicates == "histogram":
            return int(self.tables.weights[types].sum(dtype=np.uint64))
        return graph if self.config.duplicates == "graph" else docked

    def _ask_until_known(self, kernel: Callable[..., int]) -> int:
        """Run a kernel, and again after answering the contacts that it did not know."""
        while True:
            outcome = kernel(self.tables, self.answers.table, self._ws)
            if outcome != Outcome.UNKNOWN:
                return outcome
            if not self.answers.answer_unknown(self._ws, int(self._ws.counts[UNKNOWNS])):
                return Outcome.CLASH

    def _variant(self, a: Parent, b: Parent, graph: int, docked: int) -> Variant:
        ws = self._ws
        parts, count = int(ws.counts[PARTS]), int(ws.counts[EDGES])
        poses = np.tile(np.eye(4), (parts, 1, 1))
        poses[:, :3, :3] = ws.turns[:parts]
        poses[:, :3, 3] = ws.places[:parts]
        edges = np.sort(ws.edges[:count], axis=1)
        edges = edges[np.lexsort((edges[:, 1], edges[:, 0]))].astype(np.int32)
        labels = np.stack([ws.label[edges[:, 0], edges[:, 1]], ws.label[edges[:, 1], edges[:, 0]]], axis=1)
        origin = ws.origin[:parts]
        lineage = {
            "parents": [a.name, b.name],
            "parts_from": [int((origin != 1).sum()), int((origin == 1).sum())],
            "boundary": ws.boundary[: ws.counts[BOUNDARY]].tolist(),
            "images": ws.images[: ws.counts[BOUNDARY]].tolist(),
            "motion": np.round(ws.motion, 9).tolist(),
        }
        assembly = Assembly(ws.types[:parts].astype(np.int16), poses, edges)
        return Variant(assembly, labels.astype(np.int32), graph, docked, lineage)

    def _load(self, parent: Parent) -> None:
        """Put a shape's graph into the workspace as if it were the variant in hand."""
        ws, assembly = self._ws, parent.assembly
        ws.types[: len(assembly)] = assembly.types
        ws.edges[: len(assembly.edges)] = assembly.edges
        i, j = assembly.edges[:, 0], assembly.edges[:, 1]
        ws.label[i, j] = parent.labels[:, 0]
        ws.label[j, i] = parent.labels[:, 1]
        ws.counts[PARTS], ws.counts[EDGES] = len(assembly), len(assembly.edges)
