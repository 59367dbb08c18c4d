"""The verifier that comes with a dataset needs nothing of the project, and finds faults by itself."""

from __future__ import annotations

import ast
import io
import json
import subprocess
import sys
import tarfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from stages.package import standalone_verifier
from stages.package.standalone_verifier import drawing_faults, grey_png, is_placed_by, verify
from tests.stages.verification.forge import FOLDER_FORGERIES, FORGERIES, copy_dataset, forge

LEFT_OPEN = {
    "a graph of another name",
    "the text of another sample in record too",
    "an edited card",
}
"""What only `make verify` finds: statics, strings and graphs are not derived without the project."""
DRAWINGS = {"a mirrored sketch", "the sketch of another sample", "a blank sketch", "a truncated sketch"}
"""The toy dataset has sketches of its own, which show nothing."""


@pytest.fixture
def folder(toy_folder: Path, tmp_path: Path) -> Path:
    return copy_dataset(toy_folder, tmp_path, with_work=False)


def test_it_imports_the_standard_library_numpy_and_trimesh_only() -> None:
    tree = ast.parse(Path(standalone_verifier.__file__).read_text(encoding="utf-8"))
    names = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    names |= {str(node.module) for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    packages = {name.partition(".")[0] for name in names}
    assert packages <= {*sys.stdlib_module_names, "numpy", "trimesh"}


def test_it_runs_alone_in_the_folder_of_a_dataset(folder: Path) -> None:
    command = [sys.executable, "-I", str(folder / "verify.py"), "--samples", "all"]
    done = subprocess.run(command, cwd=folder.parent, capture_output=True, text=True, check=False)
    assert "23 samples with geometry" in done.stdout
    assert done.stdout.endswith("good\n")
    assert done.returncode == 0


def test_workers_make_no_difference(folder: Path) -> None:
    forge(folder, "bounds twice as large", np.random.default_rng(0))
    one, two = verify(folder, None), verify(folder, None, workers=2)
    assert one == two
    assert one.faults


@pytest.mark.parametrize("name", sorted({*FORGERIES} - DRAWINGS - LEFT_OPEN))
def test_a_forged_sample_is_found_without_the_project(folder: Path, name: str) -> None:
    key = forge(folder, name, np.random.default_rng(len(name)))
    faults = verify(folder, None).faults
    assert any(key in fault for fault in faults), faults


@pytest.mark.parametrize("name", sorted({*FOLDER_FORGERIES} - LEFT_OPEN))
def test_a_forged_folder_is_found_without_the_project(folder: Path, name: str) -> None:
    forge(folder, name, np.random.default_rng(0))
    assert verify(folder, 0).faults


def test_a_sample_that_is_there_twice_is_found(folder: Path) -> None:
    from pipeline.shards import read_shard
    from tests.stages.verification.forge import reseal

    path = next(path for path in sorted(folder.glob("data/*/*.tar")) if len(list(read_shard(path))) > 1)
    samples = list(read_shard(path))
    key, members = samples[0]
    with tarfile.open(path, "a") as tar:
        for name, content in members.items():
            entry = tarfile.TarInfo(f"{key}.{name}")
            entry.size = len(content)
            tar.addfile(entry, io.BytesIO(content))
    reseal(folder)
    assert any(f"{key}: is there twice" in fault for fault in verify(folder, 0).faults)


def test_touching_parts_are_no_fault_where_the_graph_leaves_out_kinds_of_contact(folder: Path) -> None:
    forge(folder, "a dropped contact", np.random.default_rng(0))
    assert any("touch, and are not in contacts.npy" in fault for fault in verify(folder, None).faults)
    manifest = folder / "manifest.json"
    content = json.loads(manifest.read_bytes())
    content["config"]["exemplars"]["kits"] = [
        {"name": name, "contact": {"kinds": ["face"]}} for name in content["kits"]
    ]
    manifest.write_text(json.dumps(content), encoding="utf-8")
    findings = verify(folder, None)
    assert not any("touch, and are not in contacts.npy" in fault for fault in findings.faults)
    assert findings.partial == set(content["kits"]), "what is not checked is said"


def test_shard_outside_the_folder_is_not_opened(folder: Path) -> None:
    listing = folder / "checksums.txt"
    listing.write_text(f"{'0' * 64}  ../toy-index/toy.parquet\n" + listing.read_text(encoding="utf-8"), "utf-8")
    assert "../toy-index/toy.parquet: is missing" in verify(folder, 0).faults


def test_a_drawing_must_reach_as_far_as_the_mesh_in_its_camera() -> None:
    panel = np.array([[[0, 0, 1.0], [1, 0, 1], [1, 2, 1]], [[0, 0, 1], [1, 2, 1], [0, 2, 3]]])
    wire = np.array([[[1, 1, 1.0], [3, 1.02, 1], [3, 1, 1]]])
    tilted = np.array([[[1, 1, 1.0], [3, 1.13, 1], [3, 1.11, 1]]])
    bent = np.array([*wire, [[3, 1, 1], [3.02, 1, 1], [3, 3, 1]]])
    camera = {
        "width": 100,
        "height": 90,
        "projection": "orthographic",
        "line_width": 1.0,
        "world_to_camera": np.eye(4).tolist(),
        "intrinsics": [[20, 0, 30], [0, 20, 25], [0, 0, 1]],
    }

    def faults(left: int, top: int, right: int, bottom: int, *parts: np.ndarray) -> list[str]:
        pixels = np.full((90, 100), 255, np.uint8)
        pixels[top : bottom + 1, left : right + 1] = 0
        stream = io.BytesIO()
        Image.fromarray(pixels).save(stream, "png")
        return list(drawing_faults("sketch0.png", stream.getvalue(), camera, np.concatenate(parts)))

    def outline(pixels: int) -> list[str]:
        return [f"sketch0.png: the outline of the drawing is {pixels} pixels from that of the mesh"]

    assert faults(30, 25, 50, 65, panel) == []
    assert faults(50, 25, 70, 65, panel) == outline(21)
    assert faults(30, 25, 50, 45, panel) == outline(19)
    assert faults(99, 89, 0, 0, panel) == ["sketch0.png is blank"]
    # The wires are .4 pixels thick: they may be drawn, in part or as a whole, but nothing beyond them.
    for thin in (wire, tilted, bent):
        for right, expected in ((40, outline(9)), (50, []), (70, []), (90, []), (99, outline(10))):
            assert faults(30, 25, right, 65, panel, thin) == expected
    thicker = wire.copy()
    thicker[0, 1, 1] = 1.2
    assert faults(30, 25, 50, 65, panel, thicker) == outline(39)


@pytest.mark.parametrize("level", range(3))
def test_png_lines_are_read_as_another_library_reads_them(level: int) -> None:
    y, x = np.mgrid[:60, :70]
    images = (np.uint8((x * y) % 256), np.random.default_rng(0).integers(0, 256, (60, 70)).astype(np.uint8))
    stream = io.BytesIO()
    pixels = np.uint8((x + 3 * y) % 256) if level == 2 else images[level]
    Image.fromarray(pixels).save(stream, "png")
    assert np.array_equal(grey_png(stream.getvalue()), pixels)


def test_a_stretched_part_is_placed_by_its_node_and_a_turned_one_is_not() -> None:
    turn = trimesh.transformations.rotation_matrix(0.3, [1, 2, 3])
    turn[:3, 3] = 1, 2, 3
    longer = np.diag([1.0, 0.5, 1.0, 1.0])
    assert is_placed_by(turn, turn @ longer, 1e-5)
    assert not is_placed_by(turn, longer @ turn, 1e-5)
    assert not is_placed_by(turn, turn @ trimesh.transformations.rotation_matrix(np.pi, [0, 0, 1]), 1e-5)
    moved = turn.copy()
    moved[0, 3] += 0.1
    assert not is_placed_by(turn, moved @ longer, 1e-5)
