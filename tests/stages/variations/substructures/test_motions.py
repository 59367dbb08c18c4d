"""Replacements along rigid motions: shapes are laid upon each other, and what does not coincide changes places."""

from __future__ import annotations

import numpy as np
import pytest

from stages.shape.kit import Assembly, Kit
from stages.variations.kernels.answers import ContactAnswers
from stages.variations.substructures.motions import Moves, find_moves, moved_key
from stages.variations.substructures.ordered import OrderedGraph
from stages.variations.substructures.sites import docking_graph
from tests.stages.variations.substructures.laid import Replaced, replacements
from tests.stages.variations.toy import CHAIN, ROAD, Placed, box, chain, kit_of, pose, ring, with_arrow

TILES = {"plain": box(1.0, 0.2, 1.0), "arrow": with_arrow(box(1.0, 0.2, 1.0)), "bar": with_arrow(box(2.0, 0.2, 1.0))}


def placed(kit: Kit) -> list[tuple[Assembly, OrderedGraph]]:
    dockings = ContactAnswers(kit).dockings
    wholes = [each.assembly for each in kit.exemplars]
    return [
        (each, docking_graph(kit, each, dockings.label_edges(each.types, each.poses, each.edges))) for each in wholes
    ]


def sizes(moves: Moves) -> list[int]:
    """How many parts each result has."""
    pieces = [moves.pieces(number) for number in range(len(moves))]
    return sorted({int(piece.sum() + (~taken).sum()) for taken, piece in pieces})


def test_a_chain_laid_upon_itself_grows_and_shrinks_by_any_number_of_links() -> None:
    kit = kit_of(CHAIN, [chain(4)])
    (own,) = placed(kit)
    moves = find_moves(kit, 1, own, own)
    assert moves.is_whole
    assert {3, 4, 5, 7, 8, 9} <= set(sizes(moves))


def test_what_stays_and_what_comes_do_not_overlap_and_every_move_keeps_a_part_that_coincides() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    for base in placed(kit):
        for giver in placed(kit):
            moves = find_moves(kit, 1, base, giver)
            for number in range(len(moves)):
                taken, piece = moves.pieces(number)
                held = moves.images[number]
                assert piece.any()
                assert (held >= 0).any()
                assert not piece[held >= 0].any()
                assert not taken[held[held >= 0]].any()
                moved = moves.motions[number] @ giver[0].poses[held >= 0]
                gaps = np.abs(moved[:, :3, 3] - base[0].poses[held[held >= 0], :3, 3]).max()
                assert gaps < kit.pose_tolerance * 2


def test_the_key_of_a_move_that_brings_nothing_new_is_that_of_the_base() -> None:
    """A chain of which one end is replaced by its like has the key that it had, a longer one another."""
    kit = kit_of(CHAIN, [chain(4)])
    (own,) = placed(kit)
    moves = find_moves(kit, 1, own, own)
    none = np.zeros(len(own[0]), dtype=bool)
    whole = int(moved_key(own[1], own[1], none, none, np.full(len(own[0]), -1, dtype=np.int16)))
    for number in range(len(moves)):
        taken, piece = moves.pieces(number)
        key = int(moved_key(own[1], own[1], taken, piece, moves.images[number]))
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


def listed(moves: Moves) -> list[Replaced]:
    """The moves in the oracle's words; pairs at the border alone."""
    found = []
    for number in range(len(moves)):
        taken, piece = (frozenset(np.flatnonzero(each).tolist()) for each in moves.pieces(number))
        images = moves.images[number]
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
                moves = find_moves(kit, up, (base, base_graph), (giver, giver_graph))
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


def test_moves_of_chains_and_rings_are_those_of_all_motions() -> None:
    assert check_against_all_motions(kit_of(CHAIN, [chain(1), chain(2), chain(4)])) > 50
    assert check_against_all_motions(kit_of(ROAD, [ring(1, 1), ring(2, 3)])) > 40


@pytest.mark.parametrize("seed", range(6))
def test_moves_of_tilings_are_those_of_all_motions(seed: int) -> None:
    rng = np.random.default_rng(seed)
    assert check_against_all_motions(kit_of(TILES, [tiling(rng, 3 + place) for place in range(4)])) > 20
