"""Chairs: the published table, every value effective, every shape whole, closed and on the ground."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from stages.programs.conditions import Condition
from stages.programs.curves import QuadMesh, mesh_defects
from stages.programs.draws import draw
from stages.programs.effect import has_effect, same_geometry
from stages.programs.library.chair import PROGRAM
from stages.programs.parameters import Value
from stages.programs.repair import repair
from stages.programs.sheets import values_showing
from stages.shape.kit import PartMesh

PUBLISHED = Path(__file__).resolve().parents[5] / "shared" / "geocode" / "params_chair.json"


def random_chairs(count: int, seed: int) -> list[dict[str, Value]]:
    """Values that keep the constraints, from the listed values and, every other one, from anywhere between."""
    rng = np.random.default_rng(seed)
    found: list[dict[str, Value]] = []
    for between in (False, True):
        columns = draw(PROGRAM.schema, 4 * count, rng, between).columns
        every = (PROGRAM.schema.from_vector(column) for column in columns.T)
        found += [values for values in every if not PROGRAM.violated(values)][: (count + 1) // 2]
    return found[:count]


def meshes_of(values: Mapping[str, Value]) -> list[PartMesh]:
    """The triangles of the parts of a chair."""
    return [part.part_mesh() for part in PROGRAM.parts(values)]


def loose_parts(parts: list[PartMesh]) -> list[str]:
    """The names of parts to which no way leads from the first over parts that touch or meet."""
    from stages.shape.geometry.mesh_pairs import build_tree, first_contact

    trees = [build_tree(part.vertices, part.faces) for part in parts]
    boxes = np.stack([part.bounds for part in parts])
    loose, waiting = set(range(1, len(parts))), [0]
    while waiting:
        one = waiting.pop()
        near = (boxes[:, 0] <= boxes[one, 1]).all(axis=1) & (boxes[:, 1] >= boxes[one, 0]).all(axis=1)
        for other in sorted(loose):
            if near[other] and first_contact(trees[one], trees[other], np.eye(4), 0.0):
                loose.remove(other)
                waiting.append(other)
    return [parts[each].name for each in sorted(loose)]


def check_whole(values: dict[str, Value]) -> None:
    parts = meshes_of(values)
    # Surfaces are looked at one by one; all at once is faster than mesh by mesh.
    meshes = [QuadMesh(part.vertices, np.column_stack([part.faces, part.faces[:, 2]])) for part in parts]
    assert mesh_defects(QuadMesh.joined(meshes)) == [], values
    assert {part.name for part in parts} <= set(PROGRAM.labels)
    assert min(part.bounds[0][1] for part in parts) == pytest.approx(0.0, abs=1e-9), values
    assert loose_parts(parts) == [], values
    for part in parts:
        mirrored = part.vertices * [-1.0, 1.0, 1.0]
        twins = [other for other in parts if other.name == part.name and len(other.vertices) == len(part.vertices)]
        box = np.stack([mirrored.min(axis=0), mirrored.max(axis=0)])
        assert any(np.allclose(other.bounds, box, atol=1e-6) for other in twins), (part.name, values)


@pytest.mark.skipif(not PUBLISHED.is_file(), reason="the published tables are not here")
def test_table_is_the_published_one() -> None:
    table = json.loads(PUBLISHED.read_text())
    assert [each.name for each in PROGRAM.parameters] == [row["name"] for row in table["params"]]
    for parameter, row in zip(PROGRAM.parameters, table["params"], strict=True):
        kind = {"Boolean": "binary", "Integer": "discrete"}.get(row["type"], "continuous")
        assert (parameter.kind, list(parameter.values), parameter.base) == (kind, row["values"], row["base"])
        assert parameter.classes == row["n_classes"]
    assert {each.condition.text for each in PROGRAM.constraints} == set(table["constraints"].values())
    rng = np.random.default_rng(3)
    for column in draw(PROGRAM.schema, 300, rng, False).columns.T:
        values = PROGRAM.schema.from_vector(column)
        shown = {row["name"] for row in table["params"] if row["visible_if"] is None or _holds(row, values)}
        assert PROGRAM.schema.canonical(values)[1] == shown


def _holds(row: dict[str, str], values: dict[str, Value]) -> bool:
    return bool(Condition(row["visible_if"]).holds(values))


def test_table_has_the_published_size() -> None:
    assert len(PROGRAM.parameters) == 59
    assert sum(len(each.values) for each in PROGRAM.parameters) == 319
    assert sum(each.classes for each in PROGRAM.parameters) == 364


@pytest.mark.parametrize("parameter", PROGRAM.parameters, ids=lambda each: each.name)
def test_every_value_differs_from_every_other_where_it_is_seen(parameter: object) -> None:
    each = PROGRAM.schema.by_name[parameter.name]  # type: ignore[attr-defined]
    shown = values_showing(PROGRAM, each)
    made = []
    for value in each.values:
        values = repair(PROGRAM, {**shown, each.name: value}, {each.name})
        assert values is not None
        assert has_effect(PROGRAM, values, each.name, PROGRAM.parts(values)), (each.name, value)
        made.append(PROGRAM.parts(values))
    for number, parts in enumerate(made):
        assert not any(same_geometry(parts, others) for others in made[:number])


def test_what_is_seen_takes_effect_in_random_chairs() -> None:
    for values in random_chairs(25, seed=11):
        parts = PROGRAM.parts(values)
        for name in sorted(PROGRAM.schema.canonical(values)[1]):
            assert has_effect(PROGRAM, values, name, parts), (name, values)


def test_random_chairs_are_whole() -> None:
    for values in random_chairs(300, seed=5):
        check_whole(values)


@pytest.mark.slow
def test_many_random_chairs_are_whole() -> None:
    for values in random_chairs(400, seed=6):
        check_whole(values)


def test_extreme_chairs_are_whole() -> None:
    """Chairs in which every parameter stands at one end of its range."""
    rng = np.random.default_rng(8)
    for _ in range(100):
        ends = {each.name: each.values[-int(rng.integers(2))] for each in PROGRAM.parameters}
        values = repair(PROGRAM, ends)
        assert values is not None
        check_whole(values)


def test_a_chair_is_made_alike_each_time() -> None:
    for values in random_chairs(10, seed=2):
        for one, other in zip(meshes_of(values), meshes_of(dict(values)), strict=True):
            assert one.name == other.name
            assert one.vertices.tobytes() == other.vertices.tobytes()
            assert one.faces.tobytes() == other.faces.tobytes()


def test_a_rounder_seat_brings_legs_and_back_together() -> None:
    """geocode §3.2: an edit of the seat's appearance goes on to legs and back."""
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
