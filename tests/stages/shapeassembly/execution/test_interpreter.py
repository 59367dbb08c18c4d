"""What executed programs look like: each rule in a small case, then properties of all programs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stages.shapeassembly import Execution, ProgramError, execute, execute_all, parse, print_program
from stages.shapeassembly.syntax.limits import MAX_COPIES
from stages.shapeassembly.syntax.program import (
    BBOX,
    AssemblyProgram,
    Attach,
    Block,
    Cuboid,
    Line,
    Point,
    Reflect,
    Squeeze,
    Translate,
)
from tests.stages.shapeassembly.strategies import programs


def run(*lines: str, bbox: str = "2.0, 2.0, 2.0") -> Execution:
    inner = "\n".join(lines)
    return execute(parse(f"Assembly P {{ bbox = Cuboid({bbox}, True)\n{inner} }}"))


def same(found: np.ndarray, expected: object) -> None:
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_unattached_cuboid_is_centred_with_ordered_corners() -> None:
    done = run("c = Cuboid(0.2, 0.4, 0.6, True)")
    same(done.corners[0, 0], [0.1, 0.2, 0.3])
    same(done.corners[0, [4, 2, 1]], [[-0.1, 0.2, 0.3], [0.1, -0.2, 0.3], [0.1, 0.2, -0.3]])
    assert done.names == ("P/c",)


def test_a_first_attachment_moves_the_cuboid() -> None:
    done = run("c = Cuboid(0.2, 0.4, 0.6, True)", "attach(c, bbox, 0.5, 0.0, 1.0, 0.5, 0.0, 0.75)")
    same(done.centres, [[0.0, -0.8, 0.2]])


def test_a_second_attachment_of_an_aligned_cuboid_to_the_bounding_box_changes_nothing() -> None:
    attach = "attach(c, bbox, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5)"
    more = "attach(c, bbox, 0.5, 1.0, 0.5, 0.9, 1.0, 0.9)"
    once = run("c = Cuboid(0.2, 0.4, 0.6, True)", attach)
    same(run("c = Cuboid(0.2, 0.4, 0.6, True)", attach, more).corners, once.corners)


GAP = ("a = Cuboid(0.4, 0.4, 0.4, True)", "b = Cuboid(0.4, 0.4, 0.4, True)")


def test_an_aligned_cuboid_grows_to_meet_what_it_is_attached_to() -> None:
    done = run(
        *GAP,
        "attach(a, bbox, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)",
        "attach(b, bbox, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0)",
        "attach(b, a, 0.3, 0.3, 0.3, 0.7, 0.7, 0.7)",
    )
    same(done.sizes[1], [1.6, 0.4, 0.4])
    same(done.corners[1, 0], [1.0, -0.6, -0.6])


def test_an_aligned_cuboid_stays_where_the_gap_is_small() -> None:
    done = run(
        *GAP,
        "attach(a, bbox, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)",
        "attach(b, bbox, 0.0, 0.0, 0.0, 0.2095, 0.0, 0.0)",
        "attach(b, a, 0.3, 0.3, 0.3, 0.7, 0.7, 0.7)",
    )
    same(done.sizes[1], [0.4, 0.4, 0.4])


def test_a_free_cuboid_with_one_attachment_is_stretched_and_turned() -> None:
    done = run(
        "c = Cuboid(0.1, 1.0, 0.1, False)",
        "attach(c, bbox, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5)",
        "attach(c, bbox, 0.5, 1.0, 0.5, 1.0, 0.5, 0.5)",
    )
    same(done.sizes, [[0.1, math.sqrt(2), 0.1]])
    same(done.frames[0][:, 1], [math.sqrt(0.5), math.sqrt(0.5), 0.0])
    same(done.centres, [[0.5, -0.5, 0.0]])


def test_hinge_takes_the_smallest_change_of_size() -> None:
    # From corner to corner the box measures 3; 3.1 is reached with the least change along its longest side.
    done = run(
        "c = Cuboid(1.0, 2.0, 2.0, False)",
        "attach(c, bbox, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)",
        "attach(c, bbox, 1.0, 1.0, 1.0, 0.775, 0.0, 0.0)",
        bbox="4.0, 4.0, 4.0",
    )
    same(done.sizes, [[1.0, math.sqrt(3.1**2 - 5), 2.0]])
    same(done.corners[0, 0], [-2 + 3.1, -2.0, -2.0])


def test_a_cube_shrinks_as_a_whole_where_no_side_alone_can() -> None:
    done = run(
        "c = Cuboid(1.0, 1.0, 1.0, False)",
        "attach(c, bbox, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)",
        "attach(c, bbox, 1.0, 1.0, 1.0, 0.1, 0.0, 0.0)",
    )
    same(done.sizes, np.full((1, 3), 0.2 / math.sqrt(3)))


def test_all_sizes_change_by_the_same_amount_where_no_single_one_can() -> None:
    # From corner to corner the box measures 3, and the root of 3 is wanted: (1 + t)^2 + 2 (2 + t)^2 = 3.
    done = run(
        "c = Cuboid(1.0, 2.0, 2.0, False)",
        "attach(c, bbox, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)",
        "attach(c, bbox, 1.0, 1.0, 1.0, 0.5, 0.5, 0.5)",
    )
    amount = (-10 + math.sqrt(100 - 12 * 6)) / 6
    same(done.sizes, [[1 + amount, 2 + amount, 2 + amount]])
    same(done.corners[0, 0], [0.0, 0.0, 0.0])


def test_all_sizes_shrink_by_a_factor_where_no_amount_leaves_a_box() -> None:
    done = run(
        "c = Cuboid(1.0, 0.1, 0.1, False)",
        "attach(c, bbox, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)",
        "attach(c, bbox, 1.0, 1.0, 1.0, 0.01, 0.0, 0.0)",
    )
    same(done.sizes, np.array([[1.0, 0.1, 0.1]]) * 0.02 / math.sqrt(1.02))


FOUR = (
    "c = Cuboid(0.22, 1.0, 0.2, False)",
    "attach(c, bbox, 0.5, 0.0, 0.5, 0.5, 0.25, 0.5)",
    "attach(c, bbox, 0.5, 0.1, 0.5, 0.5, 0.3, 0.5)",
    "attach(c, bbox, {}, 0.1, 0.5, {}, 0.3, 0.5)",
    "attach(c, bbox, 0.5, 0.5, 1.0, 0.9, 0.5, 0.5)",
)


@pytest.mark.parametrize(("aside", "turned"), [(0.9, True), (1.0, False)])
def test_collinearity_uses_the_unnormalised_cross_product(aside: float, turned: bool) -> None:
    """The third is at 41 or 48 degrees to the first two; 0.1 times 0.088 is under 0.01, 0.1 times 0.11 is not."""
    away = 0.5 + (aside - 0.5) * 0.11
    done = run(*(line.format(aside, away) for line in FOUR))
    assert np.allclose(done.frames[0], np.eye(3)) != turned


def test_half_a_turn_is_about_an_axis_across() -> None:
    done = run(
        "c = Cuboid(0.2, 1.0, 0.4, False)",
        "attach(c, bbox, 0.5, 0.0, 0.5, 0.5, 1.0, 0.5)",
        "attach(c, bbox, 0.5, 1.0, 0.5, 0.5, 0.5, 0.5)",
    )
    same(done.centres, [[0.0, 0.5, 0.0]])
    same(done.frames[0][:, 1], [0.0, -1.0, 0.0])
    same(np.linalg.det(done.frames[0]), 1.0)


def test_a_third_attachment_swings_the_cuboid_about_the_line_of_the_first_two() -> None:
    done = run(
        "c = Cuboid(0.2, 2.0, 0.4, False)",
        "attach(c, bbox, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5)",
        "attach(c, bbox, 0.5, 1.0, 0.5, 0.5, 1.0, 0.5)",
        "attach(c, bbox, 1.0, 0.5, 0.5, 0.5, 0.5, 1.0)",
    )
    same(done.frames[0][:, 0], [0.0, 0.0, 1.0])
    # The face looks straight at its goal: it is moved there, and both ends stay.
    same(done.sizes, [[2.0, 2.0, 0.4]])
    same(done.centres, [[0.0, 0.0, 0.0]])


def test_squeeze_stands_between_and_meets_the_same_face_of_the_bounding_box() -> None:
    seat = ("seat = Cuboid(2.0, 0.2, 2.0, True)", "attach(seat, bbox, 0.5, 0.0, 0.5, 0.5, 0.3, 0.5)")
    done = run(*seat, "back = Cuboid(2.0, 0.1, 2.0, True)", "squeeze(back, bbox, seat, top, 0.5, 0.5)")
    same(done.corners[1, [0, 7]], [[1.0, 1.0, 1.0], [-1.0, -0.2, -1.0]])


@pytest.mark.parametrize(
    ("face", "corner"), [("top", [-0.5, 1.0, -0.3]), ("bot", [-0.5, -0.8, -0.3]), ("right", [1.0, -0.5, -0.3]),
                         ("left", [-0.8, -0.5, -0.3]), ("front", [-0.5, -0.3, 1.0]), ("back", [-0.5, -0.3, -0.8])],
)  # fmt: skip
def test_squeeze_puts_the_centre_of_a_face_at_its_place_on_the_bounding_box(face: str, corner: list[float]) -> None:
    done = run("c = Cuboid(0.2, 0.2, 0.2, True)", f"squeeze(c, bbox, bbox, {face}, 0.2, 0.3)")
    same(done.corners[0, 0], corner)


def test_reflect_mirrors_about_the_bounding_box() -> None:
    done = run("c = Cuboid(0.2, 0.4, 0.6, True)", "attach(c, bbox, 0.5, 0.0, 0.5, 0.2, 0.0, 0.3)", "reflect(c, X)")
    same(done.corners[1], done.corners[0][[4, 5, 6, 7, 0, 1, 2, 3]] * [-1, 1, 1])
    assert done.names == ("P/c", "P/cube1")


def test_translate_makes_copies_up_to_its_distance() -> None:
    done = run("c = Cuboid(0.1, 0.1, 0.1, True)", "attach(c, bbox, 0.5, 0.0, 0.5, 0.1, 0.0, 0.5)",
               "translate(c, X, 3, 0.6)")  # fmt: skip
    same(done.centres[:, 0], [-0.8, -0.4, 0.0, 0.4])


def test_a_copy_does_not_leave_what_it_is_attached_to() -> None:
    done = run("c = Cuboid(0.1, 0.1, 0.1, True)", "attach(c, bbox, 0.5, 0.0, 0.5, 0.9, 0.0, 0.5)",
               "translate(c, X, 1, 0.6)")  # fmt: skip
    same(done.centres[:, 0], [0.8, 1.0])


CHILD = """Assembly Q { bbox = Cuboid(0.4, 0.4, 0.4, True)
leaf = Cuboid(0.1, 0.2, 0.3, True)
attach(leaf, bbox, 0.0, 0.0, 0.5, 0.0, 0.0, 0.5) }"""


def test_the_cuboids_of_an_assembly_grow_with_it_in_place() -> None:
    root = "Assembly P { bbox = Cuboid(2.0, 2.0, 2.0, True) Q = Cuboid(0.8, 0.4, 0.4, True) %s }"
    done = execute(parse(root % "attach(Q, bbox, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5)" + CHILD))
    same(done.sizes, [[0.2, 0.2, 0.3]])
    same(done.centres, [[-0.15, -0.9, 0.0]])
    assert (done.names, done.nodes.tolist()) == (("P/Q/leaf",), [1])


def test_a_mirrored_assembly_is_mirrored_inside_with_all_that_is_below_it() -> None:
    text = """Assembly P { bbox = Cuboid(2.0, 2.0, 2.0, True) R = Cuboid(0.4, 0.4, 0.4, True)
    attach(R, bbox, 0.5, 0.0, 0.5, 0.2, 0.0, 0.5) reflect(R, X) }
    Assembly R { bbox = Cuboid(0.4, 0.4, 0.4, True) Q = Cuboid(0.4, 0.4, 0.4, True)
    attach(Q, bbox, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5) }"""
    done = execute(parse(text + CHILD))
    assert done.names == ("P/R/Q/leaf", "P/cube1/Q/leaf")
    same(np.sort(done.corners[1] * [-1, 1, 1], axis=0), np.sort(done.corners[0], axis=0))
    same(np.linalg.det(done.frames), [1.0, 1.0])


def test_programs_together_are_the_same_as_one_by_one() -> None:
    texts = [CHILD, CHILD.replace("0.3", "0.2"), "Assembly E { bbox = Cuboid(1.0, 1.0, 1.0, True) }", CHILD]
    together = execute_all([parse(text) for text in texts])
    for text, done in zip(texts, together, strict=True):
        alone = execute(parse(text))
        assert np.array_equal(done.corners, alone.corners)
        assert done.names == alone.names
    assert execute_all([]) == []


@settings(deadline=None, max_examples=200)
@given(programs(depth=3))
def test_every_valid_program_is_executed_to_finite_boxes(program: AssemblyProgram) -> None:
    done = execute(program)
    assert np.isfinite(done.corners).all()
    assert (done.sizes > 0).all()
    same(np.linalg.det(done.frames), 1.0)
    assert len(set(done.names)) == len(done)
    lengths = np.linalg.norm(done.corners[:, [4, 2, 1]] - done.corners[:, :1], axis=2)
    np.testing.assert_allclose(lengths, done.sizes, rtol=1e-6, atol=1e-9)


def renamed(program: AssemblyProgram) -> AssemblyProgram:
    """The program with other names for assemblies and cuboids; copies keep theirs."""
    names = {block.name: f"assembly_{block.name}" for block in program.blocks}
    names |= {
        cuboid.name: names.get(cuboid.name, f"part_{cuboid.name}") for b in program.blocks for cuboid in b.cuboids
    }
    names[BBOX] = BBOX

    def change(line: Line) -> Line:
        if isinstance(line, Cuboid):
            return replace(line, name=names[line.name])
        if isinstance(line, Attach):
            return replace(line, moved=names[line.moved], target=names[line.target])
        if isinstance(line, Squeeze):
            return replace(line, moved=names[line.moved], first=names[line.first], second=names[line.second])
        return replace(line, moved=names[line.moved])

    return AssemblyProgram(tuple(replace(block, name=names[block.name]) for block in program.with_lines(change).blocks))


@settings(deadline=None)
@given(programs())
def test_execution_ignores_names(program: AssemblyProgram) -> None:
    assert np.array_equal(execute(renamed(program)).corners, execute(program).corners)


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
@pytest.mark.parametrize("expanded", [False, True])
def test_reflecting_twice_gives_the_cuboid_itself(axis: str, expanded: bool) -> None:
    name = "Q" if expanded else "c"
    joints = f"""attach({name}, bbox, 0.5, 0.0, 0.5, 0.2, 0.1, 0.3)
    attach({name}, bbox, 0.4, 1.0, 0.6, 0.4, 0.9, 0.6)"""
    text = f"""Assembly P {{ bbox = Cuboid(2.0, 2.0, 2.0, True) {name} = Cuboid(0.4, 0.4, 0.4, False)
    {joints} reflect({name}, {axis}) reflect(cube1, {axis}) }}"""
    done = execute(parse(text + (CHILD if expanded else "")))
    assert len(done) == 3
    same(done.corners[2], done.corners[0])
    assert not np.allclose(done.corners[1], done.corners[0], atol=1e-3)


SHARE = st.floats(0, 1)
POINT = st.tuples(SHARE, SHARE, SHARE)
SIZE = st.tuples(*[st.floats(0.1, 1)] * 3)
WHOLE = Cuboid(BBOX, (4.0, 4.0, 4.0), True)
STAND = Attach("child", BBOX, (0.5, 0.0, 0.5), (0.3, 0.0, 0.4))
TURN = Attach("child", BBOX, (1.0, 1.0, 1.0), (0.9, 0.9, 0.9))


@settings(deadline=None)
@given(SIZE, st.lists(st.tuples(SIZE, st.integers(0, 3), POINT, POINT), min_size=1, max_size=4))
def test_hierarchy_equals_its_single_assembly(size: Point, parts: list[tuple[Point, int, Point, Point]]) -> None:
    """One attachment a cuboid: to the one that the child stands for, or to one of the child's before it."""
    child = Cuboid("child", size, False)
    cuboids = [Cuboid(f"part{index}", dims, True) for index, (dims, _, _, _) in enumerate(parts)]
    names = [BBOX, *(cuboid.name for cuboid in cuboids)]
    joints = [
        Attach(names[index + 1], names[min(target, index)], source, goal)
        for index, (_, target, source, goal) in enumerate(parts)
    ]
    below = Block("child", Cuboid(BBOX, size, True), (*cuboids, *joints))
    inner = [replace(joint, target="child") if joint.target == BBOX else joint for joint in joints]
    deep = execute(AssemblyProgram((Block("root", WHOLE, (child, STAND)), below)))
    flat = execute(AssemblyProgram((Block("root", WHOLE, (child, *cuboids, STAND, *inner)),)))
    same(deep.corners, flat.corners[1:])
    # Where the child is stretched and turned, its cuboids are stretched like it, in place, and turned with it.
    turned = execute(AssemblyProgram((Block("root", WHOLE, (child, STAND, TURN)), below)))
    outer = execute(AssemblyProgram((Block("root", WHOLE, (child, STAND, TURN)),)))
    frame, stretched = outer.frames[0], outer.sizes[0] / size
    same(turned.sizes, deep.sizes * stretched)
    same(turned.frames, np.broadcast_to(frame, turned.frames.shape))
    same(turned.centres, (deep.centres - flat.centres[0]) @ frame.T + outer.centres[0])


HEAD = "Assembly P { bbox = Cuboid(1.0, 1.0, 1.0, True) c = Cuboid(0.5, 0.5, 0.5, True) "


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (HEAD + "attach(d, bbox, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5) }", "unknown name"),
        (HEAD + "attach(c, d, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5) d = Cuboid(1.0, 1.0, 1.0, True) }", "unknown name"),
        (HEAD + "c = Cuboid(0.5, 0.5, 0.5, True) }", "name taken"),
        (HEAD + "bbox = Cuboid(0.5, 0.5, 0.5, True) }", "name taken"),
        (HEAD + "reflect(c, X) cube1 = Cuboid(0.5, 0.5, 0.5, True) }", "name taken"),
        (HEAD + "attach(bbox, c, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5) }", "bounding box moved"),
        (HEAD + "reflect(bbox, X) }", "bounding box moved"),
        (HEAD + "attach(c, c, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5) }", "attached to itself"),
        (HEAD + "squeeze(c, bbox, c, top, 0.5, 0.5) }", "attached to itself"),
        (HEAD + "d = Cuboid(0.5, 0.0, 0.5, True) }", "size"),
        (HEAD + "d = Cuboid(0.5, -1.0, 0.5, True) }", "size"),
        (HEAD + "P = Cuboid(0.5, 0.5, 0.5, True) }", "too deep"),
    ],
)
def test_program_that_cannot_be_executed_is_refused_with_its_line(text: str, reason: str) -> None:
    with pytest.raises(ProgramError) as caught:
        execute(parse(text))
    assert caught.value.reason == reason
    assert reason == "too deep" or "P, " in str(caught.value)


def nested(levels: int, width: int) -> str:
    """Assemblies of `width` cuboids each, all expanded by the next."""
    blocks = []
    for level in range(levels):
        inner = f"A{level + 1} = Cuboid(0.5, 0.5, 0.5, True) attach(A{level + 1}, bbox, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5) "
        inner += f"translate(A{level + 1}, X, {width - 1}, 0.5)" if width > 1 else ""
        blocks.append(f"Assembly A{level} {{ bbox = Cuboid(1.0, 1.0, 1.0, True) {inner} }}")
    return "\n".join(blocks)


def test_hostile_sizes_are_refused() -> None:
    for text, reason in [
        (nested(40, 1), "too deep"),
        (nested(12, 30), "too many cuboids"),
        (HEAD + f"translate(c, X, {MAX_COPIES}, 0.5) " * 11 + "}", "too many cuboids"),
        (
            HEAD + "attach(c, bbox, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5) " * 200 + "translate(c, X, 999, 0.5) }",
            "too many attachm",
        ),
    ]:
        with pytest.raises(ProgramError, match=reason):
            execute(parse(text))


def test_endless_program_is_refused() -> None:
    far = "d = Cuboid(1e6, 1e6, 1e6, True) attach(d, bbox, 0.0, 0.0, 0.0, 1e6, 1e6, 1e6) "
    with pytest.raises(ProgramError, match="too far"):
        execute(parse(HEAD + far + "attach(c, d, 0.5, 0.5, 0.5, 1e6, 1e6, 1e6) }"))


@settings(deadline=None, max_examples=30)
@given(programs())
def test_copies_can_be_named_by_later_lines(program: AssemblyProgram) -> None:
    """Only where a copy is: the number in its name is that of the cuboids before it."""
    first = program.root.cuboids[0].name
    block = Block(program.root.name, program.root.bbox, (*program.root.lines, Translate(first, "X", 2, 0.1)))
    made = sum(1 if isinstance(x, Reflect) else x.copies for x in block.lines if isinstance(x, Reflect | Translate))
    last = f"cube{len(block.cuboids) + made - 1}"
    more = replace(block, lines=(*block.lines, Reflect(last, "Z")))
    text = print_program(AssemblyProgram((more, *program.blocks[1:])))
    assert len(execute(parse(text)).node_names) >= len(program.blocks)
