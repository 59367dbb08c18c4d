"""The kernels on cases small enough to see through."""

from __future__ import annotations

import numpy as np
import pytest

from stages.shape.geometry.contact_lookup import FORBIDDEN_CONTACT, LABEL_BASE, NO_CONTACT, contact_key, quantize_pose
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.geometry.hash_tables import look_up
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit import Assembly
from stages.variations.exchange.cuts import cut_connected_piece
from stages.variations.exchange.joins import join
from stages.variations.kernels.checks import connect
from stages.variations.kernels.outcomes import Outcome
from stages.variations.kernels.structs import N_BOUNDARY, N_EDGES, N_PARTS
from stages.variations.kernels.tables import resolve_unknown, shape_tables
from stages.variations.search.search import Search
from stages.variations.settings import SearchConfig
from tests.toy_kits.chains_and_rings import CHAIN, ROAD, chain, kit_of, pose, ring


@pytest.fixture(scope="module")
def chains() -> Search:
    return Search(ContactOracle(kit_of(CHAIN, [chain(3), chain(5)])), SearchConfig(min_size=0.1))


def test_cut_is_connected_and_bounded_by_outside_neighbours() -> None:
    line = Search(ContactOracle(kit_of(ROAD, [ring(1, 1), ring(2, 3)])), SearchConfig())
    shape = line.parents.exemplars[1].tables
    ws, rng = line.maker.ws, np.random.default_rng(0)
    sizes = set()
    for number in range(300):
        outcome = cut_connected_piece(rng, shape, shape, ws, number % 3, line.kit.pose_tolerance)
        inside = ws.inside[: len(shape.types)]
        sizes.add(int(inside.sum()))
        boundary = set(ws.boundary[: ws.counts[N_BOUNDARY]].tolist())
        expected = {
            part
            for part in np.flatnonzero(inside).tolist()
            if not inside[shape.ends[shape.starts[part] : shape.starts[part + 1]]].all()
        }
        assert boundary == expected
        # A connected piece of a ring that is not the whole ring has two ends, or is a single part.
        assert len(boundary) == (0 if outcome == Outcome.WHOLE else min(2, int(inside.sum())))
    assert len(sizes) > 8


def test_contacts_do_not_depend_on_earlier_queries(chains: Search) -> None:
    kit = chains.kit
    names = kit.type_names()
    link = names.index("link")
    ws = chains.maker.ws
    cases = {
        "docked": (pose(0, 0, 0), pose(1, 0, 0), 0),
        "apart": (pose(0, 0, 0), pose(1.2, 0, 0), NO_CONTACT),
        "overlapping": (pose(0, 0, 0), pose(0.9, 0, 0), FORBIDDEN_CONTACT),
        "face contact that no exemplar shows": (pose(0, 0, 0), pose(0, 0, 0.6), FORBIDDEN_CONTACT),
        "almost in contact": (pose(0, 0, 0), pose(1 + 1.03 * kit.contact_tolerance, 0, 0), FORBIDDEN_CONTACT),
    }
    answers = []
    for order in (list(cases), list(reversed(cases))):
        fresh = ContactOracle(kit)
        given = {}
        for name in order:
            first, second, _ = cases[name]
            ws.types[:2] = link, link
            # Part coordinates start at the centroid, which the arrow moves off the middle by the same way in both.
            ws.rotations[:2], ws.translations[:2] = [first[:3, :3], second[:3, :3]], [first[:3, 3], second[:3, 3]]
            ws.unknown[0] = 0, 1
            fresh.resolve(ws.types, ws.rotations, ws.translations, ws.unknown[:1])
            quanta = np.empty(12, dtype=np.int64)
            quantize_pose(
                ws.rotations[0], ws.translations[0], ws.rotations[1], ws.translations[1], kit.types[link].diagonal / 2,
                kit.contact_tolerance / 64, quanta,
            )  # fmt: skip
            key = np.uint64(contact_key(link, link, quanta))
            given[name] = int(look_up(fresh.table.keys, fresh.table.values, key))
        answers.append([given[name] for name in cases])
    assert answers[0] == answers[1]
    for (_, _, expected), answer in zip(cases.values(), answers[0], strict=True):
        assert answer == expected if expected != 0 else answer >= 0
    # Seen from the link behind, the docking of two one-way links has another label than from the one in front.
    assert answers[0][0] // LABEL_BASE != answers[0][0] % LABEL_BASE


def test_graph_keys_do_not_depend_on_the_order_of_parts(chains: Search) -> None:
    shape = chains.parents.exemplars[1]
    graph, docked = chains.maker.keys_of(shape)
    rng = np.random.default_rng(1)
    for _ in range(5):
        order = rng.permutation(len(shape.assembly))
        place = np.argsort(order)
        edges = np.sort(place[shape.assembly.edges], axis=1)
        edges = edges[np.lexsort((edges[:, 1], edges[:, 0]))].astype(np.int32)
        shuffled = Assembly(shape.assembly.types[order], shape.assembly.poses[order], edges)
        assert graph_digest(shuffled.types, edges) == graph_digest(shape.assembly.types, shape.assembly.edges)
        assert chains.maker.keys_of(chains.parent("shuffled", shuffled, shape.origins[order], shape.place)) == (
            graph,
            docked,
        )


def test_chain_joined_to_itself_gets_one_link_longer(chains: Search) -> None:
    kit, tables, ws = chains.kit, chains.maker.tables, chains.maker.ws
    shape = chains.parents.exemplars[0].tables
    links = [part for part in range(5) if kit.types[shape.types[part]].name == "link"]
    links.sort(key=lambda part: shape.translations[part, 0])
    caps = [part for part in range(5) if part not in links]
    left_cap = min(caps, key=lambda part: shape.translations[part, 0])
    # The piece: the left cap and two links; its boundary, the second link, is laid on the third.
    ws.inside[:5] = False
    ws.inside[[left_cap, links[0], links[1]]] = True
    ws.counts[N_BOUNDARY] = 1
    ws.boundary[0], ws.images[0] = links[1], links[2]
    ws.transform[:3], ws.transform[3] = np.eye(3), [1, 0, 0]
    assert join(np.random.default_rng(0), tables, shape, shape, ws, 2, 20) == Outcome.OK
    while connect(tables, chains.oracle.table, ws) == Outcome.UNKNOWN:
        assert resolve_unknown(chains.oracle, ws)
    # Left cap and two links from the piece, then the right cap, or the other way round the left cap and two links.
    assert ws.counts[N_PARTS] in (4, 5)
    assert ws.counts[N_EDGES] == ws.counts[N_PARTS] - 1


def test_shape_tables_hold_the_graph_in_both_directions(chains: Search) -> None:
    parent = chains.parents.exemplars[0]
    tables = shape_tables(parent.assembly, parent.labels, len(chains.kit.types))
    neighbours = [
        tables.ends[tables.starts[part] : tables.starts[part + 1]].tolist() for part in range(len(parent.assembly))
    ]
    assert neighbours == parent.assembly.neighbours()
    for part_type in range(len(chains.kit.types)):
        members = tables.by_type[tables.type_starts[part_type] : tables.type_starts[part_type + 1]]
        assert members.tolist() == np.flatnonzero(parent.assembly.types == part_type).tolist()
