"""The search for variants of a kit: cut, match, dock, join, validate, over and over (strings §4)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from stages.shape.arrays import Float32Array, FloatArray, IntArray
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.neighbourhoods import SLOT_LEVELS, admits
from stages.shape.graphs.slots import SlotGrammar
from stages.shape.kit import Assembly
from stages.variations.exchange.attempt import attempt, complete, cut_piece
from stages.variations.exchange.centroid_matching import match_centroids
from stages.variations.exchange.joins import join
from stages.variations.exchange.orientation_correction import correct_orientations
from stages.variations.exchange.pose_matching import lies_in
from stages.variations.growth.grower import Grower
from stages.variations.kernels.checks import find_contacts, validate
from stages.variations.kernels.graph_key import graph_key
from stages.variations.kernels.structs import (
    BOUNDARY,
    EDGES,
    MEANINGS,
    NOTHING,
    PARTS,
    REPLACED,
    UNITS,
    UNKNOWNS,
    Outcome,
)
from stages.variations.kernels.tables import kit_tables, multiset_weights, shape_tables, workspace
from stages.variations.novelty.archive import Archive, Cell, Place, cell_of
from stages.variations.novelty.copied_pieces import CopyDetector
from stages.variations.novelty.features import FeatureExtractor, material_shares
from stages.variations.requirements.stretched_contacts import broken_contact
from stages.variations.search.operator_selection import BATCH, TRY_WORK, OperatorSelector, PlannedTry
from stages.variations.search.parents import Parent, Parents
from stages.variations.settings import SearchConfig
from stages.variations.substitution.attachment import HoldTest
from stages.variations.substitution.ground import GroundTest
from stages.variations.substitution.substitute import substitute
from stages.variations.substructures.replacer import Replacer

SPARE = 4
"""A search ends at so many times the variants that it looks for, if few of them add to the archive."""

DUPLICATE = "duplicate"
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
GROWN_REASONS = {
    Outcome.NO_MATCH: "growth given up",
    **{each: f"grown: {REASONS[each]}" for each in (Outcome.TOO_SMALL, Outcome.TOO_LARGE)},
}
REPLACED_REASONS = {
    Outcome.NO_MATCH: "replaced: no embedding",
    Outcome.NOTHING_ATTACHED: "replaced: nothing but a gap to close",
    Outcome.KNOWN: DUPLICATE,
    Outcome.ASKEW: "bent: boundaries stand at other angles",
    **{each: f"replaced: {REASONS[each]}" for each in (Outcome.TOO_SMALL, Outcome.TOO_LARGE, Outcome.GRAMMAR)},
}

SUBASSEMBLY = "nothing but a piece of an exemplar"
APART = "falls apart"
LIFTED = "lifted off the ground"
LOOSE = "not held at a side where it always was"
NEW = "new variant"

KNOWN_GAIN = 0.2
"""What a new variant of a known histogram counts beside one of a new histogram."""
EARLY = {REASONS[each] for each in (Outcome.WHOLE, Outcome.NO_SUCH_PART, Outcome.NO_MATCH)}
LATE_WORK = 3.0
"""What a try costs that comes as far as being joined, beside one that finds no match."""


@dataclass(frozen=True)
class Variant:
    """A valid new shape. labels: int32 (m, 2), directed docking labels of its edges; graph and docked: its two keys
    by colour refinement; origins: int8 (n,), the exemplar that each part came from; features: float32 (10,);
    histogram: a hash of its type histogram; lineage: parents, number of parts from each, boundary, docking motion and
    what is copied whole, as JSON."""

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
    """One line of search: its parents, what it has seen, what it has learnt about contacts.

    slots: what the kit shows of slots, where its grammar is one of slots and somebody knows them already; copies: the
    test for what is copied of its exemplars, where somebody has it.
    """

    def __init__(
        self,
        answers: ContactOracle,
        config: SearchConfig,
        slots: SlotGrammar | None = None,
        copies: CopyDetector | None = None,
    ) -> None:
        kit = answers.kit
        self.kit = kit
        self.answers = answers
        self.config = config
        sizes = [len(each.assembly) for each in kit.exemplars]
        self.min_parts = max(2, round(config.min_size * min(sizes)))
        self.max_parts = max(3, round(config.max_size * max(sizes)))
        self._sizes = np.array(sizes)
        self._has = np.array([np.isin(np.arange(len(kit.types)), each.assembly.types) for each in kit.exemplars])
        self.tables = kit_tables(kit, config.upright)
        self._histogram_weights = multiset_weights(len(kit.types))
        self._ws = workspace(max(self.max_parts, *sizes))
        self._stretches: FloatArray | None = None
        slotted = kit.grammar.strictness in SLOT_LEVELS
        self._slots = (slots or SlotGrammar(kit, answers.dockings, config.upright)) if slotted else None
        self._grower = self._made_grower() if config.method in ("both", "growth", "all") else None
        self._replacer = self._made_replacer() if config.method in ("substructures", "all") else None
        self.archive = Archive(config.novelty.cell_quota)
        by_meaning = kit.by_meaning
        self.operators = OperatorSelector(config, by_meaning)
        self._ground = GroundTest(kit, answers.dockings.reach / 2) if by_meaning and config.upright else None
        self._holds = HoldTest(kit, answers.dockings.reach / 2) if by_meaning and config.upright else None
        self._features = FeatureExtractor(kit)
        self._copies = copies or CopyDetector(kit, answers.dockings)
        self.parents = Parents([self._exemplar(number) for number in range(len(sizes))], config.max_parents)
        self.seen: set[int] = set()
        for each in self.parents.exemplars:
            self.remember(each.assembly.types, *self.keys_of(each))
        self.spares = 0
        self.rejects: Counter[str] = Counter()
        self.crossings: Counter[str] = Counter()

    def _exemplar(self, number: int) -> Parent:
        exemplar = self.kit.exemplars[number]
        assembly, origins = exemplar.assembly, np.full(len(exemplar.assembly), number, dtype=np.int8)
        shares = material_shares(origins, len(self.kit.exemplars))
        features = self._features.features(assembly, shares, self._features.marks(assembly), 1.0)
        place = self.archive.add(self._cell(features), self.histogram(assembly.types))
        return self.parent(exemplar.name, assembly, origins, place)

    def parent(
        self, name: str, assembly: Assembly, origins: np.ndarray, place: Place, labels: IntArray | None = None
    ) -> Parent:
        """A shape made ready for cutting and docking; `place` is where it stands in the archive."""
        if labels is None:
            labels = self.answers.dockings.label_edges(assembly.types, assembly.poses, assembly.edges)
        shares = material_shares(origins, len(self.kit.exemplars))
        tables = shape_tables(assembly, labels, len(self.kit.types))
        return Parent(name, assembly, labels, tables, origins, shares, place)

    def keys_of(self, parent: Parent) -> tuple[int, int]:
        """The two refinement keys of a shape."""
        self._load(parent)
        return self._graph_keys()

    def _graph_keys(self) -> tuple[int, int]:
        """The two refinement keys of the variant in hand."""
        label_of = self.tables.label_of
        return int(graph_key(label_of, self._ws, False)), int(graph_key(label_of, self._ws, True))

    def run(
        self, rng: np.random.Generator, tries: int, wanted: int, name: str, progress: Callable[[int], None]
    ) -> tuple[list[Variant], int]:
        """Try until `wanted` new variants are found that add to the archive, or SPARE times as many of any kind, or
        `tries` are used up; the variants and the number of tries.

        New variants that add to the archive become parents at once; in lineages they are called `<name>-<number>`.
        `progress` is told how many there are.
        """
        found: list[Variant] = []
        telling, number = 0, 0
        while number < tries and telling < wanted and len(found) < SPARE * wanted:
            batch = self.operators.plan(rng, self.parents, self.archive, min(BATCH, tries - number))
            for choice in batch:
                if number >= tries:  # what is grown takes many
                    break
                if choice.way == NOTHING:
                    variant, work = self._grow(rng)
                    number += max(round(work / TRY_WORK), 1)
                elif choice.way == REPLACED:
                    variant, work, choice = self._replace(rng, choice)
                    number += max(round(work / TRY_WORK), 1)
                else:
                    number += 1
                    variant = self._attempt(rng, choice)
                    work = 1.0 if isinstance(variant, str) and variant in EARLY else LATE_WORK
                    if not (choice.a.shares * choice.b.shares).any():
                        self.crossings[variant if isinstance(variant, str) else NEW] += 1
                if isinstance(variant, str):
                    self.rejects[variant] += 1
                    self.operators.learn(choice, 0.0, work)
                    continue
                found.append(variant)
                if self._keep(rng, variant, choice, work, f"{name}-{len(found) - 1}"):
                    telling += 1
                    progress(telling)
                if telling >= wanted or len(found) >= SPARE * wanted:
                    break
        return found, number

    def _keep(self, rng: np.random.Generator, variant: Variant, choice: PlannedTry, work: float, name: str) -> bool:
        """Count a find, and make it a parent where it adds to the archive; whether it does."""
        self.remember(variant.assembly.types, variant.graph, variant.docked)
        spare = self.archive.is_full(variant.cell, variant.histogram)
        gain = KNOWN_GAIN if self.archive.has_histogram(variant.histogram) else 1.0
        self.operators.learn(choice, 0.0 if spare else gain, work)
        place = self.archive.add(variant.cell, variant.histogram)
        if spare and self.config.novelty.guided:
            self.spares += 1
            return False
        if variant.assembly.stretches is None:  # how stretched parts dock nobody has seen
            self.adopt(rng, self.parent(name, variant.assembly, variant.origins, place, variant.labels))
        return True

    def adopt(self, rng: np.random.Generator, parent: Parent) -> None:
        """Add a parent."""
        self.parents.adopt(rng, parent, self.archive)

    def _attempt(self, rng: np.random.Generator, choice: PlannedTry) -> Variant | str:
        """One try: a new variant, or the reason why there is none."""
        a, b, ws, kit = choice.a, choice.b, self._ws, self.tables
        with_labels = self.config.duplicates == "docking"
        limits = self.min_parts, self.max_parts
        known = self.answers.table
        if choice.way == MEANINGS:
            outcome, key = substitute(rng, self.kit, kit, self.answers.dockings, a, b, ws, *limits), 0
            if outcome == Outcome.OK:
                outcome, key = complete(kit, known, ws, with_labels)
        elif self.config.matching == "pose" or choice.way == UNITS:
            outcome, key = attempt(
                rng, kit, a.tables, b.tables, a is b, known, ws, choice.way, choice.large, *limits, with_labels
            )
        else:
            outcome, key = cut_piece(rng, a.tables, b.tables, ws, choice.way, choice.large, kit.limits[0]), 0
            if outcome == Outcome.OK:
                outcome = match_centroids(rng, kit, a.tables, b.tables, ws)
            if outcome == Outcome.OK:
                outcome = join(rng, kit, a.tables, b.tables, ws, *limits)
            if outcome == Outcome.OK:
                if not correct_orientations(self.answers.dockings, ws):
                    return "orientation cannot be corrected"
                outcome, key = complete(kit, known, ws, with_labels)
        outcome, key = self._answered(outcome, key)
        if outcome != Outcome.OK:
            return REASONS[outcome]
        if choice.way == MEANINGS and not self._is_connected():
            return APART
        method = "substitution" if choice.way == MEANINGS else "exchange"
        return self._finished(int(key), *self._descent(method, a, b))

    def _answered(self, outcome: int, key: int) -> tuple[int, int]:
        """The outcome and key of a try that was completed, once all contacts are known that were not."""
        while outcome == Outcome.UNKNOWN:
            if not self.answers.answer_unknown(self._ws, int(self._ws.counts[UNKNOWNS])):
                return Outcome.CLASH, 0
            with_labels = self.config.duplicates == "docking"
            outcome, key = complete(self.tables, self.answers.table, self._ws, with_labels)
        return outcome, key

    def _replace(self, rng: np.random.Generator, choice: PlannedTry) -> tuple[Variant | str, float, PlannedTry]:
        """One replacement: a new variant, or the reason why there is none; what it cost; and the choice to which it is
        owed, an earlier one while operations of its pair are left."""
        assert self._replacer is not None, "no choice is to replace where the method forbids it"
        outcome, work = self._replacer.replace(rng, choice, self._ws)
        used = self._replacer.choice
        found = self._replaced(used) if outcome == Outcome.OK else REPLACED_REASONS[outcome]
        self._stretches = None
        return found, work, used

    def _replaced(self, choice: PlannedTry) -> Variant | str:
        """What was put together by replacement, as a new variant, or the reason why it is none."""
        assert self._replacer is not None, "no choice is to replace where the method forbids it"
        ws = self._ws
        with_labels = self.config.duplicates == "docking"
        self._stretches = self._replacer.stretches
        if self._stretches is not None:
            return self._stretched(choice)
        how = "blended" if self._replacer.is_bent else "replaced"
        outcome = self._answered_by(find_contacts) if self._replacer.is_bent else Outcome.OK
        if outcome == Outcome.OK:
            outcome, key = self._answered(*complete(self.tables, self.answers.table, ws, with_labels))
        if outcome != Outcome.OK:
            return f"{how}: {REASONS[outcome]}"
        if not self._replacer.is_joined(ws):
            return f"{how}: contact lost"
        return self._replacement(int(key), choice)

    def _stretched(self, choice: PlannedTry) -> Variant | str:
        """The same where the piece was stretched: its contacts are those that the operation says, which are held
        against the meshes in the end."""
        assert self._replacer is not None, "no choice is to replace where the method forbids it"
        self._replacer.predict(self._ws)
        labelled, grammar = self.kit.labelled(self._assembly()), self.kit.grammar
        around = zip(labelled.types.tolist(), labelled.neighbours(), strict=True)
        if not all(admits(grammar, label, labelled.multiset(near)) for label, near in around):
            return f"stretched: {REASONS[Outcome.GRAMMAR]}"
        return self._replacement(self._graph_keys()[int(self.config.duplicates == "docking")], choice)

    def _replacement(self, key: int, choice: PlannedTry) -> Variant | str:
        assert self._replacer is not None, "no choice is to replace where the method forbids it"
        if not self._is_connected():
            return APART
        origins, lineage = self._descent("substructures", choice.a, self._replacer.base)
        lineage |= {"repeats": self._replacer.times, "deformed": self._replacer.is_bent}
        return self._finished(key, origins, lineage)

    def _descent(self, method: str, a: Parent, b: Parent) -> tuple[np.ndarray, dict[str, Any]]:
        """The exemplar that each part of the variant in hand came from, int8 (n,), and its lineage, where a piece of A
        was put into B as a whole and once."""
        ws = self._ws
        from_b = int((ws.origin[: ws.counts[PARTS]] == 1).sum())
        lineage = {
            "method": method,
            "parents": [a.name, b.name],
            "parts_from": [int(ws.counts[PARTS]) - from_b, from_b],
            "boundary": ws.boundary[: ws.counts[BOUNDARY]].tolist(),
            "images": ws.images[: ws.counts[BOUNDARY]].tolist(),
            "transform": np.round(ws.motion, 9).tolist(),
            "repeats": 1,
            "deformed": False,
        }
        origins = np.empty(int(ws.counts[PARTS]), dtype=np.int8)
        for parent, placed in ((b, ws.from_b), (a, ws.from_a)):
            at = placed[: len(parent.assembly)]
            origins[at[at >= 0]] = parent.origins[at >= 0]
        return origins, lineage

    def _made_replacer(self) -> Replacer:
        return Replacer(self.answers, self.tables, self.min_parts, self.max_parts, self.config)

    def _made_grower(self) -> Grower:
        grown, limits = self.config.grown, (self.min_parts, self.max_parts)
        return Grower(self.answers, self.tables, *limits, self._slots, grown.parts, grown.footprint)

    def _grow(self, rng: np.random.Generator) -> tuple[Variant | str, float]:
        """One shape grown from nothing: a new variant, or the reason why there is none; and what it cost."""
        assert self._grower is not None, "no choice is to grow where the method forbids it"
        ws = self._ws
        outcome, work = self._grower.grow(rng, ws)
        if outcome != Outcome.OK:
            return GROWN_REASONS.get(outcome, REASONS[outcome]), work
        origins = ws.origin[: ws.counts[PARTS]].astype(np.int8)
        ws.origin[: ws.counts[PARTS]] = 2  # no contact is left to be found between two shapes
        outcome, key = complete(self.tables, self.answers.table, ws, self.config.duplicates == "docking")
        if outcome != Outcome.OK:
            return REASONS[outcome], work
        exemplar, part = self._grower.seed
        counts = np.bincount(origins, minlength=len(self.kit.exemplars))
        used = [exemplar, *(number for number in np.flatnonzero(counts).tolist() if number != exemplar)]
        lineage = {
            "method": "growth",
            "parents": [self.kit.exemplars[number].name for number in used],
            "parts_from": counts[used].tolist(),
            "boundary": [part],
            "images": [0],
            "transform": [*np.eye(3).tolist(), [0.0, 0.0, 0.0]],
            "repeats": 1,
            "deformed": False,
        }
        return self._finished(int(key), origins, lineage), work

    def _finished(self, key: int, origins: np.ndarray, lineage: dict[str, Any]) -> Variant | str:
        """What the workspace holds, of parts from the exemplars `origins`, as a new variant, or why it is none."""
        ws, kit = self._ws, self.tables
        types = ws.types[: ws.counts[PARTS]]
        if (self.histogram(types) if self.config.duplicates == "histogram" else int(key)) in self.seen:
            return DUPLICATE
        if len(types) > self._most(types) and not (lineage["method"] == "growth" and self.config.grown.parts):
            return REASONS[Outcome.TOO_LARGE]
        pieces_count = self.config.sub_assemblies
        if not pieces_count and any(lies_in(kit, ws, each.tables) for each in self.parents.exemplars):
            return SUBASSEMBLY
        placed = self._poses() if self._stretches is None else self._assembly().placements
        if self._ground is not None and self._ground.is_lifted(types, placed):
            return LIFTED
        if self._holds is not None and self._holds.is_loose(self._assembly()):
            return LOOSE
        fault = None if self._stretches is None else broken_contact(self.kit, self._assembly())
        if fault is not None:
            return f"stretched: {fault}"
        outcome = self._answered_by(validate) if self._stretches is None else Outcome.OK
        if outcome != Outcome.OK:
            return REASONS[outcome]
        if self._slots is not None and self._slots.misfits(self._assembly()):
            return REASONS[Outcome.GRAMMAR]
        return self._variant(origins, lineage, *self._graph_keys())

    def _most(self, types: np.ndarray) -> int:
        """The most parts of a shape of parts of the types (n,): what the largest exemplar sets that has all of them,
        for a row of one exemplar's parts looks no better for another that is large; where none has, `largest`."""
        whole = self._has[:, np.unique(types)].all(axis=1)
        return max(3, round(self.config.max_size * self._sizes[whole].max())) if whole.any() else self.max_parts

    def remember(self, types: np.ndarray, graph: int, docked: int) -> None:
        """Let a shape of these types and keys be known, so that it is a duplicate when it is found again."""
        self.seen.add(self.key(types, graph, docked))
        if self._replacer is not None:
            self._replacer.known.add(docked)

    @property
    def lists(self) -> Counter[str]:
        """How many lists of replacements were made, by whether each was whole or cut short."""
        return Counter() if self._replacer is None else self._replacer.lists

    def key(self, types: np.ndarray, graph: int, docked: int) -> int:
        """What two shapes have in common when they count as the same."""
        if self.config.duplicates == "histogram":
            return self.histogram(types)
        return graph if self.config.duplicates == "graph" else docked

    def histogram(self, types: np.ndarray) -> int:
        """A hash of a type histogram, of meshes also where types go by meaning: what looks different is new."""
        return int(self._histogram_weights[types].sum(dtype=np.uint64))

    def _cell(self, features: Float32Array) -> Cell:
        return cell_of(features, self.config.novelty.axes, self.config.novelty.resolution)

    def _answered_by(self, look: Callable[..., int]) -> int:
        """What a look at all contacts of the variant in hand says, and again after answering those not known."""
        while True:
            outcome = look(self.tables, self.answers.table, self._ws)
            if outcome != Outcome.UNKNOWN:
                return outcome
            if not self.answers.answer_unknown(self._ws, int(self._ws.counts[UNKNOWNS])):
                return Outcome.CLASH

    def _poses(self) -> FloatArray:
        """The poses (n, 4, 4) of the variant in hand."""
        parts = self._ws.counts[PARTS]
        poses = np.tile(np.eye(4), (parts, 1, 1))
        poses[:, :3, :3] = self._ws.rotations[:parts]
        poses[:, :3, 3] = self._ws.translations[:parts]
        return poses

    def _is_connected(self) -> bool:
        """Whether the variant in hand is in one piece."""
        ws = self._ws
        near: list[list[int]] = [[] for _ in range(ws.counts[PARTS])]
        for i, j in ws.edges[: ws.counts[EDGES]].tolist():
            near[i].append(j)
            near[j].append(i)
        reached, waiting = {0}, [0]
        while waiting:
            fresh = [each for each in near[waiting.pop()] if each not in reached]
            reached.update(fresh)
            waiting += fresh
        return len(reached) == len(near)

    def _assembly(self) -> Assembly:
        """The variant in hand."""
        ws = self._ws
        parts, count = int(ws.counts[PARTS]), int(ws.counts[EDGES])
        edges = np.sort(ws.edges[:count], axis=1)
        edges = edges[np.lexsort((edges[:, 1], edges[:, 0]))].astype(np.int32)
        return Assembly(ws.types[:parts].astype(np.int16), self._poses(), edges, self._stretches)

    def _variant(self, origins: np.ndarray, lineage: dict[str, Any], graph: int, docked: int) -> Variant:
        assembly, label = self._assembly(), self._ws.label
        i, j = assembly.edges[:, 0], assembly.edges[:, 1]
        labels = np.stack([label[i, j], label[j, i]], axis=1)
        copied = self._copies.copied(assembly, labels)
        # A part whose neighbourhood tells its exemplar is of that one, whichever copy of it a piece brought along.
        marks = self._features.marks(assembly)
        origins = np.where(marks >= 0, marks, origins)
        shares = material_shares(origins, len(self.kit.exemplars))
        features = self._features.features(assembly, shares, marks, copied.largest)
        return Variant(
            assembly,
            labels.astype(np.int32),
            graph,
            docked,
            origins,
            features,
            self._cell(features),
            self.histogram(assembly.types),
            {**lineage, "copied": copied.described()},
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
