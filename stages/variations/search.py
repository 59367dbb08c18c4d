"""The search for variants of a kit: cut, match, dock, join, validate, over and over (strings §4)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from stages.shape.arrays import Float32Array, FloatArray, IntArray
from stages.shape.kit import Assembly
from stages.variations import kernels
from stages.variations.answers import ContactAnswers
from stages.variations.archive import Archive, Cell, cell_of
from stages.variations.centroids import match_centroids
from stages.variations.correction import correct_orientations
from stages.variations.features import MIXED, FeatureTest, material_shares
from stages.variations.kernels import (
    BOUNDARY,
    EDGES,
    GROWN,
    JOINTS,
    PARTS,
    PIECE,
    PLANES,
    UNKNOWNS,
    Outcome,
    ShapeTables,
)
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


DUPLICATE = "duplicate"
SUBASSEMBLY = "nothing but a piece of an exemplar"
NEW = "new variant"
FULL = "cell of the archive is full"

WAYS = ((GROWN, False), (PLANES, False), (PLANES, True), (JOINTS, False))
"""Ways of cutting, and whether the piece must be large."""
KNOWN_GAIN = 0.2
"""What a new variant of a known histogram counts beside one of a new histogram."""
SMALL, NEARLY_ALL = 0.2, 0.8
"""A piece with a share of parts between these is a large cut, one that can change a shape as a whole."""
RECUTS = 4
"""Cuts made at most until one is large."""


@dataclass(frozen=True)
class Parent:
    """A shape that pieces are cut from and docked to; `name` is an exemplar's name or a variant's place in the pool.

    origins: int8 (n,), the exemplar that each part came from; shares: float64 (exemplars,) of them; cell and
    histogram: its place in the archive.
    """

    name: str
    assembly: Assembly
    labels: IntArray
    tables: ShapeTables
    origins: np.ndarray
    shares: FloatArray
    cell: Cell
    histogram: int


@dataclass(frozen=True)
class Variant:
    """A valid new shape. labels: int32 (m, 2), directed docking labels of its edges; graph and docked: its two keys
    by colour refinement; origins: int8 (n,), the exemplar that each part came from; features: float32 (9,);
    histogram: a hash of its type histogram; lineage: parents, number of parts from each, boundary and docking
    motion, as JSON."""

    assembly: Assembly
    labels: IntArray
    graph: int
    docked: int
    origins: np.ndarray
    features: Float32Array
    cell: Cell
    histogram: int
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
        self.archive = Archive(config.novelty.quota)
        self._features = FeatureTest(kit)
        self.exemplars = [
            self.parent(each.name, each.assembly, np.full(len(each.assembly), number, dtype=np.int8))
            for number, each in enumerate(kit.exemplars)
        ]
        self.families: list[list[Parent]] = [[] for _ in range(len(self.exemplars) + 1)]
        self.seen: set[int] = {self.key(each.assembly.types, *self.keys_of(each)) for each in self.exemplars}
        for each in self.exemplars:
            self.archive.add(each.cell, each.histogram)
        self._cuts = np.zeros(len(WAYS))
        self._gains = np.zeros(len(WAYS))
        self.rejects: Counter[str] = Counter()
        self.crossings: Counter[str] = Counter()

    def parent(self, name: str, assembly: Assembly, origins: np.ndarray, labels: IntArray | None = None) -> Parent:
        """A shape made ready for cutting and docking."""
        if labels is None:
            labels = self.answers.dockings.label_edges(assembly.types, assembly.poses, assembly.edges)
        shares = material_shares(origins, len(self.kit.exemplars))
        cell = self._cell(self._features.features(assembly, shares, self._features.marks(assembly)))
        tables = shape_tables(assembly, labels, len(self.kit.types))
        return Parent(name, assembly, labels, tables, origins, shares, cell, self.histogram(assembly.types))

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
            guided = self.config.novelty.guided and rng.random() >= self.config.novelty.plain_share
            a = self._pick(rng, guided)
            b = self._partner(rng, a, guided)
            way = self._way(rng, guided)
            self._cuts[way] += 1
            variant = self._attempt(rng, a, b, way)
            if not (a.shares * b.shares).any():
                self.crossings[variant if isinstance(variant, str) else NEW] += 1
            if isinstance(variant, str):
                self.rejects[variant] += 1
                continue
            found.append(variant)
            self.seen.add(self.key(variant.assembly.types, variant.graph, variant.docked))
            self._gains[way] += KNOWN_GAIN if variant.histogram in self.archive.histograms else 1.0
            self.archive.add(variant.cell, variant.histogram)
            parent = self.parent(f"{name}-{len(found) - 1}", variant.assembly, variant.origins, variant.labels)
            self.adopt(rng, parent)
            progress(len(found))
            if len(found) >= wanted:
                return found, number + 1
        return found, tries

    def adopt(self, rng: np.random.Generator, parent: Parent) -> None:
        """Add a parent; where there are as many as the config allows, the most crowded of some of the largest family
        makes room."""
        if sum(len(family) for family in self.families) >= self.config.parents:
            largest = max(self.families, key=len)
            places = self._draw(rng, len(largest), self.config.novelty.rivals)
            leaves = max(places, key=lambda place: self._crowd(largest[place]))
            largest[leaves] = largest[-1]
            largest.pop()
        mixed = 1.0 - parent.shares.max() >= MIXED
        self.families[len(self.exemplars) if mixed else int(parent.shares.argmax())].append(parent)

    def _pick(self, rng: np.random.Generator, guided: bool) -> Parent:
        """A parent: an exemplar; or an earlier variant of any family, or of all together, most often a rare one."""
        novelty = self.config.novelty
        counts = [len(family) for family in self.families]
        total = sum(counts)
        if not total or rng.random() < self.config.exemplar_share:
            return self.exemplars[int(rng.random() * len(self.exemplars))]
        if guided and rng.random() < novelty.family_share:
            number = int(rng.random() * (len(counts) if counts[-1] else len(counts) - 1))
            if not counts[number]:
                return self.exemplars[number]
            first, total = sum(counts[:number]), counts[number]
        else:
            first = 0
        if not guided:
            return self._member(int(rng.random() * total))
        rivals = [self._member(first + place) for place in self._draw(rng, total, novelty.rivals)]
        # The first to come, where the common wait long: of two, one twice as crowded has half the chance.
        waits = rng.exponential(size=len(rivals)).tolist()
        return min(zip(waits, rivals, strict=True), key=lambda each: each[0] * self._crowd(each[1]))[1]

    def _member(self, place: int) -> Parent:
        """The earlier variant at a place, counted through all families."""
        for family in self.families:
            if place < len(family):
                return family[place]
            place -= len(family)
        raise IndexError(place)

    def _partner(self, rng: np.random.Generator, a: Parent, guided: bool) -> Parent:
        """The second parent: any; or of some the one whose parts come from other exemplars, or from the same."""
        novelty = self.config.novelty
        if not guided or len(self.exemplars) == 1:
            return self._pick(rng, guided)
        crossing = rng.random() < novelty.cross_share * self._hope()
        if not crossing and rng.random() < 0.5:
            return self._pick(rng, guided)
        rivals = [self._pick(rng, guided) for _ in range(3)]
        rivals.append(self.exemplars[int(rng.random() * len(self.exemplars))])
        common = [float(np.minimum(each.shares, a.shares).sum()) * (1 if crossing else -1) for each in rivals]
        return min(zip(common, rivals, strict=True), key=lambda each: (each[0], self._crowd(each[1])))[1]

    def _hope(self) -> float:
        """How much of its share of tries crossing gets: all of it at first, less the longer nothing comes of it."""
        won = self.crossings[NEW]
        return max(0.2, (1 + won) / (1 + won + self.crossings.total() / 200))

    def _crowd(self, parent: Parent) -> int:
        return self.archive.crowd(parent.cell, parent.histogram)

    @staticmethod
    def _draw(rng: np.random.Generator, among: int, count: int) -> list[int]:
        return [int(each * among) for each in rng.random(count)]

    def _way(self, rng: np.random.Generator, guided: bool) -> int:
        """The way of the next cut, an index into WAYS."""
        if not guided:
            return 0 if rng.random() < self.config.growth_share else 1
        if rng.random() < self.config.novelty.learnt_share:
            odds = np.cumsum((self._gains + 1) / (self._cuts + 100))
            return int(np.searchsorted(odds, rng.random() * odds[-1], side="right").clip(0, len(WAYS) - 1))
        return 0 if rng.random() < self.config.growth_share else 1 + int(rng.random() * (len(WAYS) - 1))

    def _cut(self, rng: np.random.Generator, a: Parent, b: Parent, way: int) -> int:
        """Cut a piece out of A; where it must be large it is cut anew while it is small or nearly everything."""
        how, large = WAYS[way]
        parts = len(a.assembly)
        for _ in range(RECUTS if large else 1):
            outcome: int = kernels.cut(rng, a.tables, b.tables, self._ws, how)
            if outcome == Outcome.OK and SMALL * parts <= self._ws.counts[PIECE] <= NEARLY_ALL * parts:
                break
        return outcome

    def _attempt(self, rng: np.random.Generator, a: Parent, b: Parent, way: int) -> Variant | str:
        """One try: a new variant, or the reason why there is none."""
        ws, kit = self._ws, self.tables
        outcome = self._cut(rng, a, b, way)
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
            return DUPLICATE
        if any(kernels.lies_in(kit, ws, each.tables) for each in self.exemplars):
            return SUBASSEMBLY
        outcome = self._ask_until_known(kernels.validate)
        if outcome != Outcome.OK:
            return REASONS[outcome]
        variant = self._variant(a, b, int(graph), int(docked))
        if self.config.novelty.guided and self.archive.is_full(variant.cell, variant.histogram):
            return FULL
        return variant

    def key(self, types: np.ndarray, graph: int, docked: int) -> int:
        """What two shapes have in common when they count as the same."""
        if self.config.duplicates == "histogram":
            return self.histogram(types)
        return graph if self.config.duplicates == "graph" else docked

    def histogram(self, types: np.ndarray) -> int:
        """A hash of a type histogram."""
        return int(self.tables.weights[types].sum(dtype=np.uint64))

    def _cell(self, features: Float32Array) -> Cell:
        return cell_of(features, self.config.novelty.axes, self.config.novelty.resolution)

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
        origins = np.empty(parts, dtype=np.int8)
        for parent, placed in ((b, ws.from_b), (a, ws.from_a)):
            at = placed[: len(parent.assembly)]
            origins[at[at >= 0]] = parent.origins[at >= 0]
        # A part whose neighbourhood tells its exemplar is of that one, whichever copy of it a piece brought along.
        marks = self._features.marks(assembly)
        origins = np.where(marks >= 0, marks, origins)
        features = self._features.features(assembly, material_shares(origins, len(self.exemplars)), marks)
        return Variant(
            assembly,
            labels.astype(np.int32),
            graph,
            docked,
            origins,
            features,
            self._cell(features),
            self.histogram(assembly.types),
            lineage,
        )

    def _load(self, parent: Parent) -> None:
        """Put a shape's graph into the workspace as if it were the variant in hand."""
        ws, assembly = self._ws, parent.assembly
        ws.types[: len(assembly)] = assembly.types
        ws.edges[: len(assembly.edges)] = assembly.edges
        i, j = assembly.edges[:, 0], assembly.edges[:, 1]
        ws.label[i, j] = parent.labels[:, 0]
        ws.label[j, i] = parent.labels[:, 1]
        ws.counts[PARTS], ws.counts[EDGES] = len(assembly), len(assembly.edges)
