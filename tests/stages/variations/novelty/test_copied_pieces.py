"""How much of a shape is copied whole: by hand, and as every rigid motion tried one by one says."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import permutations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stages.exemplars.observed_grammar import observe_dockings
from stages.shape.arrays import FloatArray
from stages.shape.geometry.docking import DockingTable
from stages.shape.kit import Assembly, Exemplar, Grammar, Kit, PartType
from stages.variations.novelty.copied_pieces import CopiedPieces, CopyDetector
from tests.toy_kits.chains_and_rings import box

TURNS = np.array(
    [
        np.eye(3)[list(axes)] * np.array(signs)[:, None]
        for axes in permutations(range(3))
        for signs in product((1, -1), repeat=3)
    ]
)
TURNS = TURNS[np.linalg.det(TURNS) > 0]
"""The 24 rotations of a cube, the identity first."""

UP = np.array([0, 1, 0])
GROUPS = {
    "any": TURNS,
    "ring": TURNS[np.abs(TURNS @ UP @ UP) == 1],
    "post": TURNS[TURNS @ UP @ UP == 1],
    "one": TURNS[:1],
}
"""Cubes that look the same by all 24 rotations, by 8, by 4 about their axis, by none."""

Cell = tuple[int, int, int]


def cube(name: str, group: FloatArray) -> PartType:
    mesh, symmetries = box(1.0, 1.0, 1.0), np.tile(np.eye(4), (len(group), 1, 1))
    symmetries[:, :3, :3] = group
    faces = np.array(mesh.faces, dtype=np.int32)
    colors = np.zeros((len(faces), 3), dtype=np.uint8)
    return PartType(name, np.array(mesh.vertices), faces, colors, np.eye(4), symmetries)


TYPES = tuple(cube(name, group) for name, group in GROUPS.items())
ANY, RING, POST, ONE = range(4)


def blocks(cells: Sequence[Cell], types: Sequence[int] | int = ANY, turns: Sequence[int] | int = 0) -> Assembly:
    """Cubes in cells of a grid, each of a type and turned, those in contact that share a side."""
    places = np.array(cells)
    poses = np.tile(np.eye(4), (len(cells), 1, 1))
    poses[:, :3, 3] = places
    poses[:, :3, :3] = TURNS[np.broadcast_to(turns, len(cells))]
    steps = np.abs(places[:, None] - places[None]).sum(axis=2)
    edges = np.argwhere(np.triu(steps == 1)).astype(np.int32)
    return Assembly(np.broadcast_to(types, len(cells)).astype(np.int16), poses, edges)


def kit(*exemplars: Assembly) -> Kit:
    dockings = tuple(observe_dockings(TYPES, exemplars, 1e-3))
    named = tuple(Exemplar(f"e{number}", exemplar, ("",) * len(exemplar)) for number, exemplar in enumerate(exemplars))
    return Kit("cubes", TYPES, named, Grammar({}, dockings, {}), 1e-3, 1e-3, ("face",), "y")


def copied(own: Kit, shape: Assembly) -> CopiedPieces:
    table = DockingTable.of(own)
    return CopyDetector(own, table).copied(shape, table.label_edges(shape.types, shape.poses, shape.edges))


def moved(shape: Assembly, turn: int, x: float, y: float, z: float) -> Assembly:
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = TURNS[turn], (x, y, z)
    return Assembly(shape.types, motion @ shape.poses, shape.edges)


SCREW = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1))


def test_moved_exemplar_is_one_copy_of_itself() -> None:
    shape = blocks(SCREW, (ANY, ONE, POST, RING), (3, 7, 11, 19))
    for turn in range(len(TURNS)):
        assert copied(kit(shape), moved(shape, turn, 0.3, -2.0, 5.5)) == CopiedPieces(1.0, 1, 1.0, "e0")


def test_two_joined_exemplars_are_two_pieces() -> None:
    plate = blocks([(0, 0, 0), (1, 0, 0), (0, 0, 1)], ONE)
    glued = blocks([(0, 0, 0), (1, 0, 0), (0, 0, 1), (0, 1, 0), (0, 1, 1), (1, 1, 0)], ONE)
    assert copied(kit(plate), glued) == CopiedPieces(0.5, 2, 1.0, "e0")


def test_mirror_image_is_no_copy() -> None:
    mirrored = [(x, y, -z) for x, y, z in SCREW]
    assert copied(kit(blocks(SCREW)), blocks(mirrored)) == CopiedPieces(0.75, 2, 0.75, "e0")


def test_equal_dockings_of_another_curl_are_no_copy() -> None:
    row = blocks([(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)])
    assert copied(kit(row), blocks([(0, 0, 0), (1, 0, 0), (1, 0, 1), (2, 0, 1)])) == CopiedPieces(0.5, 2, 0.5, "e0")


def test_longer_ring_copies_one_end_and_both_sides_of_a_shorter_one() -> None:
    def ring(length: int) -> Assembly:
        return blocks([(x, 0, z) for x in range(length) for z in range(3) if x in (0, length - 1) or z != 1])

    assert copied(kit(ring(3)), ring(4)) == CopiedPieces(0.7, 2, 7 / 8, "e0")


def test_single_part_copies_the_smallest_exemplar_with_it() -> None:
    large, small = blocks([(0, 0, 0), (1, 0, 0), (2, 0, 0)]), blocks([(0, 0, 0), (1, 0, 0)])
    assert copied(kit(large, small), blocks([(4, 4, 4)], turns=5)) == CopiedPieces(1.0, 1, 0.5, "e1")


def test_within_a_small_budget_rarest_dockings_come_first(monkeypatch: pytest.MonkeyPatch) -> None:
    cells = [(x, 0, z) for x in range(8) for z in range(8)]
    floor = blocks([*cells, (3, 1, 3)], [*[ANY] * len(cells), ONE])
    monkeypatch.setattr("stages.variations.novelty.copied_pieces.CONTACT_BUDGET", 2)
    assert copied(kit(floor), floor) == CopiedPieces(1.0, 1, 1.0, "e0")


@cache
def random_blocks(seed: int, parts: int) -> Assembly:
    """Connected cubes of any type, turned at random, in a box of 3 cells a side."""
    rng = np.random.default_rng(seed)
    cells: list[Cell] = [(1, 1, 1)]
    while len(cells) < parts:
        x, y, z = cells[int(rng.integers(len(cells)))]
        step = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, 0, 0), (0, -1, 0), (0, 0, -1)][int(rng.integers(6))]
        place = (x + step[0], y + step[1], z + step[2])
        if place not in cells and all(0 <= entry < 3 for entry in place):
            cells.append(place)
    # Half of the cubes stand straight, so that shapes have more than a part in common.
    turns = np.where(rng.random(parts) < 0.5, 0, rng.integers(24, size=parts))
    return blocks(cells, rng.choice([ANY, ANY, RING, POST, ONE], size=parts), turns)


def looks_same(part_type: PartType, pose: FloatArray, other: FloatArray) -> bool:
    return bool((np.abs(pose @ part_type.symmetries - other).max(axis=(1, 2)) < 1e-6).any())


def every_piece(own: Kit, shape: Assembly) -> set[tuple[frozenset[int], int]]:
    """The connected pieces under every rigid motion that lays some part on one of an exemplar."""
    found = set()
    for number, exemplar in enumerate(exemplar.assembly for exemplar in own.exemplars):
        contacts = {frozenset(edge) for edge in exemplar.edges.tolist()}
        for p, q in product(range(len(shape)), range(len(exemplar))):
            if shape.types[p] != exemplar.types[q]:
                continue
            for symmetry in own.types[shape.types[p]].symmetries:
                motion = exemplar.poses[q] @ symmetry @ np.linalg.inv(shape.poses[p])
                laid: dict[int, int] = {}
                for i, at in enumerate(motion @ shape.poses):
                    for j in np.flatnonzero(np.abs(exemplar.poses[:, :3, 3] - at[:3, 3]).max(axis=1) < 1e-6).tolist():
                        own_type = own.types[shape.types[i]]
                        if shape.types[i] == exemplar.types[j] and looks_same(own_type, at, exemplar.poses[j]):
                            laid[i] = j
                piece, rim = {p}, [p]
                while rim:
                    i = rim.pop()
                    for edge in shape.edges.tolist():
                        if i in edge:
                            other = sum(edge) - i
                            lies = i in laid and other in laid and frozenset((laid[i], laid[other])) in contacts
                            if lies and other not in piece:
                                piece.add(other)
                                rim.append(other)
                found.add((frozenset(piece), number))
    return found


def greedy_counts(pieces: set[frozenset[int]], left: frozenset[int]) -> set[int]:
    """The numbers of pieces that a greedy cover may end with, whichever of equally good ones it takes."""
    if not left:
        return {0}
    gain = max(len(piece & left) for piece in pieces)
    if gain == 1:
        return {len(left)}
    rests = {left - piece for piece in pieces if len(piece & left) == gain}
    return {1 + count for rest in rests for count in greedy_counts(pieces, rest)}


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10_000), st.integers(1, 7), st.integers(2, 8), st.integers(2, 6), st.integers(0, 23))
def test_copies_of_random_cubes_equal_brute_force(seed: int, parts: int, first: int, second: int, turn: int) -> None:
    own = kit(random_blocks(seed, first), random_blocks(seed + 1, second))
    shape = moved(random_blocks(seed + 2, parts), turn, 1.0, 2.0, 3.0)
    present = {int(part_type) for exemplar in own.exemplars for part_type in exemplar.assembly.types}
    if not set(shape.types.tolist()) <= present:
        return
    found, pieces = copied(own, shape), every_piece(own, shape)
    largest = max(len(piece) for piece, _ in pieces)
    assert found.largest == largest / parts
    sizes = [len(exemplar.assembly) for exemplar in own.exemplars]
    shares = {own.exemplars[e].name: len(piece) / sizes[e] for piece, e in pieces if len(piece) == largest}
    assert found.exemplar == shares[found.of] == max(shares.values())
    assert found.pieces in greedy_counts({piece for piece, _ in pieces}, frozenset(range(parts)))
