"""A shape graph to a shape: types, poses, and contacts that are its edges (strings §6)."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.components import connected_components
from stages.shape.geometry.contact_lookup import FORBIDDEN_CONTACT, NO_CONTACT
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.neighbourhoods import SLOT_LEVELS, admits
from stages.shape.graphs.slots import SlotGrammar
from stages.shape.kit import Assembly
from stages.string_sampling.instantiation.guidance import WITHOUT_GUIDE, Guide
from stages.string_sampling.instantiation.placements import find_placements
from stages.string_sampling.instantiation.reach import new_reach
from stages.string_sampling.instantiation.solver import BUDGET, IMPOSSIBLE, NO_ROOM, SOLVED, solve
from stages.string_sampling.instantiation.state import STANDARD_METHOD, TRIES, SolverMethod, graph_tables, new_state
from stages.strings.compiled_grammar import compile_grammar
from stages.variations.growth.state import KnownContacts
from stages.variations.kernels.tables import kit_tables

MIN_NODES = 64
"""There is always room for graphs of so many nodes."""
VALUES_PER_NODE = 256
"""Room for values in the mean; a node has as many as there are places beside one part."""
MAX_SLOT_ARRANGEMENTS = 16
"""Arrangements at most that are held against a grammar of slots."""

NOT_CONNECTED, NOT_ADMITTED = "not in one piece", "neighbourhood not in the grammar"
REASONS = {
    IMPOSSIBLE: "no arrangement",
    BUDGET: "budget spent",
    NO_ROOM: "too many places for parts",
}
CLASH, SLOTS = "contacts are not the edges", "slots not in the grammar"


@dataclass(frozen=True)
class Instantiation:
    """assembly: its parts in the order of the graph's nodes, or None, and why; tries: parts that were put down."""

    assembly: Assembly | None
    reason: str
    tries: int

    @property
    def is_impossible(self) -> bool:
        """Whether no arrangement of the graph is left, as far as the kit's known places go."""
        return self.reason == REASONS[IMPOSSIBLE]


class Instantiator:
    """Puts graphs of one kit together; what it learns of contacts is kept from graph to graph and changes no answer."""

    def __init__(self, answers: ContactOracle, upright: bool = True) -> None:
        kit = answers.kit
        self.kit, self.answers, self.upright = kit, answers, upright
        self.candidates = find_placements(kit, upright)
        self._tables = kit_tables(kit, upright)
        self._rules = compile_grammar(kit.grammar, len(kit.labels), 0, partial=True)
        self._reach = new_reach(len(self.candidates.stance_types))
        slotted = kit.grammar.strictness in SLOT_LEVELS
        self._slots = SlotGrammar(kit, answers.dockings, upright) if slotted else None
        self._room(MIN_NODES)

    def _room(self, nodes: int) -> None:
        """Make room for graphs of so many nodes."""
        self._s = new_state(nodes, len(self.kit.labels), VALUES_PER_NODE * nodes)
        self._asker = self.answers.c_callback(self._s.types, self._s.rotations, self._s.translations)
        self._address = int(ctypes.cast(self._asker, ctypes.c_void_p).value or 0)

    def instantiate(
        self,
        labels: np.ndarray,
        edges: IntArray,
        rng: np.random.Generator,
        method: SolverMethod = STANDARD_METHOD,
        guide: Guide = WITHOUT_GUIDE,
    ) -> Instantiation:
        """Parts of `labels` (n,) whose contacts are `edges` (m, 2), i < j.

        Where `method.whole` is false the graph tells of some contacts only, and others may be there if the grammar
        admits them. A `guide` says which places are tried first.
        """
        if not len(labels) or connected_components(len(labels), np.asarray(edges)).any():
            return Instantiation(None, NOT_CONNECTED, 0)
        if method.whole and not self._admitted(labels, edges):
            return Instantiation(None, NOT_ADMITTED, 0)
        if len(labels) > len(self._s.at):
            self._room(2 * len(labels))
        # So many places whatever came before: what is answered must not hang on which graphs a worker has had.
        within = self._s._replace(types=self._s.types[: VALUES_PER_NODE * max(len(labels), MIN_NODES)])
        graph, tries = graph_tables(labels, edges), 0
        for _ in range(MAX_SLOT_ARRANGEMENTS):
            table = self.answers.table
            contacts = KnownContacts(table.keys, table.values, self._address)
            left = method._replace(budget=method.budget - tries)
            outcome = solve(
                rng, self._tables, self.candidates, self._rules, contacts, graph, guide, left, self._reach, within
            )
            self.answers.raise_pending()
            tries += int(self._s.counts[TRIES])
            if outcome != SOLVED:
                return Instantiation(None, REASONS[outcome], tries)
            assembly = self._assembly(len(labels))
            reason = self._wrong(assembly, labels, edges, method)
            if reason != SLOTS:
                return Instantiation(None if reason else assembly, reason, tries)
        return Instantiation(None, SLOTS, tries)

    def _admitted(self, labels: np.ndarray, edges: IntArray) -> bool:
        graph = Assembly(labels, np.empty((len(labels), 4, 4)), edges)
        around = graph.neighbours()
        return all(
            admits(self.kit.grammar, int(labels[part]), graph.multiset(near)) for part, near in enumerate(around)
        )

    def _assembly(self, count: int) -> Assembly:
        """What stands, with all contacts that there are."""
        s = self._s
        at = s.at[:count]
        poses = np.tile(np.eye(4), (count, 1, 1))
        poses[:, :3, :3], poses[:, :3, 3] = s.rotations[at], s.translations[at]
        types = s.types[at].astype(np.int16)
        found = [np.empty((0, 2), dtype=np.int32)]
        for part in range(1, count):
            near = np.flatnonzero(_boxes_meet(s.boxes[at[:part]], s.boxes[at[part]], 1.1 * self.kit.contact_tolerance))
            seen = self.answers.around(types[near].astype(np.int64), poses[near], int(types[part]), poses[part])
            if (seen == FORBIDDEN_CONTACT).any():
                return Assembly(types, poses, np.empty((0, 2), dtype=np.int32))
            touched = near[seen != NO_CONTACT]
            found.append(np.stack([touched, np.full_like(touched, part)], axis=1).astype(np.int32))
        edges = np.concatenate(found)
        return Assembly(types, poses, edges[np.lexsort((edges[:, 1], edges[:, 0]))])

    def _wrong(self, assembly: Assembly, labels: np.ndarray, edges: IntArray, method: SolverMethod) -> str:
        """Why an arrangement is none of the graph, or nothing."""
        n = len(labels)
        there, asked = assembly.edges @ (n, 1), np.asarray(edges) @ (n, 1)
        if not np.isin(asked, there).all() or (method.whole and len(there) != len(asked)):
            return CLASH
        if method.ended and not method.whole and not self._admitted(np.asarray(labels), assembly.edges):
            return NOT_ADMITTED
        return SLOTS if self._slots is not None and self._slots.misfits(assembly) else ""


def _boxes_meet(boxes: FloatArray, box: FloatArray, slack: float) -> np.ndarray:
    """Which of some boxes (n, 2, 3) are at most `slack` from a box (2, 3), centres and half extents, bool (n,)."""
    near: np.ndarray = (np.abs(boxes[:, 0] - box[0]) <= boxes[:, 1] + box[1] + slack).all(axis=1)
    return near
