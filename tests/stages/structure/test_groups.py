"""Groups that node trees of models name, found again in shapes, and rows of congruent parts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from pipeline.paths import DatasetPaths
from stages.exemplars.language import LANGUAGE
from stages.exemplars.read import read_parts
from stages.shape.kit import Assembly, Kit
from stages.shape.kit_files import write_kit
from stages.shape.shape import Shape, kit_shape
from stages.structure.groups import named_groups
from stages.structure.hierarchy import Hierarchy, hierarchy_of, model_hierarchy
from tests.stages.exemplars.blocks import block_kit
from tests.stages.shape.views.solids import box, cylinder, kit_of, part_type, posed

TURN = trimesh.transformations.rotation_matrix


WINDOW_PARTS = {"frame.1", "pane.10", "pane.11"}
"""The names of the parts of the first window."""


def window(scene: trimesh.Scene, number: int, place: np.ndarray) -> None:
    """Add a node with a frame, and a node within it that holds two panes."""
    name, glass = f"Window.{number}", f"glass.{number}"
    scene.graph.update(name, "wall", matrix=place)
    scene.graph.update(f"frame.{number}", name, geometry="frame")
    scene.graph.update(glass, name)
    for pane, x in enumerate((-0.5, 0.5)):
        scene.graph.update(f"pane.{number}{pane}", glass, geometry="pane", matrix=moved(x, 0, 0.15))


def moved(x: float, y: float, z: float) -> np.ndarray:
    matrix: np.ndarray = trimesh.transformations.translation_matrix([x, y, z])
    return matrix


@pytest.fixture(scope="module")
def kit(tmp_path_factory: pytest.TempPathFactory) -> Kit:
    """The kit of a wall with two windows, one of them turned, and three lamps in a row, from a GLB with a node tree."""
    scene = trimesh.Scene()
    sizes = {"slab": (8, 3, 0.2), "frame": (2, 1, 0.2), "pane": (0.8, 0.8, 0.1), "lamp": (0.3, 0.3, 0.5)}
    scene.geometry.update({name: trimesh.creation.box(size) for name, size in sizes.items()})
    scene.graph.update("wall", "world")
    scene.graph.update("slab", "wall", geometry="slab")
    window(scene, 1, moved(-2, 0, 0.2))
    window(scene, 2, moved(2, 0, 0.2) @ TURN(np.pi / 2, [0, 0, 1]))
    for number, x in enumerate((-1.0, 0.0, 1.0)):
        scene.graph.update(f"lamp.{number}", "wall", geometry="lamp", matrix=moved(x, 1.2, 0.35))
    path = tmp_path_factory.mktemp("models") / "wall.glb"
    path.write_bytes(scene.export(file_type="glb"))
    return block_kit(read_parts(path))


def described(shape: Shape, hierarchy: Hierarchy) -> dict[str, list[str]]:
    """The labels of the parts of each group, by the path of the group."""
    paths: list[str] = []
    for name, parent in hierarchy.groups:
        paths.append(f"{paths[parent]}/{name}" if parent >= 0 else name)
    found: dict[str, list[str]] = {}
    for part, group in enumerate(hierarchy.part_groups):
        found.setdefault(paths[group], []).append(shape.labels[shape.part_labels[part]])
    return found


WINDOW = {"shape/Window": ["frame"] * 2, "shape/Window/glass": ["pane"] * 4}


def test_groups_of_a_node_tree_are_those_of_its_exemplar(kit: Kit) -> None:
    shape = kit_shape(kit, kit.exemplars[0].assembly)
    hierarchy = hierarchy_of(shape, "kit")
    assert [name for name, _ in hierarchy.groups].count("Window") == 2
    expected = {"shape": ["slab"], **WINDOW, "shape/row of lamp": ["lamp"] * 3}
    assert described(shape, hierarchy) == expected


def test_a_variant_has_a_group_where_it_has_all_of_its_parts(kit: Kit) -> None:
    whole = kit.exemplars[0].assembly
    labels = [kit.types[kind].label for kind in whole.types.tolist()]
    copied = [part for part, name in enumerate(kit.exemplars[0].part_names) if name in WINDOW_PARTS]
    poses = np.concatenate([whole.poses, moved(5, 6, 7) @ TURN(0.7, [1, 2, 3]) @ whole.poses[copied]])
    panes = [part for part, label in enumerate(labels) if label == "pane"]
    poses[panes[0], 0, 3] += 0.1
    variant = Assembly(np.concatenate([whole.types, whole.types[copied]]), poses, np.empty((0, 2), np.int32))
    groups = [name for name, _ in model_hierarchy(kit_shape(kit, variant)).groups]
    assert groups.count("Window") == groups.count("glass") == 2, "one as it was, one torn, and one elsewhere"


def test_groups_are_kept_in_files_and_found_again_in_records(kit: Kit, tmp_path: Path) -> None:
    paths = DatasetPaths(tmp_path, "blocks")
    folder = paths.stage("exemplars").root
    folder.mkdir(parents=True)
    with open(folder / "blocks.json", "wb") as text, open(folder / "blocks.tar", "wb") as arrays:
        write_kit(kit, text, arrays)
    shape = kit_shape(kit, kit.exemplars[0].assembly)
    named = zip(shape.part_names, shape.assembly.poses.tolist(), strict=True)
    record = {"kit": "blocks", "parts": [{"name": name, "pose": pose} for name, pose in named]}
    rebuilt = LANGUAGE.rebuild(paths)(record, np.empty((0, 2), np.int32))
    assert len(rebuilt.groups) == len(kit.groups) == 4
    assert model_hierarchy(rebuilt) == model_hierarchy(shape)


@pytest.mark.parametrize(
    ("names", "name"),
    [(["drawer_top", "drawer_bottom"], "drawer"), (["Window 3", "Window 3"], "Window 3"), (["left", "right"], "left")],
)
def test_equal_groups_have_their_common_name(kit: Kit, names: list[str], name: str) -> None:
    groups = [group for group in kit.groups if group.name == "Window"]
    named = tuple(replace(group, name=other) for group, other in zip(groups, names, strict=True))
    shape = replace(kit_shape(kit, kit.exemplars[0].assembly), groups=named)
    assert [found for found, _ in named_groups(shape)] == [name, name]


def row_of(*places: tuple[float, float, float]) -> Shape:
    kit = kit_of(part_type("post", cylinder(8, 0.1, 1.0)), part_type("slab", box((9.0, 0.1, 9.0))))
    types = np.array([1, *[0] * len(places)], np.int16)
    return kit_shape(kit, Assembly(types, posed((0.0, -0.6, 0.0), *places), np.empty((0, 2), np.int32)))


def groups_of(shape: Shape) -> list[list[int]]:
    hierarchy = model_hierarchy(shape)
    return [
        [part for part, own in enumerate(hierarchy.part_groups) if own == group]
        for group in range(1, len(hierarchy.groups))
    ]


def test_three_posts_at_equal_steps_are_a_row_and_two_are_none() -> None:
    assert groups_of(row_of((0, 0, 0), (2, 0, 1), (1, 0, 0.5))) == [[1, 2, 3]]
    assert groups_of(row_of((0, 0, 0), (1, 0, 0))) == []
    assert groups_of(row_of((0, 0, 0), (1, 0, 0), (2.1, 0, 0))) == []


def test_longer_rows_come_first_and_a_part_is_in_one_row() -> None:
    cross = row_of(
        *((float(x), 0.0, 0.0) for x in range(-2, 3)), *((0.0, 0.0, float(z)) for z in (-3, -2, -1, 1, 2, 3))
    )
    assert groups_of(cross) == [[3, *range(6, 12)]], "the two halves of the shorter row are no rows"
    grid = row_of(*((float(x), 0.0, 2.0 * z) for z in range(3) for x in range(4)))
    assert groups_of(grid) == [[1, 2, 3, 4], [5, 6, 7, 8], [9, 10, 11, 12]]


def test_last_digits_of_poses_decide_nothing() -> None:
    rng = np.random.default_rng(0)
    shape = row_of(*((float(x), 0.0, float(z)) for z in range(4) for x in range(4)))
    poses = shape.assembly.poses.copy()
    poses[:, :3, 3] += rng.normal(size=(len(shape), 3)) * 1e-10
    assert groups_of(replace(shape, assembly=replace(shape.assembly, poses=poses))) == groups_of(shape)
