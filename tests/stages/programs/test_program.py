"""Programs: parts, shapes, constraints, and how they are found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.errors import ConfigError
from stages.programs.conditions import Condition
from stages.programs.curves import Part, box
from stages.programs.parameters import ParameterError
from stages.programs.program import BuildError, Constraint, build_shape, find_program, shape_from_text
from stages.shape.geometry.pose import transform_points
from tests.stages.programs.stool import PROGRAM

STOOL = "tests.stages.programs.stool"


def test_shape_has_a_labelled_mesh_per_part() -> None:
    shape = build_shape(PROGRAM, PROGRAM.schema.base)
    assert [mesh.name for mesh in shape.meshes] == ["seat", "leg", "leg", "rail"]
    assert shape.label_of.tolist() == [0, 1, 1, 2]
    assert shape.assembly.types.tolist() == [0, 1, 2, 3]
    assert shape.up == "y"


def test_pose_is_the_middle_of_its_part() -> None:
    shape = build_shape(PROGRAM, PROGRAM.schema.base)
    for part, mesh, pose in zip(PROGRAM.parts(PROGRAM.schema.base), shape.meshes, shape.assembly.poses, strict=True):
        np.testing.assert_allclose(mesh.bounds.sum(axis=0), 0.0, atol=1e-12)
        np.testing.assert_array_equal(pose[:3, :3], np.eye(3))
        np.testing.assert_allclose(transform_points(pose, mesh.vertices), part.mesh.vertices, atol=1e-12)


def test_hidden_parameters_have_no_effect() -> None:
    bare = {**PROGRAM.schema.base, "has_rail": False}
    for height in (0.1, 0.6):
        for part, other in zip(PROGRAM.parts(bare), PROGRAM.parts({**bare, "rail_height": height}), strict=True):
            np.testing.assert_array_equal(part.mesh.vertices, other.mesh.vertices)


def test_shape_is_built_from_its_text() -> None:
    values = PROGRAM.schema.complete({"height": 0.77, "rail_height": 0.2})
    there, back = build_shape(PROGRAM, values), shape_from_text(STOOL, PROGRAM.schema.to_text(values))
    for mesh, other in zip(there.meshes, back.meshes, strict=True):
        np.testing.assert_array_equal(mesh.vertices, other.vertices)
    with pytest.raises(ParameterError, match="height: 5 is out of range"):
        shape_from_text(STOOL, '{"height":5}')


def test_constraint_applies_only_while_its_parameters_are_visible() -> None:
    low = {**PROGRAM.schema.base, "height": 0.3, "rail_height": 0.6}
    assert [constraint.name for constraint in PROGRAM.violated(low)] == ["rail_above_seat"]
    assert not PROGRAM.violated({**low, "has_rail": False})
    assert not PROGRAM.violated({**low, "rail_height": 0.3})


def test_failing_build_reports_its_values() -> None:
    flat = replace(PROGRAM, build=lambda values: [Part("seat", box((values["height"] - 0.3, 1, 1)), (9, 9, 9))])
    with pytest.raises(ValueError, match=r'program stool fails at {"height":0\.3,.*: three sizes'):
        flat.parts({**PROGRAM.schema.base, "height": 0.3})


def test_any_exception_is_reported_with_the_values() -> None:
    hollow = replace(PROGRAM, build=lambda values: [[][int(values["height"])]])
    with pytest.raises(BuildError, match=r'stool fails at {"height":0\.3,.*: IndexError: list index out of range'):
        hollow.parts({**PROGRAM.schema.base, "height": 0.3})


def test_unknown_parameters_and_labels_are_refused() -> None:
    with pytest.raises(ValueError, match="constraint wide uses width, which is no parameter"):
        replace(PROGRAM, constraints=(Constraint("wide", Condition("width > 1"), "."),))
    with pytest.raises(ValueError, match="non_intersecting has 'lid', which is no label; labels are seat, leg, rail"):
        replace(PROGRAM, non_intersecting=(("seat", "lid"),))


def test_program_is_found_by_its_module_and_a_missing_one_reported() -> None:
    assert find_program(STOOL).name == "stool"
    with pytest.raises(ConfigError, match="there is no program 'stoool'"):
        find_program("stoool")
    with pytest.raises(ConfigError, match=r"no\.such"):
        find_program("no.such")
    with pytest.raises(ConfigError, match=r"must hold PROGRAM = Program"):
        find_program("stages.programs.conditions")
