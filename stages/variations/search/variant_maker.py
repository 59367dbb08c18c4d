"""One try of an operator (exchange, substitution, replacement, growth, rows), and what every variant must pass."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from stages.rows.changes import changes_text
from stages.shape.arrays import Float32Array, FloatArray
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
from stages.variations.kernels.operators import REPEATED_UNIT, SUBSTITUTION
from stages.variations.kernels.outcomes import Outcome
from stages.variations.kernels.structs import N_PARTS
from stages.variations.kernels.tables import kit_tables, multiset_weights, resolve_unknown, workspace
from stages.variations.novelty.archive import Cell, cell_of_features
from stages.variations.novelty.copied_pieces import CopyDetector
from stages.variations.novelty.features import FeatureExtractor, material_shares
from stages.variations.requirements.stretched_contacts import broken_contact
from stages.variations.search.draft import (
    draft_assembly,
    draft_descent,
    draft_poses,
    is_connected,
    load_shape,
    start_draft,
)
from stages.variations.search.operator_selection import PlannedTry
from stages.variations.search.parents import Parent
from stages.variations.search.row_variants import ChangedRows
from stages.variations.search.variant import (
    DISCONNECTED,
    DUPLICATE,
    GROWTH_REASONS,
    LIFTED,
    REASONS,
    REPLACEMENT_REASONS,
    SUBASSEMBLY,
    UNATTACHED,
    Variant,
)
from stages.variations.settings import SearchConfig
from stages.variations.substitution.attachment import AttachmentTest
from stages.variations.substitution.ground import GroundTest
from stages.variations.substitution.substitute import substitute
from stages.variations.substructures.replacer import Replacer

ANY_SHARE = (0.0, np.inf)
"""Bounds of a label that is free."""
NOT_MOVED = [*np.eye(3).tolist(), [0.0, 0.0, 0.0]]
"""The transform of lineages in which no piece moves."""


class VariantMaker:
    """Makes variants of one kit, one a call; it remembers which shapes are known.

    slots: what the kit shows of slots, where its grammar is one of slots and they were computed already
    copies: the detector of copies from its exemplars, where it was computed already
    shares: smallest and largest share of the parts that each label may have, from `share_bounds`; None: any. May be
        changed in place.
    """

    def __init__(
        self,
        oracle: ContactOracle,
        config: SearchConfig,
        slots: SlotGrammar | None,
        copies: CopyDetector | None,
        shares: FloatArray | None = None,
    ) -> None:
        kit = oracle.kit
        self.kit, self.oracle, self.config = kit, oracle, config
        sizes = [len(exemplar.assembly) for exemplar in kit.exemplars]
        self.min_parts = max(2, round(config.min_size * min(sizes)))
        self.max_parts = max(3, round(config.max_size * max(sizes)))
        self._sizes = np.array(sizes)
        self._has = np.array([np.isin(np.arange(len(kit.types)), shape.assembly.types) for shape in kit.exemplars])
        self.shares = shares
        self.tables = kit_tables(kit, config.upright, None if shares is None else shares.copy())
        self._histogram_weights = multiset_weights(len(kit.types))
        self.ws = workspace(max(self.max_parts, *sizes))
        self._stretches: FloatArray | None = None
        self._with_labels = config.duplicates == "docking"
        slotted = kit.grammar.strictness in SLOT_LEVELS
        self._slots = (slots or SlotGrammar(kit, oracle.dockings, config.upright)) if slotted else None
        limits = self.min_parts, self.max_parts
        self._grower = self._replacer = None
        if config.method in ("both", "growth", "all"):
            grown = config.grown
            self._grower = Grower(oracle, self.tables, *limits, self._slots, grown.parts, grown.footprint)
        if config.method in ("substructures", "all"):
            self._replacer = Replacer(oracle, self.tables, *limits, config)
        by_meaning = kit.by_meaning and config.upright
        self._ground = GroundTest(kit, oracle.dockings.reach / 2) if by_meaning else None
        self._attachment = AttachmentTest(kit, oracle.dockings.reach / 2) if by_meaning else None
        self._features = FeatureExtractor(kit)
        self._copies = copies or CopyDetector(kit, oracle.dockings)
        self.seen: set[int] = set()
        self._exemplars: Sequence[Parent] = ()

    def remember_exemplars(self, exemplars: Sequence[Parent]) -> None:
        """Let the exemplars be known; no variant may be a piece of one unless the config allows it."""
        self._exemplars = exemplars
        for exemplar in exemplars:
            self.remember(exemplar.assembly.types, *self.keys_of(exemplar))

    def remember(self, types: np.ndarray, graph: int, docked: int) -> None:
        """Let a shape of these types and keys be known, so that it is a duplicate when it is found again."""
        self.seen.add(self.key(types, graph, docked))
        if self._replacer is not None:
            self._replacer.known.add(docked)

    def key(self, types: np.ndarray, graph: int, docked: int) -> int:
        """Return what two shapes have in common when they count as the same."""
        if self.config.duplicates == "histogram":
            return self.histogram(types)
        return graph if self.config.duplicates == "graph" else docked

    def histogram(self, types: np.ndarray) -> int:
        """Return a hash of a type histogram, by meshes even with `types: meaning`: what looks different is new."""
        return int(self._histogram_weights[types].sum(dtype=np.uint64))

    def enforce_shares(self, enforced: bool) -> None:
        """Refuse drafts that do not keep `shares` from now on, or let them pass."""
        if self.shares is not None:
            self.tables.shares[:] = self.shares if enforced else ANY_SHARE

    def draft_label_counts(self) -> np.ndarray:
        """Return the number of parts of the draft by label, int64 (labels,)."""
        types = self.ws.types[: self.ws.counts[N_PARTS]]
        return np.bincount(self.kit.label_of[types], minlength=len(self.kit.labels))

    def keys_of(self, shape: Parent) -> tuple[int, int]:
        """Return the two refinement keys of a shape."""
        load_shape(self.ws, shape)
        return self._graph_keys()

    def exemplar_features(self, number: int) -> Float32Array:
        """Return the features of an exemplar, float32 (10,)."""
        assembly = self.kit.exemplars[number].assembly
        shares = np.eye(len(self.kit.exemplars))[number]
        return self._features.features(assembly, shares, self._features.marks(assembly), 1.0)

    def cell(self, features: Float32Array) -> Cell:
        """Return the cell of features in the archive."""
        return cell_of_features(features, self.config.novelty.axes, self.config.novelty.resolution)

    @property
    def lists(self) -> Counter[str]:
        """The number of lists of replacements, by whether each was `whole` or `cut short`."""
        return Counter() if self._replacer is None else self._replacer.lists

    def exchange(self, rng: np.random.Generator, planned: PlannedTry) -> Variant | str:
        """Exchange or substitute a piece; return a new variant, or the reason for a failure."""
        a, b, ws, kit = planned.a, planned.b, self.ws, self.tables
        limits, contacts = (self.min_parts, self.max_parts), self.oracle.table
        substituted = planned.operator == SUBSTITUTION
        if substituted:
            outcome, key = substitute(rng, self.kit, kit, self.oracle.dockings, a, b, ws, *limits), 0
            if outcome == Outcome.OK:
                outcome, key = complete(kit, contacts, ws, self._with_labels)
        elif self.config.matching == "pose" or planned.operator == REPEATED_UNIT:
            outcome, key = attempt(
                rng, kit, a.tables, b.tables, a is b, contacts, ws, planned.operator, planned.large, *limits,
                self._with_labels,
            )  # fmt: skip
        else:
            outcome, key = cut_piece(rng, a.tables, b.tables, ws, planned.operator, planned.large, kit.limits[0]), 0
            if outcome == Outcome.OK:
                outcome = match_centroids(rng, kit, a.tables, b.tables, ws)
            if outcome == Outcome.OK:
                outcome = join(rng, kit, a.tables, b.tables, ws, *limits)
            if outcome == Outcome.OK:
                if not correct_orientations(self.oracle.dockings, ws):
                    return "orientation cannot be corrected"
                outcome, key = complete(kit, contacts, ws, self._with_labels)
        outcome, key = self._resolved(outcome, key)
        if outcome != Outcome.OK:
            return REASONS[outcome]
        if substituted and not is_connected(ws):
            return DISCONNECTED
        return self._finished(int(key), *draft_descent(ws, "substitution" if substituted else "exchange", a, b))

    def replace(self, rng: np.random.Generator, planned: PlannedTry) -> tuple[Variant | str, float, PlannedTry]:
        """Replace a piece by an equivalent one.

        Return a new variant or the reason for a failure, the work, and the try that it counts for: an earlier one while
        operations of its pair are left.
        """
        assert self._replacer is not None, "no try replaces where the method forbids it"
        outcome, work = self._replacer.replace(rng, planned, self.ws)
        used = self._replacer.planned
        result = self._replaced(self._replacer, used) if outcome == Outcome.OK else REPLACEMENT_REASONS[outcome]
        self._stretches = None
        return result, work, used

    def _replaced(self, replacer: Replacer, planned: PlannedTry) -> Variant | str:
        self._stretches = replacer.stretches
        if self._stretches is not None:
            return self._stretched(replacer, planned)
        how = "deformed" if replacer.is_deformed else "replaced"
        outcome = self._resolved_by(find_contacts) if replacer.is_deformed else Outcome.OK
        if outcome == Outcome.OK:
            outcome, key = self._resolved(*complete(self.tables, self.oracle.table, self.ws, self._with_labels))
        if outcome != Outcome.OK:
            return f"{how}: {REASONS[outcome]}"
        if not replacer.is_joined(self.ws):
            return f"{how}: contact lost"
        return self._replacement(replacer, int(key), planned)

    def _stretched(self, replacer: Replacer, planned: PlannedTry) -> Variant | str:
        """Finish a stretched piece: its contacts are those of the operation, tested on the meshes in the end."""
        replacer.predict(self.ws)
        labelled, grammar = self.kit.labelled(draft_assembly(self.ws, self._stretches)), self.kit.grammar
        around = zip(labelled.types.tolist(), labelled.neighbours(), strict=True)
        if not all(admits(grammar, label, labelled.multiset(near)) for label, near in around):
            return f"stretched: {REASONS[Outcome.GRAMMAR]}"
        return self._replacement(replacer, self._graph_keys()[int(self._with_labels)], planned)

    def _replacement(self, replacer: Replacer, key: int, planned: PlannedTry) -> Variant | str:
        if not is_connected(self.ws):
            return DISCONNECTED
        origins, lineage = draft_descent(self.ws, "substructures", planned.a, replacer.base)
        lineage |= {"repeats": replacer.repeats, "deformed": replacer.is_deformed}
        return self._finished(key, origins, lineage)

    def grow(self, rng: np.random.Generator) -> tuple[Variant | str, float]:
        """Grow a shape; return a new variant or the reason for a failure, and the work."""
        assert self._grower is not None, "no try grows where the method forbids it"
        ws = self.ws
        outcome, work = self._grower.grow(rng, ws)
        if outcome != Outcome.OK:
            return GROWTH_REASONS.get(outcome, REASONS[outcome]), work
        origins = ws.origin[: ws.counts[N_PARTS]].astype(np.int8)
        ws.origin[: ws.counts[N_PARTS]] = 2  # no contact between two shapes is left to be found
        outcome, key = complete(self.tables, self.oracle.table, ws, self._with_labels)
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
            "transform": NOT_MOVED,
            "repeats": 1,
            "deformed": False,
        }
        return self._finished(int(key), origins, lineage), work

    def with_rows(self, changed: ChangedRows) -> Variant | str:
        """Return an exemplar with other rows as a new variant, or the reason for a failure."""
        assembly, number = changed.assembly, changed.exemplar
        if len(assembly) > self.max_parts:
            return f"rows: {REASONS[Outcome.TOO_LARGE]}"
        if len(assembly) < self.min_parts:
            return f"rows: {REASONS[Outcome.TOO_SMALL]}"
        labels = self.oracle.dockings.label_edges(assembly.types, assembly.poses, assembly.edges)
        start_draft(self.ws, self.tables, assembly, labels)
        outcome, key = complete(self.tables, self.oracle.table, self.ws, self._with_labels)
        if outcome != Outcome.OK:
            return f"rows: {REASONS[outcome]}"
        if not is_connected(self.ws):
            return DISCONNECTED
        lineage = {
            "method": "rows",
            "parents": [self.kit.exemplars[number].name],
            "parts_from": [len(assembly)],
            "boundary": [int(changed.origins[0])],
            "images": [0],
            "transform": NOT_MOVED,
            "repeats": 1,
            "deformed": False,
            "rows": changes_text(changed.changes),
        }
        return self._finished(int(key), np.full(len(assembly), number, dtype=np.int8), lineage)

    def _finished(self, key: int, origins: np.ndarray, lineage: dict[str, Any]) -> Variant | str:
        """Return the draft, with parts from the exemplars `origins`, as a new variant, or why it is refused."""
        ws = self.ws
        types = ws.types[: ws.counts[N_PARTS]]
        if (self.histogram(types) if self.config.duplicates == "histogram" else key) in self.seen:
            return DUPLICATE
        if len(types) > self._max_parts_of(types) and not (lineage["method"] == "growth" and self.config.grown.parts):
            return REASONS[Outcome.TOO_LARGE]
        if not self.config.sub_assemblies and any(lies_in(self.tables, ws, shape.tables) for shape in self._exemplars):
            return SUBASSEMBLY
        assembly = draft_assembly(ws, self._stretches)
        placed = draft_poses(ws) if self._stretches is None else assembly.placements
        if self._ground is not None and self._ground.is_lifted(types, placed):
            return LIFTED
        if self._attachment is not None and self._attachment.is_loose(assembly):
            return UNATTACHED
        fault = None if self._stretches is None else broken_contact(self.kit, assembly)
        if fault is not None:
            return f"stretched: {fault}"
        outcome = self._resolved_by(validate) if self._stretches is None else Outcome.OK
        if outcome != Outcome.OK:
            return REASONS[outcome]
        if self._slots is not None and not self._slots.admits_all(assembly):
            return REASONS[Outcome.GRAMMAR]
        return self._variant(assembly, origins, lineage)

    def _variant(self, assembly: Assembly, origins: np.ndarray, lineage: dict[str, Any]) -> Variant:
        graph, docked = self._graph_keys()
        i, j = assembly.edges[:, 0], assembly.edges[:, 1]
        labels = np.stack([self.ws.label[i, j], self.ws.label[j, i]], axis=1)
        copied = self._copies.copied(assembly, labels)
        # A part whose neighbourhood only one exemplar shows is of that exemplar, whatever copy a piece brought along.
        marks = self._features.marks(assembly)
        origins = np.where(marks >= 0, marks, origins)
        shares = material_shares(origins, len(self.kit.exemplars))
        features = self._features.features(assembly, shares, marks, copied.largest)
        return Variant(
            assembly=assembly,
            labels=labels.astype(np.int32),
            graph=graph,
            docked=docked,
            origins=origins,
            features=features,
            cell=self.cell(features),
            histogram=self.histogram(assembly.types),
            lineage={**lineage, "copied": copied.described()},
        )

    def _max_parts_of(self, types: np.ndarray) -> int:
        """Return the maximum number of parts of a shape of the types (n,).

        It is set by the largest exemplar that has all of them: a row of one exemplar's parts must not grow with another
            exemplar. Where none has all, it is `max_parts`.
        """
        whole = self._has[:, np.unique(types)].all(axis=1)
        return max(3, round(self.config.max_size * self._sizes[whole].max())) if whole.any() else self.max_parts

    def _resolved(self, outcome: int, key: int) -> tuple[int, int]:
        """Return outcome and key of a completed draft once the oracle has answered for all unknown contacts."""
        while outcome == Outcome.UNKNOWN:
            if not resolve_unknown(self.oracle, self.ws):
                return Outcome.CLASH, 0
            outcome, key = complete(self.tables, self.oracle.table, self.ws, self._with_labels)
        return outcome, key

    def _resolved_by(self, look: Callable[..., int]) -> int:
        """Return the outcome of a test of all contacts of the draft once the oracle has answered for unknown ones."""
        while True:
            outcome = look(self.tables, self.oracle.table, self.ws)
            if outcome != Outcome.UNKNOWN:
                return outcome
            if not resolve_unknown(self.oracle, self.ws):
                return Outcome.CLASH

    def _graph_keys(self) -> tuple[int, int]:
        """Return the refinement keys of the draft, without and with docking labels."""
        label_of = self.tables.label_of
        return int(graph_key(label_of, self.ws, False)), int(graph_key(label_of, self.ws, True))
