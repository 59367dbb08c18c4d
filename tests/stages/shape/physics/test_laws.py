"""What must hold of any shape: more friction and more glue never hurt, less support never helps, and neither where a
shape stands nor how large it is matters."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from stages.shape.arrays import FloatArray
from stages.shape.physics import equilibrium
from stages.shape.physics.contacts import ContactPatches
from stages.shape.physics.equilibrium import LoadLimits, load_limits
from stages.shape.physics.judge import Judge, physical_fields, unmet_requirement
from stages.shape.physics.settings import PhysicsConfig, Requirements
from stages.shape.shape import Shape
from tests.stages.shape.geometry.bodies import box
from tests.stages.shape.physics.structures import DRY, judged, solid, standing_on, turned

SEEDS = st.integers(0, 10**6)
FEW = settings(max_examples=25)


def pile(seed: int) -> Shape:
    """Blocks heaped up with small random overhangs, most of them stable."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 6))
    return solid(
        *standing_on(
            rng.uniform(0.2, 1, count).tolist(), rng.uniform(0.6, 1.2, (count, 2)), rng.uniform(-0.2, 0.2, (count, 2))
        )
    )


def stool(legs: list[int]) -> Shape:
    """A plate on some of eight legs in a ring."""
    turns = 2 * np.pi * np.array(legs) / 8 + 0.1
    feet = [box(0.1, 0.1, 1, at=(np.cos(turn), np.sin(turn), 0.5)) for turn in turns]
    return solid(box(2.4, 2.4, 0.1, at=(0, 0, 1.05)), *feet)


def random_problem(seed: int) -> tuple[ContactPatches, FloatArray, FloatArray, FloatArray]:
    """Bodies one above another, random points between them and on the ground, gravity and some pushes."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 5))
    first = np.repeat(np.arange(count), 5)
    points = np.column_stack([rng.uniform(-0.5, 0.5, (5 * count, 2)), first])
    normals = np.array([0, 0, 1.0]) + rng.normal(0, 0.1, (5 * count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals[first == 0] = [0, 0, 1]
    centres = np.column_stack([rng.uniform(-0.2, 0.2, (count, 2)), np.arange(count) + 0.5])
    weights = rng.uniform(0.1, 1, count)
    gravity = np.zeros((count, 6))
    gravity[:, 2] = -weights
    pushes = rng.normal(size=(3, 1, 6)) * weights[:, None] * [1, 1, 0.2, 0.1, 0.1, 0.1]
    return ContactPatches(first, first - 1, first, points, normals), centres, gravity, pushes


def limits(problem: tuple[ContactPatches, FloatArray, FloatArray, FloatArray], friction: float = 0.6) -> LoadLimits:
    patches, *rest = problem
    return load_limits(patches, *rest, friction, np.zeros(len(patches.points)), 0.3)


def brick_wall(seed: int) -> tuple[ContactPatches, FloatArray, FloatArray, FloatArray]:
    """Bricks that each stand on two below and press on their neighbours, weights over five orders of magnitude."""
    rng = np.random.default_rng(seed)
    rows, columns = rng.integers(3, 9, 2).tolist()
    first, second, points, normals = [], [], [], []
    centres = np.array([[column + 0.5 * (row % 2), 0, row + 0.5] for row in range(rows) for column in range(columns)])
    for brick, (x, _, _) in enumerate(centres.tolist()):
        row, column = divmod(brick, columns)
        for aside, below in ((-0.25, column - (row + 1) % 2), (0.25, column + row % 2)):
            carrier = -1 if row == 0 else brick - column - columns + (below if 0 <= below < columns else column)
            touching = [(carrier, (x + aside, y, row), (0, 0, 1)) for y in (-0.3, 0.3)]
            if column:
                touching += [(brick - 1, (x - 0.5, y, row + 0.5 + aside), (1, 0, 0)) for y in (-0.3, 0.3)]
            for other, point, normal in touching:
                first.append(brick)
                second.append(other)
                points.append(point)
                normals.append(normal)
    weights = 10 ** rng.uniform(-5, 0, len(centres))
    gravity = np.zeros((len(centres), 6))
    gravity[:, 2] = -weights
    pushes = np.zeros((2, len(centres), 6))
    pushes[0, :, 0] = pushes[1, :, 1] = weights
    joints = np.arange(len(first))
    patches = ContactPatches(
        np.array(first), np.array(second), joints, np.array(points, float), np.array(normals, float)
    )
    return patches, centres, gravity, pushes


def both_ways(
    problem: tuple[ContactPatches, FloatArray, FloatArray, FloatArray], monkeypatch: pytest.MonkeyPatch
) -> tuple[FloatArray, FloatArray]:
    """The factors by the interior point method, with no HiGHS behind it, and by HiGHS."""
    with monkeypatch.context() as patch:
        patch.setattr(equilibrium, "MAX_HIGHS_COLUMNS", 0)
        patch.setattr(equilibrium, "MAX_HIGHS_ITERATIONS", 0)
        by_interior = limits(problem).factors
    with monkeypatch.context() as patch:
        patch.setattr(equilibrium, "MAX_HIGHS_COLUMNS", 10**9)
        by_highs = limits(problem).factors
    return by_interior, by_highs


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(SEEDS)
def test_interior_point_method_finds_what_highs_finds(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    by_interior, by_highs = both_ways(random_problem(seed), monkeypatch)
    np.testing.assert_allclose(by_interior, by_highs, atol=2e-3)


@pytest.mark.parametrize("seed", range(8))
def test_interior_point_method_finds_what_highs_finds_where_bodies_weigh_far_from_alike(
    monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    by_interior, by_highs = both_ways(brick_wall(seed), monkeypatch)
    np.testing.assert_allclose(by_interior, by_highs, atol=2e-3)


@given(SEEDS)
def test_motion_beyond_the_limit_parts_every_contact_or_slides(seed: int) -> None:
    patches, centres, gravity, pushes = random_problem(seed)
    found = limits((patches, centres, gravity, pushes))
    for factor, motion, push in zip(found.factors, found.motions, pushes, strict=True):
        if 0 <= factor < 1:
            work = ((gravity + (factor + 0.01) * push) * motion).sum()
            moves = motion[patches.first, :3] + np.cross(
                motion[patches.first, 3:], patches.points - centres[patches.first]
            )
            below = patches.second >= 0
            under = patches.second[below]
            moves[below] -= motion[under, :3] + np.cross(motion[under, 3:], patches.points[below] - centres[under])
            scale = max(np.abs(moves).max(), 1e-9)
            assert work > 0, "beyond the limit the loads do work on the mechanism"
            assert (moves * patches.normals).sum(axis=1).min() > -1e-5 * scale, "and no body enters another"


@given(SEEDS, st.floats(0, 1), st.floats(0, 1))
def test_more_friction_never_hurts(seed: int, one: float, other: float) -> None:
    problem = random_problem(seed)
    less, more = limits(problem, min(one, other)), limits(problem, max(one, other))
    assert (more.factors >= less.factors - 1e-6).all()


@given(SEEDS, st.integers(0, 4))
def test_less_contact_never_helps(seed: int, dropped: int) -> None:
    patches, *rest = problem = random_problem(seed)
    kept = np.arange(len(patches.points)) % 5 != dropped
    fewer = ContactPatches(
        *(getattr(patches, name)[kept] for name in ("first", "second", "patch", "points", "normals"))
    )
    assert (limits((fewer, *rest)).factors <= limits(problem).factors + 1e-6).all()


@FEW
@given(SEEDS, st.floats(0, 2), st.floats(0, 2))
def test_more_glue_never_hurts(seed: int, one: float, other: float) -> None:
    shape = pile(seed)
    less, more = (judged(shape, tension=pull, friction=0.5).margin for pull in (min(one, other), max(one, other)))
    assert more >= less - 1e-6 or more == pytest.approx(1)


@FEW
@given(st.sets(st.integers(0, 7), min_size=2), st.sampled_from(["rigid", "dry"]))
def test_a_stool_is_no_better_off_without_one_of_its_legs(legs: set[int], joints: str) -> None:
    whole = judged(stool(sorted(legs)), joints=joints)
    without = judged(stool(sorted(legs)[1:]), joints=joints)
    assert without.stable <= whole.stable
    assert (without.tipping_degrees > 0) <= (whole.tipping_degrees > 0)


@FEW
@given(SEEDS, st.floats(-3, 3), st.floats(0.01, 100), st.tuples(*[st.floats(-5, 5)] * 3))
@pytest.mark.parametrize("joints", ["rigid", "dry"])
def test_neither_place_nor_bearing_nor_size_matters(
    joints: str, seed: int, angle: float, scale: float, shift: tuple[float, float, float]
) -> None:
    config = PhysicsConfig(joints="rigid" if joints == "rigid" else "dry")
    shape = pile(seed)
    before = physical_fields(judged(shape, config))
    after = physical_fields(judged(turned(shape, angle, scale, shift), config))
    assert after.pop("margin") == pytest.approx(before.pop("margin"), abs=2e-3)
    assert after.pop("weakest") == before.pop("weakest") or joints == "dry", "a tie may fall either way"
    assert after == pytest.approx(before, abs=1e-4)


def test_up_says_which_axis_is_up() -> None:
    upright = solid(box(1, 1, 3, at=(0, 0, 1.5)))
    lying = Shape(upright.meshes, upright.assembly, "y", upright.labels)
    assert judged(upright).tipping_degrees == pytest.approx(np.degrees(np.arctan(1 / 3)))
    assert judged(lying).tipping_degrees == pytest.approx(45)


def test_parts_are_connected_up_to_two_hundredths_of_the_diagonal() -> None:
    for gap, rooted in ((0.0195, True), (0.0205, False)):
        foot = box(1, 1, 1, at=(0, 0, 0.5))
        size = np.sqrt(1 + 1 + 2.0**2)
        above = box(1, 1, 1 - gap * size, at=(0, 0, 2 - (1 - gap * size) / 2))
        found = judged(solid(foot, above), PhysicsConfig())
        assert (found.rooted, found.components) == (rooted, 2 - rooted)
        shape = solid(foot, above)
        assert Judge(shape.meshes, "z", PhysicsConfig()).rooted(shape.assembly) is rooted


def test_known_contacts_are_not_asked_again() -> None:
    apart = solid(box(), box(at=(0, 0, 1.1)), box(at=(0, 0, 2.2)))
    assembly = apart.assembly
    known = type(assembly)(assembly.types, assembly.poses, np.array([[0, 1]], np.int32))
    config = PhysicsConfig(connected=0.05)
    assert Judge(apart.meshes, "z", config).validity(known).components == 1
    assert judged(apart, config, connected=0.01).components == 3


def test_open_parts_weigh_by_area() -> None:
    closed, opened = judged(solid(box())), judged(solid(box(sides=5)))
    assert (closed.weighed, opened.weighed) == ("volume", "area")


@pytest.mark.parametrize("place", ["nan", "nothing"])
def test_what_has_no_statics_is_named(place: str) -> None:
    vertices, faces = box()
    shape = solid((vertices * np.nan, faces)) if place == "nan" else solid()
    with pytest.raises(ValueError, match="part 0 stands nowhere" if place == "nan" else "without parts"):
        judged(shape)


def test_requirements_name_what_is_not_met() -> None:
    stands, floats = solid(box()), solid(box(), box(at=(0, 0, 9)))
    falls = solid(box(0.1, 0.1, 1), box(1, 1, 1, at=(0.5, 0, 1)))
    asked = Requirements(rooted=True, stable=True)
    assert [unmet_requirement(asked, shape) for shape in (stands, floats, falls)] == [None, "not rooted", "not stable"]
    assert unmet_requirement(Requirements(), floats) is None
    assert unmet_requirement(Requirements(rooted=True), falls) is None


def test_symmetry_is_the_weight_that_a_mirror_maps_to_its_like() -> None:
    table = [
        box(2, 1, 0.1, at=(0, 0, 1)),
        *(box(0.1, 0.1, 1, at=(x, y, 0.45)) for x in (-0.9, 0.9) for y in (-0.4, 0.4)),
    ]
    assert judged(solid(*table), DRY).symmetry == pytest.approx(1)
    odd = [*table[:-1], box(0.1, 0.1, 1, at=(0.3, 0.1, 0.45))]
    assert judged(solid(*odd), DRY).symmetry < 0.99


def test_ground_is_the_share_of_the_outline_that_is_stood_on() -> None:
    plate = box(2, 2, 0.1, at=(0, 0, 1.05))
    feet = [box(0.5, 0.5, 1, at=(x, y, 0.5)) for x in (-0.75, 0.75) for y in (-0.75, 0.75)]
    assert judged(solid(plate, *feet)).ground == pytest.approx(0.25)


def test_overlap_is_a_share_of_the_volume_of_the_parts() -> None:
    assert judged(solid(box(), box(at=(0.5, 0, 0)))).penetration == pytest.approx(0.25)
    assert judged(solid(box(), box(at=(1, 0, 0)))).penetration == pytest.approx(0, abs=1e-6)
