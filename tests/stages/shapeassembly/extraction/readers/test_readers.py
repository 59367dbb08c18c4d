from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from pipeline.errors import Rejected
from stages.shapeassembly import print_program
from stages.shapeassembly.extraction.category_rules import CATEGORY_RULES
from stages.shapeassembly.extraction.extract import extract
from stages.shapeassembly.extraction.hierarchy import PartHierarchy, PartNode
from stages.shapeassembly.extraction.readers.grass import read_grass
from stages.shapeassembly.extraction.readers.model import read_model_hierarchy
from stages.shapeassembly.extraction.readers.partnet import read_partnet
from stages.shapeassembly.extraction.readers.source import HierarchySource
from stages.shapeassembly.extraction.readers.structurenet import read_structurenet
from stages.shapeassembly.extraction.settings import Gates
from tests.stages.model_files.one_table import write_one_table

SHARED = Path(__file__).resolve().parents[6] / "shared"
UPRIGHT = [0.0, 0.0, 0.0, 2.0, 1.0, 3.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]


def written(folder: Path, tree: object) -> Path:
    path = folder / "shape.json"
    path.write_text(tree if isinstance(tree, str) else json.dumps(tree), encoding="utf-8")
    return path


def test_structurenet_box_is_centre_size_x_axis_y_axis(tmp_path: Path) -> None:
    numbers = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 0.0, 0.0, 2.0, 0.0, 1.0, 0.0]
    tree = {"label": "root", "box": UPRIGHT, "children": [{"label": "seat", "box": numbers}]}
    hierarchy = read_structurenet(written(tmp_path, tree))
    (seat,) = hierarchy.root.children
    assert (hierarchy.name, seat.label) == ("shape", "seat")
    assert seat.box.center.tolist() == [1, 2, 3]
    assert seat.box.size.tolist() == [4, 5, 6]
    np.testing.assert_allclose(seat.box.axes, [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], atol=1e-12)


@pytest.mark.parametrize(
    ("tree", "words"),
    [
        ("{", "not JSON"),
        ("[" * 100_000, "not JSON"),
        ([], "an object with"),
        ({"box": UPRIGHT}, "no `label`"),
        ({"label": "root", "box": UPRIGHT[:-1]}, "twelve numbers"),
        ({"label": "root", "box": [*UPRIGHT[:-1], "1"]}, "no number"),
        ({"label": "root", "box": [float("nan"), *UPRIGHT[1:]]}, "finite"),
        ({"label": "root", "box": [1e300, *UPRIGHT[1:]]}, "finite"),
        ({"label": "root", "box": [0, 0, 0, -1, *UPRIGHT[4:]]}, "negative"),
        ({"label": "root", "box": [*UPRIGHT[:6], 0, 0, 0, 0, 1, 0]}, "no length"),
        ({"label": "root", "box": [*UPRIGHT[:6], 0, 1, 0, 0, 1, 0]}, "parallel"),
        ({"label": "root", "box": UPRIGHT, "children": {"label": "seat"}}, "a list of parts"),
        ({"label": "root", "box": UPRIGHT, "children": [{"label": "seat"}]}, "root.json/seat|shape.json/seat"),
        ({"label": "root", "box": UPRIGHT, "children": [{"label": "x", "box": UPRIGHT}] * 3000}, "2000 parts"),
    ],
)
def test_invalid_structurenet_file_is_rejected_with_its_fault(tmp_path: Path, tree: object, words: str) -> None:
    with pytest.raises(Rejected, match=words) as caught:
        read_structurenet(written(tmp_path, tree))
    assert caught.value.reason == "unreadable hierarchy"
    assert "shape.json" in str(caught.value)


def test_structurenet_file_of_many_levels_is_rejected(tmp_path: Path) -> None:
    tree: dict[str, object] = {"label": "leaf", "box": UPRIGHT}
    for _ in range(40):
        tree = {"label": "node", "box": UPRIGHT, "children": [tree]}
    with pytest.raises(Rejected, match="levels"):
        read_structurenet(written(tmp_path, tree))


def grass(folder: Path, **arrays: np.ndarray) -> Path:
    path = folder / "chairs.npz"
    np.savez(path, allow_pickle=True, **arrays)
    return path


def test_grass_sizes_belong_to_the_two_axes_given_and_their_cross_product(tmp_path: Path) -> None:
    rows = np.array([[0, 0, 0, 1, 2, 3, 1, 0, 0, 0, 0, 1], [1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 1, 0]], np.float32)
    chairs = read_grass(grass(tmp_path, full_boxes=rows, full_offsets=np.array([0, 2])))
    shape = chairs.shape(0)
    assert len(chairs) == 1
    assert shape.name == "chairs_00000"
    first, second = shape.root.children
    np.testing.assert_allclose(first.box.axes, [[1, 0, 0], [0, 0, 1], [0, -1, 0]], atol=1e-12)
    assert first.box.size.tolist() == [1, 2, 3]
    assert second.box.center.tolist() == [1, 1, 1]


def test_bad_grass_box_rejects_only_its_shape(tmp_path: Path) -> None:
    good = [0, 0, 0, 1, 2, 3, 1, 0, 0, 0, 0, 1]
    rows = np.array([good, [0, 0, 0, 1, 1, 1, 0, 0, 0, 0, 1, 0]], np.float32)
    chairs = read_grass(grass(tmp_path, full_boxes=rows, full_offsets=np.array([0, 1, 2])))
    assert len(chairs.shape(0).root.children) == 1
    with pytest.raises(Rejected, match="row 1"):
        chairs.shape(1)


@pytest.mark.parametrize(
    "arrays",
    [
        {"full_boxes": np.zeros((2, 12))},
        {"full_boxes": np.zeros((2, 11)), "full_offsets": np.array([0, 2])},
        {"full_boxes": np.zeros((2, 12)), "full_offsets": np.array([0, 3])},
        {"full_boxes": np.zeros((2, 12)), "full_offsets": np.array([1, 0])},
        {"full_boxes": np.array([{}]), "full_offsets": np.array([0, 1])},
    ],
)
def test_npz_without_grass_arrays_is_rejected(tmp_path: Path, arrays: dict[str, np.ndarray]) -> None:
    with pytest.raises(Rejected, match=r"chairs\.npz"):
        read_grass(grass(tmp_path, **arrays))


def partnet(folder: Path) -> Path:
    """A PartNet shape of two parts: a slab, and a stick turned by 30 degrees made of two meshes."""
    objs = folder / "9" / "objs"
    objs.mkdir(parents=True)
    slab = trimesh.creation.box((2.0, 0.1, 1.0))
    stick = trimesh.creation.box((0.1, 1.0, 0.2))
    turn = trimesh.transformations.rotation_matrix(np.radians(30), [0, 0, 1])
    stick.apply_transform(turn)
    upper, lower = stick.submesh([np.arange(6), np.arange(6, 12)])
    for name, mesh in (("original-1", slab), ("new-0", upper), ("new-1", lower)):
        (objs / f"{name}.obj").write_text(mesh.export(file_type="obj"), encoding="utf-8")
    top = {"name": "tabletop", "objs": ["original-1"]}
    leg = {"name": "leg", "objs": ["new-0", "new-1"]}
    tree = [{"name": "table", "id": 0, "children": [top, {"name": "table_base", "children": [leg]}]}]
    path = folder / "9" / "result_after_merging.json"
    path.write_text(json.dumps(tree), encoding="utf-8")
    return path


def test_partnet_boxes_are_the_smallest_around_the_meshes_of_a_part(tmp_path: Path) -> None:
    shape = read_partnet(partnet(tmp_path))
    top, base = shape.root.children
    (leg,) = base.children
    assert (shape.name, top.label, base.label, leg.label) == ("9", "tabletop", "table_base", "leg")
    assert sorted(top.box.size.tolist()) == pytest.approx([0.1, 1.0, 2.0])
    assert sorted(leg.box.size.tolist()) == pytest.approx([0.1, 0.2, 1.0])
    long = leg.box.axes[int(leg.box.size.argmax())]
    assert abs(long @ [-np.sin(np.radians(30)), np.cos(np.radians(30)), 0]) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"objs": ["../../secret"]}, "without a folder"),
        ({"objs": ["absent"]}, "not there"),
        ({"objs": []}, "names its meshes"),
        ({"objs": [3]}, "without a folder"),
        ({"name": 3}, "no `name`"),
        ({"objs": "original-1"}, "lists"),
    ],
)
def test_invalid_partnet_leaf_is_rejected(tmp_path: Path, change: dict[str, object], words: str) -> None:
    path = partnet(tmp_path)
    tree = json.loads(path.read_text(encoding="utf-8"))
    tree[0]["children"][0] |= change
    path.write_text(json.dumps(tree), encoding="utf-8")
    (tmp_path / "secret.obj").write_text("v 0 0 0\n", encoding="utf-8")
    with pytest.raises(Rejected, match=words):
        read_partnet(path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty"),
        ("v a b c\nf 1 1 1\n", r"table/tabletop: objs/original-1\.obj, line 1"),
        ("v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "finite"),
        ("version https://git-lfs.github.com/spec/v1\nsize 9\n", "git lfs pull|no triangles"),
    ],
)
def test_invalid_partnet_mesh_is_rejected(tmp_path: Path, text: str, words: str) -> None:
    path = partnet(tmp_path)
    (path.parent / "objs" / "original-1.obj").write_text(text, encoding="utf-8")
    with pytest.raises(Rejected, match=words):
        read_partnet(path)


def glb(folder: Path) -> Path:
    """A cabinet, z up: a body, and a drawer of a front and a knob, under one node."""
    scene = trimesh.Scene(base_frame="world")
    scene.graph.update(frame_from="world", frame_to="cabinet/drawer.001", matrix=np.eye(4))
    placed = {
        "body": ("world", (1.0, 1.0, 2.0), (0.0, 0.0, 0.0)),
        "front": ("cabinet/drawer.001", (0.1, 0.8, 0.4), (0.55, 0.0, 0.5)),
        "knob": ("cabinet/drawer.001", (0.1, 0.1, 0.1), (0.65, 0.0, 0.5)),
    }
    for name, (parent, size, center) in placed.items():
        matrix = trimesh.transformations.translation_matrix(center)
        scene.add_geometry(trimesh.creation.box(size), name, name, parent_node_name=parent, transform=matrix)
    path = folder / "cabinet.glb"
    path.write_bytes(scene.export(file_type="glb"))
    return path


def test_glb_nodes_are_parts_turned_y_up(tmp_path: Path) -> None:
    shape = read_model_hierarchy(glb(tmp_path), "z")
    parts = {part.label: part for part in shape.root.children}
    assert set(parts) == {"body", "drawer"}
    assert parts["body"].box.size.tolist() == pytest.approx([1, 2, 1])
    assert [part.label for part in parts["drawer"].children] == ["front", "knob"]
    assert parts["drawer"].children[1].box.center.tolist() == pytest.approx([0.65, 0.5, 0.0])


def boxes_of(part: PartNode) -> list[list[float]]:
    return [[*part.box.center, *part.box.size], *(row for child in part.children for row in boxes_of(child))]


def test_one_table_in_every_format_is_one_hierarchy_and_one_program(tmp_path: Path) -> None:
    files = write_one_table(tmp_path)
    assert len(files) == 11
    shapes = {file.name: read_model_hierarchy(file, "auto") for file in files}
    plain = boxes_of(shapes["plain.glb"].root)
    programs = set()
    for name, shape in shapes.items():
        np.testing.assert_allclose(boxes_of(shape.root), plain, atol=1e-12, err_msg=name)
        labels = [part.label for part in shape.root.children]
        named = name.endswith((".glb", ".gltf", ".obj"))
        if name != "scene.dae":  # whose nodes are named by the writer
            assert labels == (["leg"] * 4 + ["top"] if named else ["part"] * 5)
        programs.add(print_program(extract(shape, CATEGORY_RULES["any"], Gates()).program))
    assert len(programs) == 1
    assert plain[-1] == pytest.approx([0, 0.73, 0, 1.2, 0.06, 0.8])  # from the ground up


def test_folder_of_models_is_read_without_sidecars_and_pointers(tmp_path: Path) -> None:
    glb(tmp_path)
    (tmp_path / "CHEST.OBJ").write_bytes(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "._cabinet.glb").write_bytes(b"\x00\x05\x16\x07")
    (tmp_path / "clone.glb").write_bytes(b"version https://git-lfs.github.com/spec/v1\nsize 9\n")
    source = HierarchySource(tmp_path, "model", "auto")
    (_, chest), (_, cabinet), (name, clone) = source.read(0, len(source))
    assert isinstance(chest, PartHierarchy)
    assert isinstance(cabinet, PartHierarchy)
    assert isinstance(clone, Rejected)
    assert (name, clone.reason) == ("clone.glb", "unreadable hierarchy")
    assert "clone.glb: is a Git LFS pointer" in clone.detail
    assert source.sidecars == 1
    assert len(HierarchySource(tmp_path, "glb", "auto")) == 2


@pytest.mark.skipif(not SHARED.is_dir(), reason="needs the shared material")
def test_tables_of_the_cases_are_one_hierarchy() -> None:
    cases = (*(SHARED / "cases" / "h").iterdir(), SHARED / "cases" / "table-negative.obj")
    first, *others = (boxes_of(read_model_hierarchy(path, "auto").root) for path in cases)
    assert first[0] == pytest.approx([0, 0.38, 0, 1.2, 0.76, 0.8])
    for other in others:
        np.testing.assert_allclose(other, first, atol=2e-5)


def test_invalid_or_empty_glb_is_rejected(tmp_path: Path) -> None:
    path = tmp_path / "bad.glb"
    for content in (b"", b"glTF" + b"\0" * 40, b"{}"):
        path.write_bytes(content)
        with pytest.raises(Rejected, match=r"bad\.glb"):
            read_model_hierarchy(path, "y")


@pytest.mark.skipif(not SHARED.is_dir(), reason="needs the shared material")
def test_every_shared_hierarchy_is_read() -> None:
    files = sorted((SHARED / "partgraphs" / "structurenet").rglob("*.json"))
    assert len(files) == 180
    for path in files:
        assert len(list(read_structurenet(path).root.leaves())) >= 3
    labels = {
        part.label for part in read_structurenet(SHARED / "partgraphs/structurenet_example_boxshape.json").root.children
    }
    assert labels == {"chair_back", "chair_seat", "chair_base"}
    assert len(read_model_hierarchy(SHARED / "exemplars/h10_shop_building/model.glb", "y").root.children) > 0
