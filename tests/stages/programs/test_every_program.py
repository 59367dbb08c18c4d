"""Guarantees of every program: valid wherever its constraints hold, in one piece, with distinct values."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from stages.programs.curves import Part, QuadMesh, box, mesh_defects
from stages.programs.draws import Share
from stages.programs.intersection import meshes_intersect
from stages.programs.program import Program, find_program, program_names
from stages.programs.sampling import Sampler, all_value_indices, same_geometry
from stages.programs.schema import Values
from stages.shape.geometry.mesh_pairs import build_tree, near_pairs

TOYS = ("tests.stages.programs.stool", "tests.stages.programs.rack")
NAMES = (*program_names(), *TOYS)

MAX_JOINT_GAP_DIAGONALS = 0.01
"""Parts at a smaller distance are connected."""

FOLDED = "folded over themselves"
"""Quads fold where a rail turns tighter than its profile is wide. The mesh is still closed and oriented."""

SHAPES_PER_CHECK = 10
"""Joined meshes take half the time."""


def pieces(parts: Sequence[Part]) -> int:
    """The number of connected pieces of a shape."""
    corners = np.array([part.mesh.bounds for part in parts])
    distance = MAX_JOINT_GAP_DIAGONALS * float(np.linalg.norm(corners[:, 1].max(axis=0) - corners[:, 0].min(axis=0)))
    piece = list(range(len(parts)))
    for i, first in enumerate(parts):
        for j in range(i):
            if piece[i] != piece[j] and meshes_intersect(first.mesh, parts[j].mesh, distance):
                piece = [piece[i] if number == piece[j] else number for number in piece]
    return len(set(piece))


def random_values(program: Program, count: int, off_grid: bool) -> list[Values]:
    """Random values of valid shapes."""
    sampler = Sampler(program, Share(), off_grid)
    rng = np.random.default_rng(11)
    return [sampler.find(None, rng) for _ in range(count)]


def holes(parts: Sequence[Part]) -> list[str]:
    """Defects of the meshes of parts."""
    defects = mesh_defects(QuadMesh.joined(part.mesh for part in parts))
    return [defect for defect in defects if not defect.endswith(FOLDED)]


def crossings(mesh: QuadMesh) -> int:
    """The number of pairs of triangles of a mesh that intersect without a common corner."""
    tree = build_tree(mesh.vertices, mesh.triangles)
    pairs = near_pairs(tree, tree, np.eye(4), 0.0)
    first, other = tree[0][pairs[:, 0]], tree[0][pairs[:, 1]]
    neighbours = (first[:, :, None] == other[:, None]).all(axis=-1).any(axis=(1, 2))
    return int((~neighbours).sum())


def check(program: Program, shape_values: Sequence[Values]) -> None:
    for start in range(0, len(shape_values), SHAPES_PER_CHECK):
        batch = shape_values[start : start + SHAPES_PER_CHECK]
        shapes = [(program.schema.to_text(values), program.parts(values)) for values in batch]
        if holes([part for _, parts in shapes for part in parts]):
            pytest.fail(
                f"not closed: {[(text, part.label) for text, parts in shapes for part in parts if holes([part])]}"
            )
        for text, parts in shapes:
            assert {part.label for part in parts} <= set(program.labels), text
            assert pieces(parts) == 1, f"{text} falls into {pieces(parts)} pieces"


@pytest.mark.parametrize("name", NAMES)
def test_program_has_the_name_of_its_file_and_a_valid_base(name: str) -> None:
    program = find_program(name)
    assert program.name == name.rpartition(".")[2]
    check(program, [program.schema.canonical(program.schema.base)[0]])


@pytest.mark.parametrize("name", TOYS)
def test_random_toys_are_closed_and_in_one_piece(name: str) -> None:
    program = find_program(name)
    check(program, random_values(program, 40, off_grid=False))


@pytest.mark.slow
@pytest.mark.parametrize("off_grid", [False, True])
@pytest.mark.parametrize("name", program_names())
def test_many_random_shapes_are_closed_and_in_one_piece(name: str, off_grid: bool) -> None:
    program = find_program(name)
    check(program, random_values(program, 200, off_grid))


@pytest.mark.parametrize("name", NAMES)
def test_every_value_differs_from_its_neighbours(name: str) -> None:
    program = find_program(name)
    sampler, rng = Sampler(program, Share(), off_grid=False), np.random.default_rng(12)
    for value_index in all_value_indices(program):
        sampler.find(value_index, rng)


@pytest.mark.parametrize("name", NAMES)
def test_shape_depends_on_its_values_alone(name: str) -> None:
    program = find_program(name)
    schema = program.schema
    shapes = random_values(program, 5, off_grid=True)
    first = [program.parts(values) for values in shapes]
    for values, parts in zip(shapes, first, strict=True):
        again = program.parts(schema.from_text(schema.to_text(values)))
        assert same_geometry(parts, again)
        for part, other in zip(parts, again, strict=True):
            np.testing.assert_array_equal(part.mesh.vertices, other.mesh.vertices)
            np.testing.assert_array_equal(part.mesh.quads, other.mesh.quads)


def test_distant_parts_are_separate_pieces() -> None:
    stool = find_program(TOYS[0])
    seat, leg, other, rail = stool.parts(stool.schema.base)
    assert pieces([seat, leg, other, rail]) == 1
    assert pieces([seat, rail]) == 2
    assert pieces([leg, other]) == 2


def self_intersecting(program: Program, count: int) -> list[tuple[str, str]]:
    """Parts of random shapes that intersect themselves: their labels, and the text of their shapes."""
    return [
        (part.label, program.schema.to_text(values))
        for values in random_values(program, count, off_grid=False)
        for part in program.parts(values)
        if crossings(part.mesh)
    ]


@pytest.mark.parametrize("name", NAMES)
def test_parts_do_not_intersect_themselves(name: str) -> None:
    assert not self_intersecting(find_program(name), 12)


@pytest.mark.slow
@pytest.mark.parametrize("name", program_names())
def test_few_parts_of_many_shapes_intersect_themselves(name: str) -> None:
    # Thick arm supports with sharp bends do, in two of 400 chairs, and necks that fold over, in nine of 400 vases.
    parts = self_intersecting(find_program(name), 80)
    assert len({text for _, text in parts}) <= 4, parts


def test_self_intersections_are_found() -> None:
    whole = box((1.0, 1.0, 1.0))
    assert crossings(whole) == 0
    assert crossings(QuadMesh.joined([whole, box((1.0, 1.0, 1.0), (3.0, 0.0, 0.0))])) == 0
    assert crossings(QuadMesh.joined([whole, box((0.2, 0.2, 2.0), (0.1, 0.0, 0.0))])) > 0
