"""From a shape graph to a shape: types, poses, and contacts that are its edges (strings §6)."""

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
from stages.string_sampling.instantiation.solver import Problem, solve
from stages.string_sampling.instantiation.state import (
    N_PLACEMENTS,
    STANDARD_METHOD,
    SolverMethod,
    graph_tables,
    new_state,
)
from stages.variations.growth.state import KnownContacts
from stages.variations.kernels.outcomes import Outcome
from stages.variations.kernels.tables import kit_tables

MIN_NODES = 64
"""Room for nodes from the start."""
VALUES_PER_NODE = 256
"""Mean capacity of the values of a node; a node has a value per placement next to one part."""
MAX_SLOT_ARRANGEMENTS = 16
"""Arrangements checked against a grammar of slots."""

NOT_CONNECTED, NOT_ADMITTED = "not connected", "neighbourhood not in the grammar"
REASONS = {
    Outcome.IMPOSSIBLE: "no arrangement",
    Outcome.BUDGET: "budget spent",
    Outcome.NO_ROOM: "too many placements",
}
WRONG_CONTACTS, SLOTS = "contacts are not the edges", "slots not in the grammar"


@dataclass(frozen=True)
class Instantiation:
    """The result for a graph."""

    assembly: Assembly | None
    """Its parts in the order of the graph's nodes."""
    reason: str
    """Why there is no assembly; else empty."""
    placements: int
    """Parts placed, also those taken back."""

    @property
    def is_impossible(self) -> bool:
        """Whether the search space of the kit's dockings is exhausted."""
        return self.reason == REASONS[Outcome.IMPOSSIBLE]


class Instantiator:
    """Instantiates graphs of one kit; contacts are cached from graph to graph, which changes no result."""

    def __init__(self, oracle: ContactOracle, upright: bool = True) -> None:
        kit = oracle.kit
        self.kit, self.oracle, self.upright = kit, oracle, upright
        self.placements = find_placements(kit, upright)
        self._tables = kit_tables(kit, upright)
        self._reach = new_reach(len(self.placements.orientation_types))
        slotted = kit.grammar.strictness in SLOT_LEVELS
        self._slots = SlotGrammar(kit, oracle.dockings, upright) if slotted else None
        self._make_room(MIN_NODES)

    def _make_room(self, nodes: int) -> None:
        """Make room for graphs with some number of nodes."""
        self._s = new_state(nodes, len(self.kit.labels), VALUES_PER_NODE * nodes)
        self._callback = self.oracle.c_callback(self._s.types, self._s.rotations, self._s.translations)
        self._address = int(ctypes.cast(self._callback, ctypes.c_void_p).value or 0)

    def instantiate(
        self,
        labels: np.ndarray,
        edges: IntArray,
        rng: np.random.Generator,
        method: SolverMethod = STANDARD_METHOD,
        guide: Guide = WITHOUT_GUIDE,
    ) -> Instantiation:
        """Place parts of `labels` (n,) so that their contacts are `edges` (m, 2), i < j.

        Without `method.whole` the graph has some contacts only, and the grammar decides about others. A `guide` ranks
        placements.
        """
        if not len(labels) or connected_components(len(labels), np.asarray(edges)).any():
            return Instantiation(None, NOT_CONNECTED, 0)
        if method.whole and not self._admitted(labels, edges):
            return Instantiation(None, NOT_ADMITTED, 0)
        if len(labels) > len(self._s.assigned):
            self._make_room(2 * len(labels))
        # The room depends on the graph alone, not on earlier ones: results must not depend on a worker's history.
        within = self._s._replace(types=self._s.types[: VALUES_PER_NODE * max(len(labels), MIN_NODES)])
        graph, placements = graph_tables(labels, edges), 0
        for _ in range(MAX_SLOT_ARRANGEMENTS):
            table = self.oracle.table
            contacts = KnownContacts(table.keys, table.values, self._address)
            left = method._replace(budget=method.budget - placements)
            problem = Problem(self._tables, self.placements, contacts, graph, guide, left, self._reach)
            outcome = solve(rng, problem, within)
            self.oracle.raise_pending()
            placements += int(self._s.counts[N_PLACEMENTS])
            if outcome != Outcome.SOLVED:
                return Instantiation(None, REASONS[outcome], placements)
            assembly = self._placed_assembly(len(labels))
            reason = self._mismatch(assembly, labels, edges, method)
            if reason != SLOTS:
                return Instantiation(None if reason else assembly, reason, placements)
        return Instantiation(None, SLOTS, placements)

    def _admitted(self, labels: np.ndarray, edges: IntArray) -> bool:
        graph = Assembly(labels, np.empty((len(labels), 4, 4)), edges)
        around = graph.neighbours()
        return all(
            admits(self.kit.grammar, int(labels[part]), graph.multiset(near)) for part, near in enumerate(around)
        )

    def _placed_assembly(self, count: int) -> Assembly:
        """Return the placed parts with all their contacts."""
        s = self._s
        values = s.assigned[:count]
        poses = np.tile(np.eye(4), (count, 1, 1))
        poses[:, :3, :3], poses[:, :3, 3] = s.rotations[values], s.translations[values]
        types = s.types[values].astype(np.int16)
        contacts = [np.empty((0, 2), dtype=np.int32)]
        for part in range(1, count):
            near = np.flatnonzero(
                _boxes_meet(s.boxes[values[:part]], s.boxes[values[part]], 1.1 * self.kit.contact_tolerance)
            )
            kinds = self.oracle.around(types[near].astype(np.int64), poses[near], int(types[part]), poses[part])
            if (kinds == FORBIDDEN_CONTACT).any():
                return Assembly(types, poses, np.empty((0, 2), dtype=np.int32))
            touched = near[kinds != NO_CONTACT]
            contacts.append(np.stack([touched, np.full_like(touched, part)], axis=1).astype(np.int32))
        edges = np.concatenate(contacts)
        return Assembly(types, poses, edges[np.lexsort((edges[:, 1], edges[:, 0]))])

    def _mismatch(self, assembly: Assembly, labels: np.ndarray, edges: IntArray, method: SolverMethod) -> str:
        """Return why an arrangement does not realize the graph, or an empty text."""
        n = len(labels)
        contacts, wanted = assembly.edges @ (n, 1), np.asarray(edges) @ (n, 1)
        if not np.isin(wanted, contacts).all() or (method.whole and len(contacts) != len(wanted)):
            return WRONG_CONTACTS
        if method.ended and not method.whole and not self._admitted(np.asarray(labels), assembly.edges):
            return NOT_ADMITTED
        return SLOTS if self._slots is not None and self._slots.misfits(assembly) else ""


def _boxes_meet(boxes: FloatArray, box: FloatArray, slack: float) -> np.ndarray:
    """Return which boxes (n, 2, 3) are within `slack` of a box (2, 3), centres and half extents, bool (n,)."""
    near: np.ndarray = (np.abs(boxes[:, 0] - box[0]) <= boxes[:, 1] + box[1] + slack).all(axis=1)
    return near
