"""Draws, repair, effects, intersections and the sampler."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from pipeline.errors import ShardFailed
from stages.programs.conditions import Condition
from stages.programs.curves import Part, box, ellipsoid
from stages.programs.draws import Share, draw
from stages.programs.intersection import meshes_intersect
from stages.programs.program import Constraint, Program
from stages.programs.repair import repair
from stages.programs.sampling import Sampler, all_value_indices, has_effect, same_geometry, structure_digest
from stages.programs.schema import Values
from tests.stages.programs.block import PROGRAM as BLOCK
from tests.stages.programs.stool import PROGRAM

SCHEMA = PROGRAM.schema
BASE = SCHEMA.base


class TestDraws:
    def test_values_are_equally_likely(self) -> None:
        draws = draw(SCHEMA, 20_000, np.random.default_rng(1), off_grid=False)
        for parameter, row in zip(PROGRAM.parameters[:3], draws.columns, strict=False):
            values, counts = np.unique(row, return_counts=True)
            np.testing.assert_array_equal(values, np.array(parameter.values, dtype=float))
            assert np.abs(counts * len(values) / 20_000 - 1).max() < 0.1

    def test_off_grid_values_fill_the_range(self) -> None:
        draws = draw(SCHEMA, 5000, np.random.default_rng(1), off_grid=True)
        height, _, rail, _ = draws.columns
        assert len(np.unique(height)) > 2000
        assert height.min() >= 0.3
        assert height.max() <= 1.0
        assert set(rail.tolist()) == {0.0, 1.0}

    def test_fixed_value_is_in_every_draw(self) -> None:
        draws = draw(SCHEMA, 50, np.random.default_rng(1), off_grid=False, fixed=("scale x", 0.5))
        assert set(draws.columns[1].tolist()) == {0.5}

    def test_shares_partition_the_shapes(self) -> None:
        draws = draw(SCHEMA, 3000, np.random.default_rng(2), off_grid=False)
        cuts = [0.0, 0.1, 0.35, 0.9, 1.0]
        owned = [draws.owned(Share(shapes=interval)) for interval in itertools.pairwise(cuts)]
        np.testing.assert_array_equal(np.sort(np.concatenate(owned)), np.arange(3000))
        texts = [{SCHEMA.to_text(SCHEMA.from_vector(draws.columns[:, k])) for k in columns} for columns in owned]
        assert sum(map(len, texts)) == len(set().union(*texts))

    def test_shares_have_their_size(self) -> None:
        draws = draw(SCHEMA, 50_000, np.random.default_rng(3), off_grid=True)
        share = Share(shapes=(0.2, 0.5))
        assert len(draws.owned(share)) / 50_000 == pytest.approx(share.size, abs=0.01)

    def test_shapes_of_one_structure_are_in_one_share(self) -> None:
        draws = draw(SCHEMA, 500, np.random.default_rng(4), off_grid=True)
        for share in (Share(structures=(0.0, 0.5)), Share(structures=(0.5, 1.0))):
            owned = draws.owned(share)
            rails = set(draws.columns[2, owned].tolist())
            assert len(owned) == sum(rail in rails for rail in draws.columns[2].tolist())


class TestRepair:
    def test_repair_finds_the_nearest_valid_values(self) -> None:
        broken = {**BASE, "height": 0.4, "rail_height": 0.5}
        assert repair(PROGRAM, broken, {"height"}) == {**broken, "rail_height": 0.4}
        assert repair(PROGRAM, broken, {"rail_height"}) == {**broken, "height": 0.5}
        unrepaired = repair(PROGRAM, broken, {"height", "rail_height"})
        assert unrepaired is None

    def test_valid_values_are_unchanged(self) -> None:
        assert repair(PROGRAM, BASE) == BASE

    def test_several_constraints_at_once(self) -> None:
        low = Constraint("low", Condition("height + rail_height <= 0.7"), ".")
        program = replace(PROGRAM, constraints=(*PROGRAM.constraints, low))
        repaired = repair(program, {**BASE, "height": 0.5, "rail_height": 0.6})
        assert repaired is not None
        assert not program.violated(repaired)


class TestEffect:
    def test_parameter_with_different_neighbours_takes_effect(self) -> None:
        assert all(has_effect(PROGRAM, BASE, name, PROGRAM.parts(BASE)) for name in SCHEMA.by_name)

    def test_saturated_parameter_takes_no_effect(self) -> None:
        stiff = replace(PROGRAM, build=lambda values: PROGRAM.build({**values, "height": max(values["height"], 0.6)}))
        for height, expected in ((0.3, False), (0.5, False), (0.6, False), (0.7, True)):
            values = {**BASE, "height": height}
            assert has_effect(stiff, values, "height", stiff.parts(values)) == expected

    def test_forbidden_values_are_skipped(self) -> None:
        # Under a seat at 0.4 the rail cannot rise, so only its lower neighbour is tried.
        deaf = replace(PROGRAM, build=lambda values: PROGRAM.build({**values, "rail_height": 0.2}))
        values = {**BASE, "height": 0.4, "rail_height": 0.4}
        assert has_effect(PROGRAM, values, "rail_height", PROGRAM.parts(values))
        assert not has_effect(deaf, values, "rail_height", deaf.parts(values))

    def test_revealed_parameters_are_repaired(self) -> None:
        low_seat = SCHEMA.canonical({**BASE, "height": 0.3, "has_rail": False})[0]
        high_rail = replace(PROGRAM, parameters=(*PROGRAM.parameters[:3], replace(PROGRAM.parameters[3], base=0.6)))
        assert high_rail.violated({**low_seat, "has_rail": True, "rail_height": 0.6})
        assert has_effect(high_rail, high_rail.schema.canonical(low_seat)[0], "has_rail", high_rail.parts(low_seat))

    def test_same_geometry_compares_part_by_part(self) -> None:
        parts = PROGRAM.parts(BASE)
        assert same_geometry(parts, PROGRAM.parts(dict(BASE)))
        assert not same_geometry(parts, parts[:-1])
        assert not same_geometry(parts, [*parts[:-1], replace(parts[-1], label="leg")])
        assert not same_geometry(parts, PROGRAM.parts({**BASE, "scale x": 0.5001}))


class TestIntersection:
    @pytest.mark.parametrize(("gap", "met"), [(-0.2, True), (0.01, False), (3.0, False)])
    def test_boxes_side_by_side(self, gap: float, met: bool) -> None:
        assert meshes_intersect(box((1, 1, 1)), box((1, 1, 1), (1 + gap, 0.1, 0.2))) == met
        assert meshes_intersect(box((1, 1, 1)), box((1, 1, 1), (1 + gap, 0.1, 0.2)), distance=0.02) == (gap < 0.02)

    def test_contained_part_intersects(self) -> None:
        ball, crumb = ellipsoid((1, 1, 1)), box((0.2, 0.2, 0.2))
        assert meshes_intersect(ball, crumb)
        assert meshes_intersect(crumb, ball)

    def test_overlapping_boxes_alone_do_not_intersect(self) -> None:
        assert not meshes_intersect(ellipsoid((1, 1, 1)), box((0.2, 0.2, 0.2), (0.85, 0.85, 0.85)))


class TestSampler:
    def sampler(self, program: Program = PROGRAM, off_grid: bool = False) -> Sampler:
        return Sampler(program, Share(), off_grid)

    def test_all_value_indices_are_in_order(self) -> None:
        assert len(all_value_indices(PROGRAM)) == 8 + 8 + 2 + 6
        assert all_value_indices(PROGRAM)[8:10] == [("scale x", 0), ("scale x", 1)]

    @pytest.mark.parametrize("value_index", all_value_indices(PROGRAM), ids=str)
    def test_found_shape_has_the_fixed_value_visible_and_effective(self, value_index: tuple[str, int]) -> None:
        name, index = value_index
        sampler = self.sampler()
        rng = np.random.default_rng(5)
        texts = set()
        for _ in range(6):
            values = sampler.find(value_index, rng)
            assert values[name] == SCHEMA.by_name[name].values[index]
            assert name in SCHEMA.canonical(values)[1]
            assert not PROGRAM.violated(values)
            assert has_effect(PROGRAM, values, name, PROGRAM.parts(values))
            # The rail is thick, so it must be well below the seat.
            assert not values["has_rail"] or values["height"] > values["rail_height"] + 0.05
            texts.add(SCHEMA.to_text(values))
        assert len(texts) == 6

    def test_refused_draws_are_counted_by_parameter_and_reason(self) -> None:
        sampler = self.sampler()
        rng = np.random.default_rng(6)
        for _ in range(20):
            sampler.find(("rail_height", 4), rng)
        assert {name for name, _ in sampler.refused} == {"rail_height"}
        assert {reason for _, reason in sampler.refused} >= {
            "hidden",
            "violates rail_above_seat",
            "seat intersects rail",
        }
        assert sampler.tried == 20 + sum(sampler.refused.values())

    def test_impossible_value_is_reported_with_reasons(self) -> None:
        never = replace(PROGRAM, constraints=(Constraint("never", Condition("height < 0"), "."),))
        with pytest.raises(
            ShardFailed, match=r"stool: no shape with height = 0\.4 in 2\d+ tries \(2\d+ violates never\)"
        ):
            self.sampler(never).find(("height", 1), np.random.default_rng(1))

    def test_failing_builds_are_refused(self) -> None:
        def build(values: Values) -> list[Part]:
            if values["height"] < 0.5:
                raise IndexError("no rung")
            return list(PROGRAM.build(values))

        rickety, rng = self.sampler(replace(PROGRAM, build=build)), np.random.default_rng(6)
        assert all(rickety.find(None, rng)["height"] >= 0.5 for _ in range(5))
        assert rickety.refused["any", "build fails"] > 0
        with pytest.raises(ShardFailed, match=r'; program stool fails at {"height":0\.3.*: IndexError: no rung'):
            rickety.find(("height", 0), rng)

    def test_finite_program_ends_after_all_its_shapes(self) -> None:
        sampler = self.sampler(BLOCK)
        rng = np.random.default_rng(1)
        texts = {BLOCK.schema.to_text(sampler.find(None, rng)) for _ in range(6)}
        assert len(texts) == 6
        with pytest.raises(ShardFailed, match="duplicate"):
            sampler.find(None, rng)

    def test_structure_is_visible_and_not_continuous(self) -> None:
        bare = {**BASE, "has_rail": False}
        assert structure_digest(PROGRAM, BASE) == structure_digest(PROGRAM, {**BASE, "height": 0.9})
        assert structure_digest(PROGRAM, BASE) != structure_digest(PROGRAM, bare)
        assert structure_digest(PROGRAM, BASE) != structure_digest(replace(PROGRAM, name="bench"), BASE)
