"""The strings of a kit's shapes, and which of their contacts are edges of the strings.

They are all contacts, as published; or face contacts, or a spanning tree (strings §7, brick buildings), since strings
with hundreds of cycles cannot be learned.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from stages.shape.arrays import IntArray
from stages.shape.geometry.contact import ContactTest
from stages.shape.geometry.docking import DockingTable
from stages.shape.geometry.pose import relative_poses
from stages.shape.graphs.canonical import canonical_order
from stages.shape.kit import Assembly, ContactKind, Kit
from stages.strings.decoder import decode
from stages.strings.encoder import Encoded, canonical_string, random_strings
from stages.strings.settings import Edges
from stages.strings.tokens import Alphabet, make_alphabet

_KIND_RANK: dict[ContactKind | None, int] = {"face": 0, "line": 1, "point": 2, None: 2}


class KitStrings:
    """Strings of shapes of one kit, with the contacts of `edges`."""

    def __init__(self, kit: Kit, edges: Edges) -> None:
        self.kit, self.edges = kit, edges
        self.alphabet: Alphabet = make_alphabet(kit.labels)

    def graph(self, assembly: Assembly) -> Assembly:
        """Return an assembly of part labels, with the contacts that its strings contain.

        For `tree` it has all contacts: each string draws its own spanning tree.
        """
        labelled = self.kit.labelled(assembly)
        if self.edges != "faces":
            return labelled
        return Assembly(labelled.types, labelled.poses, self._connecting_contacts(assembly))

    def strings(self, graph: Assembly, count: int, rng: np.random.Generator) -> list[Encoded]:
        """Return the canonical string of a `graph` result, and at most `count` distinct random ones.

        Raises NotConnectedError for a graph that is not connected.
        """
        cycles = self.edges != "tree"
        first = canonical_string(graph.types, graph.edges, self.alphabet, cycles)
        others = random_strings(graph.types, graph.edges, self.alphabet, count, rng, {first.string}, cycles)
        return [first, *others]

    def represents(self, encoded: Encoded, graph: Assembly) -> bool:
        """Return whether a string decodes to a `graph` result, by the encoder's matching of nodes.

        For `tree` it must be a spanning tree.
        """
        decoded, size = decode(encoded.string, self.alphabet), len(graph)
        if sorted(encoded.nodes.tolist()) != list(range(size)):
            return False
        if not np.array_equal(decoded.types, graph.types[encoded.nodes]):
            return False
        edges = np.sort(encoded.nodes[decoded.edges], axis=1) @ (size, 1)
        expected = np.sort(graph.edges, axis=1) @ (size, 1)
        if self.edges == "tree":
            # a string is connected, so with n - 1 edges it is a tree
            return len(edges) == size - 1 and bool(np.isin(edges, expected).all())
        return np.array_equal(np.sort(edges), np.sort(expected))

    def _connecting_contacts(self, assembly: Assembly) -> IntArray:
        """Return the face contacts of an assembly, and the line, then point contacts that first join its components.

        Ties follow the order of the canonical graph.
        """
        from stages.strings.traversal import first_edges_tree

        edges = assembly.edges
        strength = np.array([_KIND_RANK[kind] for kind in self._kinds(assembly)], dtype=np.int64)
        labels = np.stack([strength, strength], axis=1).astype(np.int32)
        rank = np.argsort(canonical_order(self.kit.label_of[assembly.types], edges, labels))
        ends = np.sort(rank[edges], axis=1)
        order = np.lexsort((ends[:, 1], ends[:, 0], strength))
        tree = first_edges_tree(len(assembly), edges.astype(np.int64), order)
        kept: IntArray = edges[(strength == 0) | tree]
        return kept

    def _kinds(self, assembly: Assembly) -> list[ContactKind | None]:
        """Return the kind of each contact: that of its docking, or of the contact itself if the kit has none.

        The kit has no docking for some contacts of restored hubs.
        """
        dockings = self.kit.grammar.dockings
        labels = self.table.label_edges(assembly.types, assembly.poses, assembly.edges)[:, 0].tolist()
        poses = relative_poses(assembly.poses, assembly.edges)
        kinds: list[ContactKind | None] = []
        for (i, j), label, pose in zip(assembly.edges.tolist(), labels, poses, strict=True):
            a, b = int(assembly.types[i]), int(assembly.types[j])
            fit = self.table.fit(a, b, pose) if label < 0 else (label, label)
            kinds.append(self._contact.kind(a, b, pose) if fit is None else dockings[fit[0] // 2].kind)
        return kinds

    @cached_property
    def table(self) -> DockingTable:
        """The dockings of the kit."""
        return DockingTable.of(self.kit)

    @cached_property
    def _contact(self) -> ContactTest:
        return ContactTest(self.kit.types, self.kit.contact_tolerance)
