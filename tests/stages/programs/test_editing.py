"""Mixing and interpolation of shapes."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stages.programs.conditions import Condition
from stages.programs.editing import interpolate, mix_values
from stages.programs.parameters import ParameterError, Value
from stages.programs.program import Constraint
from tests.stages.programs.rack import PROGRAM as RACK
from tests.stages.programs.stool import PROGRAM

BASE = PROGRAM.schema.base

valid_values = (
    st.fixed_dictionaries({parameter.name: st.sampled_from(parameter.values) for parameter in PROGRAM.parameters})
    .map(lambda values: PROGRAM.schema.canonical(values)[0])
    .filter(lambda values: not PROGRAM.violated(values))
)


class TestMix:
    @given(valid_values, valid_values)
    def test_copied_group_is_as_in_the_source_and_valid(
        self, target: dict[str, Value], source: dict[str, Value]
    ) -> None:
        mixed = mix_values(PROGRAM, target, source, ["seat"])
        assert not PROGRAM.violated(mixed)
        assert (mixed["height"], mixed["scale x"]) == (source["height"], source["scale x"])
        assert mixed["has_rail"] == target["has_rail"]

    @given(valid_values)
    def test_mixing_with_itself_changes_nothing(self, values: dict[str, Value]) -> None:
        assert mix_values(PROGRAM, values, values, ["rail"]) == values

    def test_uncopied_parameters_are_repaired(self) -> None:
        source = {"height": 0.3, "scale x": 1.1, "has_rail": False, "rail_height": 0.3}
        mixed = mix_values(PROGRAM, {**BASE, "rail_height": 0.5}, source, ["seat"])
        assert mixed == {"height": 0.3, "scale x": 1.1, "has_rail": True, "rail_height": 0.3}

    def test_copied_parameters_change_only_as_a_last_resort(self) -> None:
        # All parameters of the constraint are in the copied group.
        tight = replace(PROGRAM, constraints=(Constraint("wide", Condition("height < 0.5"), "."),))
        assert mix_values(tight, {**BASE, "height": 0.4}, {**BASE, "height": 0.9}, ["seat"])["height"] == 0.4

    def test_unknown_group_is_reported_with_the_known_ones(self) -> None:
        with pytest.raises(ParameterError, match="there is no group 'legs'; groups are seat, rail"):
            mix_values(PROGRAM, BASE, BASE, ["legs"])

    def test_unsatisfiable_constraints_are_reported(self) -> None:
        never = replace(PROGRAM, constraints=(Constraint("never", Condition("height < 0"), "."),))
        with pytest.raises(ParameterError, match="stool: no values near these satisfy height < 0"):
            mix_values(never, BASE, BASE, ["seat"])


class TestInterpolate:
    @given(valid_values, valid_values, st.floats(0, 1))
    def test_every_step_is_valid_and_the_ends_are_the_shapes(
        self, first: dict[str, Value], last: dict[str, Value], share: float
    ) -> None:
        text = PROGRAM.schema.to_text
        assert text(interpolate(PROGRAM, first, last, 0.0)) == text(first)
        assert text(interpolate(PROGRAM, first, last, 1.0)) == text(last)
        assert not PROGRAM.violated(interpolate(PROGRAM, first, last, share))

    def test_continuous_parameters_move_linearly(self) -> None:
        between = interpolate(PROGRAM, {**BASE, "height": 0.4}, {**BASE, "height": 0.8}, 0.25)
        assert between["height"] == pytest.approx(0.5)

    def test_discrete_parameters_take_the_nearest_value(self) -> None:
        first, last = ({**RACK.schema.base, "boards": boards} for boards in (2, 6))
        steps = [interpolate(RACK, first, last, share)["boards"] for share in (0, 0.1, 0.2, 0.4, 0.6, 0.9, 1)]
        assert steps == [2, 2, 3, 4, 4, 6, 6]
        assert interpolate(RACK, first, last, 0.125)["boards"] == 3
        assert interpolate(RACK, last, first, 0.125)["boards"] == 5

    def test_parameter_visible_in_one_shape_has_its_value_there(self) -> None:
        bare, railed = {**BASE, "has_rail": False}, {**BASE, "rail_height": 0.5}
        for share, expected in ((0.2, 0.3), (0.6, 0.5), (1.0, 0.5)):
            assert interpolate(PROGRAM, bare, railed, share)["rail_height"] == expected
            assert interpolate(PROGRAM, bare, railed, share)["has_rail"] == (share > 0.5)

    @given(valid_values, valid_values, st.floats(0, 1))
    def test_group_changes_alone_and_ends_as_a_mix(
        self, first: dict[str, Value], last: dict[str, Value], share: float
    ) -> None:
        text = PROGRAM.schema.to_text
        between = interpolate(PROGRAM, first, last, share, ["seat"])
        assert between["has_rail"] == first["has_rail"]
        assert between["height"] == interpolate(PROGRAM, first, last, share)["height"]
        assert text(interpolate(PROGRAM, first, last, 1.0, ["seat"])) == text(
            mix_values(PROGRAM, first, last, ["seat"])
        )

    def test_unknown_group_is_reported(self) -> None:
        with pytest.raises(ParameterError, match="there is no group 'legs'"):
            interpolate(PROGRAM, BASE, BASE, 0.5, ["legs"])
