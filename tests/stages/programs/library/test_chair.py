"""Chairs: the published table, every value effective, every shape connected, closed and on the ground."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from stages.programs.conditions import Condition
from stages.programs.curves import QuadMesh, mesh_defects
from stages.programs.draws import draw
from stages.programs.library.chair import PROGRAM
from stages.programs.parameters import Parameter, Value
from stages.programs.repair import repair
from stages.programs.sampling import has_effect, same_geometry
from stages.programs.sheets import values_showing
from stages.shape.kit import PartMesh

PUBLISHED = Path(__file__).resolve().parents[5] / "shared" / "geocode" / "params_chair.json"


def random_chairs(count: int, seed: int) -> list[dict[str, Value]]:
    """Valid values, half of them listed values, half off the grid."""
    rng = np.random.default_rng(seed)
    chairs: list[dict[str, Value]] = []
    for off_grid in (False, True):
        columns = draw(PROGRAM.schema, 4 * count, rng, off_grid).columns
        candidates = (PROGRAM.schema.from_vector(column) for column in columns.T)
        chairs += [values for values in candidates if not PROGRAM.violated(values)][: (count + 1) // 2]
    return chairs[:count]


def meshes_of(values: Mapping[str, Value]) -> list[PartMesh]:
    """The triangles of the parts of a chair."""
    return [part.part_mesh() for part in PROGRAM.parts(values)]


def disconnected_parts(parts: list[PartMesh]) -> list[str]:
    """The names of parts that are not connected to the first over parts that touch or intersect."""
    from stages.shape.geometry.mesh_pairs import build_tree, first_contact

    trees = [build_tree(mesh.vertices, mesh.faces) for mesh in parts]
    boxes = np.stack([mesh.bounds for mesh in parts])
    unreached, waiting = set(range(1, len(parts))), [0]
    while waiting:
        part = waiting.pop()
        near = (boxes[:, 0] <= boxes[part, 1]).all(axis=1) & (boxes[:, 1] >= boxes[part, 0]).all(axis=1)
        for other in sorted(unreached):
            if near[other] and first_contact(trees[part], trees[other], np.eye(4), 0.0):
                unreached.remove(other)
                waiting.append(other)
    return [parts[index].name for index in sorted(unreached)]


def check_sound(values: dict[str, Value]) -> None:
    parts = meshes_of(values)
    # Surfaces are checked separately; one joined mesh is faster than many.
    meshes = [QuadMesh(part.vertices, np.column_stack([part.faces, part.faces[:, 2]])) for part in parts]
    assert mesh_defects(QuadMesh.joined(meshes)) == [], values
    assert {part.name for part in parts} <= set(PROGRAM.labels)
    assert min(part.bounds[0][1] for part in parts) == pytest.approx(0.0, abs=1e-9), values
    assert disconnected_parts(parts) == [], values
    for part in parts:
        mirrored = part.vertices * [-1.0, 1.0, 1.0]
        twins = [other for other in parts if other.name == part.name and len(other.vertices) == len(part.vertices)]
        box = np.stack([mirrored.min(axis=0), mirrored.max(axis=0)])
        assert any(np.allclose(other.bounds, box, atol=1e-6) for other in twins), (part.name, values)


@pytest.mark.skipif(not PUBLISHED.is_file(), reason="the published tables are missing")
def test_table_is_the_published_one() -> None:
    table = json.loads(PUBLISHED.read_text(encoding="utf-8"))
    assert [parameter.name for parameter in PROGRAM.parameters] == [row["name"] for row in table["params"]]
    for parameter, row in zip(PROGRAM.parameters, table["params"], strict=True):
        kind = {"Boolean": "binary", "Integer": "discrete"}.get(row["type"], "continuous")
        assert (parameter.kind, list(parameter.values), parameter.base) == (kind, row["values"], row["base"])
        assert parameter.classes == row["n_classes"]
    assert {constraint.condition.text for constraint in PROGRAM.constraints} == set(table["constraints"].values())
    rng = np.random.default_rng(3)
    for column in draw(PROGRAM.schema, 300, rng, False).columns.T:
        values = PROGRAM.schema.from_vector(column)
        shown = {row["name"] for row in table["params"] if not row["visible_if"] or _holds(row, values)}
        assert PROGRAM.schema.canonical(values)[1] == shown


def _holds(row: dict[str, str], values: dict[str, Value]) -> bool:
    return bool(Condition(row["visible_if"]).holds(values))


def test_table_has_the_published_size() -> None:
    assert len(PROGRAM.parameters) == 59
    assert sum(len(parameter.values) for parameter in PROGRAM.parameters) == 319
    assert sum(parameter.classes for parameter in PROGRAM.parameters) == 364


@pytest.mark.parametrize("parameter", PROGRAM.parameters, ids=lambda parameter: parameter.name)
def test_every_value_differs_where_it_is_visible(parameter: Parameter) -> None:
    shown = values_showing(PROGRAM, parameter)
    shapes = []
    for value in parameter.values:
        values = repair(PROGRAM, {**shown, parameter.name: value}, {parameter.name})
        assert values is not None
        assert has_effect(PROGRAM, values, parameter.name, PROGRAM.parts(values)), (parameter.name, value)
        shapes.append(PROGRAM.parts(values))
    for number, parts in enumerate(shapes):
        assert not any(same_geometry(parts, others) for others in shapes[:number])


def test_visible_parameters_take_effect() -> None:
    for values in random_chairs(25, seed=11):
        parts = PROGRAM.parts(values)
        for name in sorted(PROGRAM.schema.canonical(values)[1]):
            assert has_effect(PROGRAM, values, name, parts), (name, values)


def test_random_chairs_are_sound() -> None:
    for values in random_chairs(300, seed=5):
        check_sound(values)


def test_extreme_chairs_are_sound() -> None:
    """Chairs with every parameter at one end of its range."""
    rng = np.random.default_rng(8)
    for _ in range(100):
        ends = {parameter.name: parameter.values[-int(rng.integers(2))] for parameter in PROGRAM.parameters}
        values = repair(PROGRAM, ends)
        assert values is not None
        check_sound(values)


def test_chairs_are_deterministic() -> None:
    for values in random_chairs(10, seed=2):
        for mesh, other in zip(meshes_of(values), meshes_of(dict(values)), strict=True):
            assert mesh.name == other.name
            assert mesh.vertices.tobytes() == other.vertices.tobytes()
            assert mesh.faces.tobytes() == other.faces.tobytes()


def test_rounder_seat_brings_legs_and_back_together() -> None:
    """geocode §3.2: an edit of the seat also changes legs and back."""
    reach = []
    for shape in (0.0, 0.5, 1.0):
        parts = meshes_of({**PROGRAM.schema.base, "seat_shape": shape})
        reach.append(
            [max(p.bounds[1][0] for p in parts if p.name == name) for name in ("leg", "back post", "top rail")]
        )
    assert (np.diff(reach, axis=0) < -0.01).all()


def test_arms_leave_room_for_the_cushion() -> None:
    for values in random_chairs(200, seed=9):
        parts = meshes_of({**values, "handles_state": 1, "pillow_state": 2})
        cushion = next(part for part in parts if part.name == "cushion")
        assert min(p.vertices[:, 1].min() for p in parts if p.name == "arm") > cushion.vertices[:, 1].max()
