"""Graphs become shapes: possible ones are found, impossible ones are detected, and meshes decide."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stages.shape.arrays import IntArray
from stages.shape.assembly_faults import assembly_faults
from stages.shape.geometry.contact import ContactTest
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.geometry.docking import DockingTable, symmetric_images
from stages.shape.geometry.pose import invert
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit import Assembly, Kit
from stages.string_sampling.instantiation import instantiate
from stages.string_sampling.instantiation.instantiate import Instantiation, Instantiator
from stages.string_sampling.instantiation.state import STANDARD_METHOD, SolverMethod
from stages.strings.decoder import decode
from stages.strings.kit_strings import KitStrings
from tests.toy_kits.chains_and_rings import CHAIN, ROAD, Placed, box, chain, kit_of, pose, ring


@pytest.fixture(scope="module")
def roads() -> Instantiator:
    return Instantiator(ContactOracle(kit_of(ROAD, [ring(1, 1), ring(2, 3)])))


@pytest.fixture(scope="module")
def chains() -> Instantiator:
    return Instantiator(ContactOracle(kit_of(CHAIN, [chain(2), chain(3)])))


@pytest.fixture(scope="module")
def ungoverned(roads: Instantiator) -> Instantiator:
    """A kit whose parts may have any neighbours, as hubs may."""
    grammar = replace(roads.kit.grammar, hubs=tuple(range(len(roads.kit.types))))
    return Instantiator(ContactOracle(replace(roads.kit, grammar=grammar)))


def labels(kit: Kit, names: Sequence[str]) -> np.ndarray:
    return np.array([kit.labels.index(name) for name in names], dtype=np.int16)


def cycle(count: int) -> IntArray:
    return np.array([(0, 1), (0, count - 1), *((i, i + 1) for i in range(1, count - 1))], dtype=np.int32)


def path(count: int) -> IntArray:
    return np.array([(i, i + 1) for i in range(count - 1)], dtype=np.int32).reshape(-1, 2)


def loop(width: int, depth: int) -> list[str]:
    """The tiles along a ring."""
    return [name for side in (width, depth) * 2 for name in ("corner", *["straight"] * side)]


def instantiate_names(
    maker: Instantiator, names: Sequence[str], edges: IntArray, method: SolverMethod = STANDARD_METHOD, seed: int = 0
) -> Instantiation:
    return maker.instantiate(labels(maker.kit, names), edges, np.random.default_rng(seed), method)


@settings(deadline=None, max_examples=15)
@given(width=st.integers(1, 3), depth=st.integers(1, 3), shift=st.integers(0, 30), seed=st.integers(0, 5))
def test_ring_closes_from_any_start(roads: Instantiator, width: int, depth: int, shift: int, seed: int) -> None:
    names = loop(width, depth)
    names = [*names[shift % len(names) :], *names[: shift % len(names)]]
    edges = cycle(len(names))
    found = instantiate_names(roads, names, edges, seed=seed)
    assert found.assembly is not None, found.reason
    assert found.assembly.edges.tolist() == edges.tolist()
    assert roads.kit.label_of[found.assembly.types].tolist() == labels(roads.kit, names).tolist()
    assert assembly_faults(roads.kit, found.assembly) == []
    assert found.placements <= 3 * len(names)


@pytest.mark.parametrize(
    "names",
    [
        ["corner", "straight"] * 3,
        ["corner", "straight", "corner", "straight", "straight", "corner", "straight", "corner", "straight"],
        ["straight"] * 8,
    ],
    ids=["three corners", "sides of different lengths", "no corner"],
)
def test_unclosable_ring_is_impossible(roads: Instantiator, names: list[str]) -> None:
    found = instantiate_names(roads, names, cycle(len(names)))
    assert (found.assembly, found.reason) == (None, "no arrangement")


@pytest.mark.parametrize("links", [2, 3, 6])
def test_chain_needs_one_placement_per_link(chains: Instantiator, links: int) -> None:
    names = ["cap", *["link"] * links, "cap"]
    found = instantiate_names(chains, names, path(len(names)))
    assert found.assembly is not None
    assert found.placements == len(names)
    spans = found.assembly.poses[:, :3, 3]
    assert np.linalg.norm(spans[-1] - spans[0]) == pytest.approx(links + 0.5, abs=1e-6)
    assert assembly_faults(chains.kit, found.assembly) == []


def test_exemplars_are_recovered_from_their_graphs(roads: Instantiator) -> None:
    for exemplar in roads.kit.exemplars:
        graph = roads.kit.labelled(exemplar.assembly)
        found = roads.instantiate(graph.types, graph.edges, np.random.default_rng(1))
        assert found.assembly is not None
        again = roads.kit.labelled(found.assembly)
        assert graph_digest(again.types, again.edges) == graph_digest(graph.types, graph.edges)


def test_disconnected_and_refused_graphs_have_a_reason(chains: Instantiator) -> None:
    two = instantiate_names(
        chains, ["cap", "link", "cap", "cap", "link", "cap"], np.array([[0, 1], [1, 2], [3, 4], [4, 5]])
    )
    assert two == Instantiation(None, "not connected", 0)
    bare = instantiate_names(chains, ["cap", "link"], path(2))
    assert bare == Instantiation(None, "neighbourhood not in the grammar", 0)


def test_spanning_tree_of_ring_becomes_the_ring(roads: Instantiator) -> None:
    """A string that tells of no cycle: the contact that it leaves out is found, for without it two tiles lack one."""
    names = loop(2, 1)
    found = instantiate_names(roads, names, path(len(names)), SolverMethod(whole=False))
    assert found.assembly is not None, found.reason
    assert len(found.assembly.edges) == len(names)
    assert assembly_faults(roads.kit, found.assembly) == []


def test_strings_of_exemplars_become_shapes_with_any_edges(roads: Instantiator) -> None:
    for edges in ("all", "faces", "tree"):
        writer = KitStrings(roads.kit, edges)
        graph = writer.graph(roads.kit.exemplars[1].assembly)
        string = writer.strings(graph, 0, np.random.default_rng(0))[0].string
        decoded = decode(string, writer.alphabet)
        found = roads.instantiate(
            decoded.types, decoded.edges, np.random.default_rng(0), SolverMethod(whole=edges == "all")
        )
        assert found.assembly is not None


def test_earlier_graphs_do_not_change_a_result(roads: Instantiator) -> None:
    fresh = Instantiator(ContactOracle(roads.kit))
    names = loop(3, 2)
    one, other = (instantiate_names(kit, names, cycle(len(names)), seed=3) for kit in (roads, fresh))
    assert one.placements == other.placements
    assert one.assembly is not None
    assert other.assembly is not None
    assert one.assembly.poses.tobytes() == other.assembly.poses.tobytes()


def test_room_depends_on_the_graph_alone(roads: Instantiator, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(instantiate, "VALUES_PER_NODE", 1)
    monkeypatch.setattr(instantiate, "MIN_NODES", 1)
    fresh, used = (Instantiator(ContactOracle(roads.kit)) for _ in range(2))
    used._make_room(400)
    names = loop(3, 2)
    reasons = {instantiate_names(kit, names, cycle(len(names)), seed=3).reason for kit in (fresh, used)}
    assert reasons == {"too many placements"}


@pytest.mark.parametrize("switch", ["constrained", "backtracks", "closes"])
def test_steps_beyond_the_paper_are_optional(roads: Instantiator, switch: str) -> None:
    names = loop(1, 1)
    found = instantiate_names(roads, names, cycle(len(names)), SolverMethod(**{switch: False}, budget=20_000))
    assert found.assembly is not None, found.reason
    assert assembly_faults(roads.kit, found.assembly) == []


FENCE = {"post": box(1.0, 1.5, 1.0), "wall": box(2.0, 1.2, 0.4)}


def fence(width: int, depth: int) -> list[Placed]:
    """Posts at the corners of a rectangle and along its sides, three apart, and walls between them."""
    corners = [(0, 0), (width, 0), (width, depth), (0, depth), (0, 0)]
    parts: list[Placed] = []
    for (x, z), (end_x, end_z) in pairwise(corners):
        step_x, step_z = np.sign(end_x - x), np.sign(end_z - z)
        for _ in range(abs(end_x - x) + abs(end_z - z)):
            parts.append(("post", pose(3 * x, 0, 3 * z)))
            parts.append(("wall", pose(3 * x + 1.5 * step_x, 0, 3 * z + 1.5 * step_z, int(step_z != 0))))
            x, z = x + step_x, z + step_z
    return parts


@pytest.fixture(scope="module")
def fences() -> Instantiator:
    """Walls leave a post on any of its sides: a graph does not say where a ring turns."""
    return Instantiator(ContactOracle(kit_of(FENCE, [fence(1, 1), fence(2, 1)])))


def test_look_ahead_to_cycles_saves_placements(fences: Instantiator) -> None:
    names = ["post", "wall"] * 14
    placements = {
        closes: [
            instantiate_names(
                fences, names, cycle(len(names)), SolverMethod(closes=closes, budget=20_000), seed
            ).placements
            for seed in range(5)
        ]
        for closes in (True, False)
    }
    assert max(placements[True]) < 20 * len(names)
    assert 2 * sum(placements[True]) < sum(placements[False])


@pytest.mark.parametrize(("posts", "reason"), [(4, ""), (6, ""), (5, "no arrangement"), (7, "no arrangement")])
def test_fence_of_unit_walls_needs_an_even_number(fences: Instantiator, posts: int, reason: str) -> None:
    found = instantiate_names(fences, ["post", "wall"] * posts, cycle(2 * posts))
    assert found.reason == reason


def test_random_assembly_is_rarely_a_shape(roads: Instantiator) -> None:
    """Figure 8: the chance that all dockings are right falls with each part."""
    at_random = SolverMethod(checked=False, constrained=False, backtracks=False, closes=False, budget=16)
    names = loop(2, 2)
    found = [instantiate_names(roads, names, cycle(len(names)), at_random, seed) for seed in range(40)]
    assert sum(attempt.assembly is not None for attempt in found) <= 4
    assert {attempt.reason for attempt in found if attempt.assembly is None} == {"contacts are not the edges"}
    assert all(attempt.placements == len(names) for attempt in found)


def test_budget_limits_placements(roads: Instantiator) -> None:
    found = instantiate_names(roads, loop(3, 3), cycle(16), SolverMethod(budget=7))
    assert (found.assembly, found.reason, found.placements) == (None, "budget spent", 7)


def arrangements(kit: Kit, kinds: list[int], edges: IntArray) -> Iterator[Assembly]:
    """All ways to hang each part of a tree on an earlier one, each image of each docking."""
    places: list[list[tuple[int, np.ndarray]]] = []
    for child in range(1, len(kinds)):
        parent = next(int(i) for i, j in edges.tolist() if j == child)
        poses = []
        for docking in kit.grammar.dockings:
            for a, b, at in ((docking.a, docking.b, docking.pose), (docking.b, docking.a, invert(docking.pose))):
                if (a, b) == (kinds[parent], kinds[child]):
                    poses += [(parent, pose) for pose in symmetric_images(kit.types[a], kit.types[b], at)]
        places.append(poses)
    for chosen in product(*places):
        poses = np.tile(np.eye(4), (len(kinds), 1, 1))
        for child, (parent, at) in enumerate(chosen, start=1):
            poses[child] = poses[parent] @ at
        yield Assembly(np.array(kinds, dtype=np.int16), poses, edges)


@settings(deadline=None, max_examples=25)
@given(names=st.lists(st.sampled_from(["straight", "corner"]), min_size=2, max_size=5))
def test_solver_agrees_with_brute_force(ungoverned: Instantiator, names: list[str]) -> None:
    """On paths, whose ends have too few neighbours for the grammar: any arrangement whose contacts, by the meshes, are
    those of the path."""
    kit, edges = ungoverned.kit, path(len(names))
    kinds = labels(kit, names).tolist()
    contact, table = ContactTest(kit.types, kit.contact_tolerance), DockingTable.of(kit)
    possible = any(
        contact.contacts(assembly.types, assembly.poses).tolist() == edges.tolist()
        and (table.label_edges(assembly.types, assembly.poses, edges) >= 0).all()
        for assembly in arrangements(kit, kinds, edges)
    )
    found = ungoverned.instantiate(np.array(kinds, dtype=np.int16), edges, np.random.default_rng(0))
    assert (found.reason == "") == possible
