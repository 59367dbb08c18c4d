"""Replacements along rigid motions: shapes are laid upon each other, and what does not coincide changes places."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.neighbourhoods import admits
from stages.shape.kit import Assembly, Kit, Multiset
from stages.variations.kernels.tables import kit_tables
from stages.variations.substructures.alignments import find_region_swaps
from stages.variations.substructures.consistency import make_consistent
from stages.variations.substructures.docking_sites import contact_graph, docking_graph
from stages.variations.substructures.ordered_graph import OrderedGraph
from stages.variations.substructures.region_swaps import RegionSwap, RegionSwaps
from stages.variations.substructures.result_key import swap_key
from tests.stages.variations.substructures.overlays import Replaced, replacements
from tests.toy_kits.chains_and_rings import CHAIN, ROAD, Placed, box, chain, kit_of, pose, ring, with_arrow

TILES = {"plain": box(1.0, 0.2, 1.0), "arrow": with_arrow(box(1.0, 0.2, 1.0)), "bar": with_arrow(box(2.0, 0.2, 1.0))}


def placed(kit: Kit) -> list[tuple[Assembly, OrderedGraph]]:
    dockings = ContactOracle(kit).dockings
    wholes = [exemplar.assembly for exemplar in kit.exemplars]
    return [
        (entry, docking_graph(kit, entry, dockings.label_edges(entry.types, entry.poses, entry.edges)))
        for entry in wholes
    ]


def sizes(moves: RegionSwaps) -> list[int]:
    """How many parts each result has."""
    return sorted({int(move.piece.sum() + (~move.taken).sum()) for move in (moves[at] for at in range(len(moves)))})


def test_chain_aligned_with_itself_changes_by_any_number_of_links() -> None:
    kit = kit_of(CHAIN, [chain(4)])
    (own,) = placed(kit)
    moves = find_region_swaps(kit, 1, own, own)
    assert moves.is_whole
    assert {3, 4, 5, 7, 8, 9} <= set(sizes(moves))


def test_swapped_regions_do_not_overlap_and_keep_a_matched_part() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    for base in placed(kit):
        for giver in placed(kit):
            moves = find_region_swaps(kit, 1, base, giver)
            for number in range(len(moves)):
                taken, piece, held, motion = moves[number]
                assert piece.any()
                assert (held >= 0).any()
                assert not piece[held >= 0].any()
                assert not taken[held[held >= 0]].any()
                moved = motion @ giver[0].poses[held >= 0]
                gaps = np.abs(moved[:, :3, 3] - base[0].poses[held[held >= 0], :3, 3]).max()
                assert gaps < kit.pose_tolerance * 2


def test_key_of_an_empty_swap_is_that_of_the_base() -> None:
    """A chain with one end replaced by its like keeps its key; a longer one has another."""
    kit = kit_of(CHAIN, [chain(4)])
    (own,) = placed(kit)
    moves = find_region_swaps(kit, 1, own, own)
    none = np.zeros(len(own[0]), dtype=bool)
    whole = int(swap_key(own[1], own[1], none, none, np.full(len(own[0]), -1, dtype=np.int16)))
    for number in range(len(moves)):
        taken, piece, image, _ = moves[number]
        key = int(swap_key(own[1], own[1], taken, piece, image))
        assert (key == whole) == (piece.sum() == taken.sum())


def tiling(rng: np.random.Generator, tiles: int) -> list[Placed]:
    """Tiles that touch each other edge to edge on a lattice; a bar covers two cells."""
    parts, taken = list[Placed](), set[tuple[int, int]]()
    while len(parts) < tiles:
        x, z = rng.integers(-tiles, tiles, 2).tolist()
        name, turns = str(rng.choice(list(TILES))), int(rng.integers(4))
        cells = {(x, z)} | ({(x + 1 - turns % 2, z + turns % 2)} if name == "bar" else set())
        around = {(a + i, b + j) for a, b in cells for i, j in ((1, 0), (-1, 0), (0, 1), (0, -1))}
        if cells & taken or (taken and not around & taken):
            continue
        taken |= cells
        a, b = np.mean(sorted(cells), axis=0).tolist()
        parts.append((name, pose(a, 0, b, turns)))
    return parts


def test_cut_short_list_has_the_best_alignments() -> None:
    kit = kit_of(CHAIN, [chain(12)])
    (own,) = placed(kit)
    whole, short = find_region_swaps(kit, 1, own, own), find_region_swaps(kit, 1, own, own, 12 * len(own[0]))
    assert whole.is_whole
    assert not short.is_whole
    assert {row.tobytes() for row in short.images} <= {row.tobytes() for row in whole.images}
    matched = [(moves.images >= 0).sum(axis=1).mean() for moves in (short, whole)]
    assert matched[0] > matched[1]


def test_several_regions_along_one_alignment_are_swapped_at_once() -> None:
    """What a composition makes is what its regions make one after the other."""
    rng, several = np.random.default_rng(0), 0
    kit = kit_of(TILES, [tiling(rng, tiles) for tiles in (9, 12)])
    for base in placed(kit):
        for giver in placed(kit):
            moves = find_region_swaps(kit, 1, base, giver)
            numbers = [swap for swap in moves.order(rng) if swap >= len(moves)]
            for number in numbers:
                motion, chosen = moves.draw(rng, number)
                move, regions = moves.along(motion, chosen), moves.regions[motion]
                alone = [
                    moves.along(motion, np.arange(len(regions)) == region)
                    for region in np.unique(regions[regions >= 0])
                    if chosen[region]
                ]
                assert (move.taken == np.any([entry.taken for entry in alone], axis=0)).all()
                assert (move.piece == np.any([entry.piece for entry in alone], axis=0)).all()
                several += len(alone) > 1
    assert several > 20


def test_swap_without_piece_names_where_the_other_shape_ends() -> None:
    kit = kit_of(CHAIN, [chain(3), chain(4)[1:]])
    base, giver = placed(kit)
    moves = find_region_swaps(kit, 1, base, giver)
    motion = int((moves.images >= 0).sum(axis=1).argmax())
    assert (moves.images[motion] >= 0).sum() == 3, "all links of the base"
    came = set()
    for cap in np.flatnonzero(np.diff(base[1].starts) == 1):
        move = moves.along(motion, np.arange(moves.regions.shape[1]) == cap)
        came.add(bool(move.piece.any()))
        beside = base[1].tails[base[1].twins[base[1].starts[cap]]]
        assert np.flatnonzero(move.taken).tolist() == [cap]
        if move.piece.any():
            assert [hold for _, hold, _ in move.docked(giver[1], giver[0].poses)] == [beside]
        else:
            [(part, hold, _)] = move.ends(base[1], giver[0].poses)
            assert (hold, move.image[part]) == (beside, beside)
            assert move.docked(giver[1], giver[0].poses) == []
    assert came == {True, False}


def test_chosen_regions_are_changed_until_the_grammar_admits_them() -> None:
    rng, changed = np.random.default_rng(0), 0
    kit = kit_of(TILES, [tiling(rng, tiles) for tiles in (9, 12)])
    tables = kit_tables(kit, True)
    for base in placed(kit):
        for giver in placed(kit):
            moves = find_region_swaps(kit, 1, base, giver)
            types = base[0].types, giver[0].types
            for motion, (regions, image) in enumerate(zip(moves.regions, moves.images, strict=True)):
                chosen = rng.random(len(regions)) < 0.5
                before = chosen.copy()
                if not make_consistent(rng, tables, base[1], giver[1], *types, regions, image, chosen):
                    continue
                changed += (chosen != before).any()
                move = moves.along(motion, chosen)
                for part in image[image >= 0].tolist():
                    assert admits(kit.grammar, int(kit.label_of[types[0][part]]), around(kit, base, giver, move, part))
    assert changed > 5


def around(
    kit: Kit, base: tuple[Assembly, OrderedGraph], giver: tuple[Assembly, OrderedGraph], move: RegionSwap, part: int
) -> Multiset:
    """The labels next to a part of the base that coincides with one of the giver, once the move is made."""
    own = int(np.flatnonzero(move.image == part)[0])
    types = [base[0].types[neighbour] for neighbour in base[0].neighbours()[part] if not move.taken[neighbour]]
    types += [giver[0].types[neighbour] for neighbour in giver[0].neighbours()[own] if move.piece[neighbour]]
    return tuple(sorted(Counter(kit.label_of[types].tolist()).items()))


def test_contact_graph_equals_docking_graph_but_for_the_order() -> None:
    kit = kit_of(ROAD, [ring(2, 3)])
    dockings, whole = ContactOracle(kit).dockings, kit.exemplars[0].assembly
    labels = dockings.label_edges(whole.types, whole.poses, whole.edges)
    plain, ordered = (graph_of(kit, whole, labels) for graph_of in (contact_graph, docking_graph))
    assert (plain.types == ordered.types).all()
    assert (plain.edges() == ordered.edges()).all()
    assert (plain.docking_labels() == ordered.docking_labels()).all()
    assert (plain.twins[plain.twins] == np.arange(len(plain.twins))).all()


def listed(moves: RegionSwaps) -> list[Replaced]:
    """The moves in the oracle's words; pairs at the border alone."""
    found = []
    for number in range(len(moves)):
        taken, piece = (frozenset(np.flatnonzero(swap).tolist()) for swap in moves[number][:2])
        images = moves[number].image
        found.append(
            (taken, piece, frozenset((int(images[part]), part) for part in np.flatnonzero(images >= 0).tolist()))
        )
    return found


def check_against_all_motions(kit: Kit) -> int:
    """Hold the moves between all exemplars of a kit against the oracle's; how many there are."""
    count, shapes = 0, placed(kit)
    for base, base_graph in shapes:
        for giver, giver_graph in shapes:
            near, beyond = base.neighbours(), giver.neighbours()
            for up in (1, -1):
                moves = find_region_swaps(kit, up, (base, base_graph), (giver, giver_graph))
                found = [
                    (taken, piece, frozenset((x, y) for x, y in held if taken & set(near[x]) or piece & set(beyond[y])))
                    for taken, piece, held in listed(moves)
                ]
                assert moves.is_whole
                assert len(found) == len(set(found))
                wanted = replacements(kit, base, giver, upright=up == 1)
                assert set(found) == set(wanted)
                assert moves.meetings == wanted.total()
                count += len(found)
    return count


def test_swaps_of_chains_and_rings_equal_brute_force() -> None:
    assert check_against_all_motions(kit_of(CHAIN, [chain(1), chain(2), chain(4)])) > 50
    assert check_against_all_motions(kit_of(ROAD, [ring(1, 1), ring(2, 3)])) > 40


@pytest.mark.parametrize("seed", range(6))
def test_swaps_of_tilings_equal_brute_force(seed: int) -> None:
    rng = np.random.default_rng(seed)
    assert check_against_all_motions(kit_of(TILES, [tiling(rng, 3 + place) for place in range(4)])) > 20
