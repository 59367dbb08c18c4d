"""The readers find in shipped and public models what trimesh finds."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.hostile.good import write_good
from tests.model_readers.compare import compare, polygon_areas

ROOT = Path(__file__).resolve().parents[2]
PUBLIC = Path("/usr/share/assimp/models")
"""Where Debian's package assimp-testmodels puts its models."""
NAMES = ("OBJ/spider.obj", "OBJ/regr_3429812.obj", "PLY/cube.ply", "STL/Spider_binary.stl", "OFF/Cube.off",
         "Collada/duck.dae", "glTF2/BoxTextured-glTF/BoxTextured.gltf")  # fmt: skip


@pytest.mark.parametrize(
    "path", sorted((ROOT / "datasets" / "exemplars").glob("*/*.glb"))[::6], ids=lambda path: path.stem
)
def test_shipped_kit_is_read_as_by_trimesh(path: Path) -> None:
    result = compare(path)
    assert (result.refusal, result.differing) == ("", ())
    assert "trimesh" in result.peers


def test_valid_file_of_every_format_has_the_shape_that_trimesh_finds(tmp_path: Path) -> None:
    for path in write_good(tmp_path):
        result = compare(path)
        if path.name not in (
            "boxes.obj",
            "whole.glb",
            "apart.gltf",
            "skin.ply",
            "tiles.dae",
        ):  # trimesh reads these otherwise
            assert result.refusal == ""
            assert not {"bounds", "area", "volume"} & set(result.differing), path.name


@pytest.mark.skipif(not PUBLIC.is_dir(), reason="assimp-testmodels is not installed")
@pytest.mark.parametrize("name", NAMES)
def test_public_model_is_read_as_by_trimesh(name: str) -> None:
    if (PUBLIC / name).exists():
        assert compare(PUBLIC / name).differing == ()


def test_areas_of_polygons_that_are_not_convex_are_explained(tmp_path: Path) -> None:
    notched = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 1 1 0\nv 0 4 0\n"
    (tmp_path / "notched.obj").write_text(f"{notched}o notched\nf 2 3 4 5 1\n", encoding="utf-8")
    assert polygon_areas(tmp_path / "notched.obj") == pytest.approx((10.0, 18.0))
    assert compare(tmp_path / "notched.obj").explained == ("area: trimesh makes fans of polygons that are not convex",)
