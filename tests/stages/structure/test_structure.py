"""Hierarchies and symmetries of known shapes, their export, and damaged records."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from stages.export.structurenet import structurenet_files
from stages.package.glb import glb_bytes
from stages.package.glb_shape import glb_shape
from stages.programs.program import build_shape, find_program
from stages.shape.collection.packaged import PackagedSample
from stages.shape.kit import Assembly
from stages.shape.shape import Shape, kit_shape
from stages.shapeassembly.extraction.readers.structurenet import read_structurenet
from stages.shapeassembly.shape import shape_of_program_text
from stages.structure.audit import AUDIT
from stages.structure.hierarchy import path_hierarchy
from stages.structure.settings import StructureConfig
from stages.structure.stage import structure_fields
from stages.structure.symmetry import Symmetry, shape_symmetry
from tests.stages.shape.views.solids import box, cylinder, kit_of, part_type, posed

DESK = Path("datasets/exemplars/programs/desk.txt")
ALL = StructureConfig(hierarchy=True, symmetry=True)


def plates(*places: tuple[float, float, float], turn: float = 0.0) -> Shape:
    """A square plate with thin boxes on it, turned about the vertical."""
    kit = kit_of(part_type("plate", box((2.0, 0.1, 2.0))), part_type("leg", box((0.1, 1.0, 0.2))))
    types = np.array([0] + [1] * len(places), np.int16)
    poses = posed((0.0, 0.0, 0.0), *places)
    cosine, sine = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    matrix = np.array([[cosine, 0, sine, 3.0], [0, 1, 0, 0], [-sine, 0, cosine, -5.0], [0, 0, 0, 1]])
    return kit_shape(kit, Assembly(types, matrix @ poses, np.empty((0, 2), np.int32)))


def found(symmetry: Symmetry) -> list[tuple[str, float]]:
    return [(operation.kind, operation.degrees) for operation in symmetry.operations]


def test_a_table_with_four_oblong_legs_has_two_mirrors_and_a_half_turn() -> None:
    symmetry = shape_symmetry(plates((0.8, 0.5, 0.7), (-0.8, 0.5, 0.7), (0.8, 0.5, -0.7), (-0.8, 0.5, -0.7)))
    assert found(symmetry) == [("rotation", 0.0), ("rotation", 180.0), ("mirror", 0.0), ("mirror", 90.0)]
    assert symmetry.orbits == (0, 1, 1, 1, 1)
    assert symmetry.axis == pytest.approx((3.0, -5.0))
    mirror = symmetry.operations[2]
    assert mirror.images == (0, 2, 1, 4, 3), "the mirror across x exchanges left and right"


@pytest.mark.parametrize("turn", [7.5, 33.333, -71.0])
def test_symmetries_turn_with_the_shape(turn: float) -> None:
    shape = plates((0.8, 0.5, 0.7), (-0.8, 0.5, 0.7), turn=turn)
    (identity, mirror) = shape_symmetry(shape).operations
    assert (identity.kind, mirror.kind) == ("rotation", "mirror")
    assert mirror.degrees == pytest.approx(turn % 180.0, abs=2e-3)
    assert mirror.images == (0, 2, 1)


def test_one_leg_out_of_place_leaves_the_identity() -> None:
    symmetry = shape_symmetry(plates((0.8, 0.5, 0.7), (-0.8, 0.5, 0.7), (0.8, 0.5, -0.7), (-0.8, 0.5, -0.6)))
    assert found(symmetry) == [("rotation", 0.0)]
    assert symmetry.orbits == (0, 1, 2, 3, 4)


@pytest.mark.parametrize(("sides", "rotations", "mirrors"), [(6, 6, 6), (10, 10, 10), (5, 5, 5)])
def test_a_prism_has_the_dihedral_group_of_its_sides(sides: int, rotations: int, mirrors: int) -> None:
    """Mirrors of a single part are tried at multiples of 7.5 degrees."""
    prism = kit_shape(
        kit_of(part_type("prism", cylinder(sides))),
        Assembly(np.zeros(1, np.int16), posed((0, 0, 0)), np.empty((0, 2), np.int32)),
    )
    kinds = [kind for kind, _ in found(shape_symmetry(prism))]
    assert kinds.count("rotation") == rotations
    if 180 / sides % 7.5 == 0:
        assert kinds.count("mirror") == mirrors


def test_parts_of_other_labels_are_no_images() -> None:
    kit = kit_of(part_type("a", box((1, 1, 1))), part_type("b", box((1, 1, 1))))
    shape = kit_shape(
        kit, Assembly(np.array([0, 1], np.int16), posed((-2, 0, 0), (2, 0, 0)), np.empty((0, 2), np.int32))
    )
    assert found(shape_symmetry(shape)) == [("rotation", 0.0), ("mirror", 90.0)]


def test_paths_make_a_tree_with_parents_first() -> None:
    names = ("Chair/seat", "Chair/back/bar", "Chair/back/frame/left", "Chair/legs/left", "Chair/back/frame/right")
    hierarchy = path_hierarchy(names)
    assert hierarchy.groups == (("Chair", -1), ("back", 0), ("frame", 1), ("legs", 0))
    assert hierarchy.part_groups == (0, 1, 2, 3, 2)


def test_drawers_and_doors_of_a_cabinet_are_groups() -> None:
    program = find_program("cabinet")
    shape = build_shape(program, program.schema.complete({"column_count": 2, "open_columns": 1, "drawer_rows": 2}))
    fields = structure_fields(shape, "program", StructureConfig(hierarchy=True))["hierarchy"]
    moving = [group["name"] for group in fields["groups"][1:]]
    assert [name.split()[0] for name in moving].count("prismatic") == 2
    held = {group: fields["part_groups"].count(group) for group in range(1, len(fields["groups"]))}
    assert min(held.values()) >= 2, "a drawer has a front and more"
    assert fields["part_groups"].count(0) > 2


def test_structurenet_json_is_read_back_with_the_same_tree_and_boxes(tmp_path: Path) -> None:
    shape = shape_of_program_text(DESK.read_text(encoding="utf-8"))
    record = structure_fields(shape, "shapeassembly", ALL)
    contacts = np.array([[0, 1]], dtype=np.int32)
    ((name, content),) = structurenet_files("desk", shape, contacts, record).items()
    (tmp_path / name).write_bytes(content)
    hierarchy = read_structurenet(tmp_path / name)
    leaves = list(hierarchy.root.leaves())
    assert len(leaves) == len(shape)
    labels = [shape.labels[label] for label in shape.part_labels]
    assert sorted(leaf.label for leaf in leaves) == sorted(labels)
    volumes = sorted(float(np.prod(np.ptp(mesh.vertices, axis=0))) for mesh in shape.meshes)
    np.testing.assert_allclose(sorted(float(np.prod(leaf.box.size)) for leaf in leaves), volumes, atol=1e-5)
    assert hierarchy.root.label == "Desk"
    assert [child.label for child in hierarchy.root.children if child.children] == ["Drawers"]


def test_groups_are_nodes_of_the_glb_and_parts_keep_their_places() -> None:
    shape = shape_of_program_text(DESK.read_text(encoding="utf-8"))
    hierarchy = structure_fields(shape, "shapeassembly", ALL)["hierarchy"]
    content = glb_bytes(shape, hierarchy)
    assert glb_bytes(shape, {"groups": hierarchy["groups"][:1], "part_groups": [0] * len(shape)}) == glb_bytes(shape)
    scene: Any = trimesh.load_scene(io.BytesIO(content), file_type="glb", process=False)
    assert sorted(scene.graph.nodes_geometry) == sorted(shape.part_names)
    for name, pose in zip(shape.part_names, shape.assembly.poses, strict=True):
        np.testing.assert_allclose(scene.graph.get(name)[0], pose, atol=1e-6)
    parents = scene.graph.transforms.parents
    for part, group in zip(shape.part_names, hierarchy["part_groups"], strict=True):
        assert parents[part] == f"group {group} {hierarchy['groups'][group]['name']}"
    read = glb_shape(content)
    order = [read.part_names.index(name) for name in shape.part_names]
    np.testing.assert_allclose(read.assembly.poses[order], shape.assembly.poses, atol=1e-6)


def test_siblings_are_related_by_contacts_and_symmetries() -> None:
    shape = plates((0.8, 0.5, 0.7), (-0.8, 0.5, 0.7))
    record = structure_fields(shape, "assembly", ALL)
    (content,) = structurenet_files("table", shape, np.array([[0, 1]], np.int32), record).values()
    root: dict[str, Any] = json.loads(content)
    assert [child["id"] for child in root["children"]] == [1, 2, 3]
    assert root["edges"] == [
        {"part_a": 0, "part_b": 1, "type": "ADJ"},
        {"part_a": 1, "part_b": 2, "type": "REF_SYM"},
    ]
    with pytest.raises(ValueError, match="no hierarchy"):
        structurenet_files("table", shape, np.empty((0, 2), np.int32), {})


@pytest.mark.parametrize(
    ("damage", "fault"),
    [
        (lambda record: record["hierarchy"]["groups"][0].update(parent=0), "no tree with parents first"),
        (lambda record: record["hierarchy"]["part_groups"].pop(), "each part in one group"),
        (lambda record: record["symmetry"]["orbits"].pop(), "each part in one orbit"),
        (lambda record: record["symmetry"]["operations"][1]["images"].reverse(), "leaves an orbit"),
        (lambda record: record["symmetry"]["operations"][1].update(images=[0, 1, 1]), "does not exchange its parts"),
        (lambda record: record["symmetry"]["operations"].pop(), "operations of its symmetry are not those"),
        (lambda record: record["hierarchy"]["groups"][0].update(name="other"), "not that of its text"),
    ],
)
def test_damaged_records_are_found(damage: Callable[[dict[str, Any]], object], fault: str) -> None:
    shape = plates((0.8, 0.5, 0.7), (-0.8, 0.5, 0.7))
    record = {"language": "assembly", "text": "", "parts": [{}] * 3, **structure_fields(shape, "assembly", ALL)}
    sample = PackagedSample("a", record, {}, {}, shape, {"structure": ALL.model_dump()})
    paths: Any = None
    assert [*AUDIT.faults(sample), *AUDIT.recheck(sample, paths)] == []
    damage(record)
    assert any(fault in sentence for sentence in [*AUDIT.faults(sample), *AUDIT.recheck(sample, paths)])


def test_samples_without_a_text_are_rechecked() -> None:
    shape = plates((0.8, 0.5, 0.7), (-0.8, 0.5, 0.7))
    paths: Any = None
    sample = PackagedSample("a", {"language": "kit"}, {}, {}, shape, {})
    assert list(AUDIT.recheck(sample, paths)) == []
