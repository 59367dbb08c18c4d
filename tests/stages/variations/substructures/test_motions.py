"""Replacements along rigid motions: shapes are laid upon each other, and what does not coincide changes places."""

from __future__ import annotations

import numpy as np

from stages.shape.kit import Assembly, Kit
from stages.variations.kernels.answers import ContactAnswers
from stages.variations.substructures.motions import Moves, find_moves, moved_key
from stages.variations.substructures.ordered import OrderedGraph
from stages.variations.substructures.sites import docking_graph
from tests.stages.variations.toy import CHAIN, ROAD, chain, kit_of, ring


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
