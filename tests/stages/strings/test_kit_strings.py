"""Which contacts the strings of a real kit tell of."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import networkx as nx
import numpy as np
import pytest

from stages.exemplars.build import read_kit
from stages.exemplars.settings import STRICTEST, KitConfig
from stages.shape.geometry.contact import ContactTest
from stages.shape.geometry.pose import relative_poses
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit import Assembly, Kit
from stages.strings.decoder import decode
from stages.strings.encoder import Encoded
from stages.strings.kit_strings import KitStrings
from tests.toy_kits.chains_and_rings import Placed, box, pose, with_arrow
from tests.toy_kits.chains_and_rings import kit_of as toy_kit

EXEMPLARS = Path(__file__).resolve().parents[3] / "datasets" / "exemplars"
KITS = ("castle", "playground", "cubes")


def cubes(*places: tuple[int, int, int]) -> list[Placed]:
    """Unit cubes of two kinds, plain below and with an arrow in them above."""
    return [("arrow" if y else "plain", pose(x, y, z)) for x, y, z in places]


BLOCK = [(x, y, z) for x in range(2) for y in range(2) for z in range(2)]
STAIRS = [(0, 0, 0), (1, 0, 0), (2, 1, 0), (3, 1, 0), (4, 2, 1), (4, 3, 1)]
"""Pairs of cubes face on face, which meet along a line and in a point."""


@cache
def kit_of(name: str) -> Kit:
    if name == "cubes":
        meshes = {"plain": box(1, 1, 1), "arrow": with_arrow(box(1, 1, 1))}
        return toy_kit(meshes, [cubes(*BLOCK), cubes(*STAIRS)], ("face", "line", "point"))
    config = KitConfig(name=name, shapes=tuple(sorted((EXEMPLARS / name).glob("*.glb"))))
    return read_kit(config.resolve(STRICTEST))


def contact_kinds(kit: Kit, assembly: Assembly) -> list[str | None]:
    """The kinds of the contacts, asked of the meshes."""
    contact = ContactTest(kit.types, kit.contact_tolerance)
    poses = relative_poses(assembly.poses, assembly.edges)
    ends = assembly.types[assembly.edges].tolist()
    return [contact.kind(a, b, pose) for (a, b), pose in zip(ends, poses, strict=True)]


def shuffled(assembly: Assembly, rng: np.random.Generator) -> Assembly:
    """The same shape with its parts in another order, turned and moved as a whole."""
    order = rng.permutation(len(assembly))
    place = np.argsort(order)
    turn = np.array([[0.0, 0, 1, 3], [0, 1, 0, -2], [-1, 0, 0, 5], [0, 0, 0, 1]])
    edges = np.sort(place[assembly.edges], axis=1)
    edges = edges[np.lexsort((edges[:, 1], edges[:, 0]))].astype(np.int32)
    return Assembly(assembly.types[order], turn @ assembly.poses[order], edges)


def pairs(edges: np.ndarray) -> set[tuple[int, int]]:
    return {(int(i), int(j)) for i, j in edges}


@pytest.mark.parametrize("name", KITS)
def test_faces_stay_and_other_contacts_only_to_connect_the_shape(name: str) -> None:
    kit = kit_of(name)
    for exemplar in kit.exemplars:
        assembly = exemplar.assembly
        kept = pairs(KitStrings(kit, "faces").graph(assembly).edges)
        kinds = dict(zip(map(tuple, assembly.edges.tolist()), contact_kinds(kit, assembly), strict=True))
        faces = {edge for edge, kind in kinds.items() if kind == "face"}
        assert faces <= kept <= pairs(assembly.edges)
        joined = nx.Graph(list(faces))
        joined.add_nodes_from(range(len(assembly)))
        assert len(kept) == len(faces) + nx.number_connected_components(joined) - 1
        assert nx.is_connected(nx.Graph(list(kept)))


def test_lines_are_preferred_to_points_where_faces_do_not_connect_cubes() -> None:
    kit = kit_of("cubes")
    block, stairs = (exemplar.assembly for exemplar in kit.exemplars)
    writer = KitStrings(kit, "faces")
    assert (len(block.edges), len(writer.graph(block).edges)) == (12 + 12 + 4, 12)
    assert pairs(stairs.edges) == pairs(writer.graph(stairs).edges) == {(0, 1), (1, 2), (2, 3), (3, 4), (4, 5)}


@pytest.mark.parametrize("name", KITS)
def test_the_graph_of_faces_does_not_depend_on_order_and_pose_of_the_parts(name: str) -> None:
    kit = kit_of(name)
    writer = KitStrings(kit, "faces")
    for seed, exemplar in enumerate(kit.exemplars):
        first = writer.graph(exemplar.assembly)
        again = writer.graph(shuffled(exemplar.assembly, np.random.default_rng(seed)))
        assert graph_digest(first.types, first.edges) == graph_digest(again.types, again.edges)


@pytest.mark.parametrize("name", KITS)
@pytest.mark.parametrize("edges", ["all", "faces", "tree"])
def test_strings_decode_to_the_graph_of_their_edges(name: str, edges: str) -> None:
    kit = kit_of(name)
    writer = KitStrings(kit, edges)  # type: ignore[arg-type]
    assembly = kit.exemplars[0].assembly
    graph = writer.graph(assembly)
    strings = writer.strings(graph, 5, np.random.default_rng(1))
    assert len({encoded.string for encoded in strings}) == 6
    for encoded in strings:
        assert writer.represents(encoded, graph)
        decoded = decode(encoded.string, writer.alphabet)
        assert len(decoded.edges) == (len(assembly) - 1 if edges == "tree" else len(graph.edges))
    swapped = strings[0].nodes.copy()
    other = next(place for place in range(len(swapped)) if graph.types[swapped[place]] != graph.types[swapped[0]])
    swapped[[0, other]] = swapped[[other, 0]]
    assert not writer.represents(Encoded(strings[0].string, swapped), graph)
