"""Looks pass from model files through cutting, repair and types into the kit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from stages.exemplars.build import build_kit
from stages.exemplars.cut_surface import cut_by_sections
from stages.exemplars.read import read_parts
from stages.exemplars.settings import STRICTEST, KitConfig
from stages.model_files.scene import ModelScene, Placement, Surface
from stages.shape.appearance import Appearance, Material
from stages.shape.geometry.pose import transform_points
from stages.shape.kit import Kit
from tests.stages.symmetry.test_slabs import truss

PLANAR = np.array([[0.5, 0.0], [0.25, 1.0], [0.0, 2.0]])
"""Texture coordinates of a position: with them a look can be checked wherever its faces are cut."""


def textured_file(path: Path, flips: bool = False, second: str = "wood") -> Path:
    """Write two congruent bricks, the second above the first, whose coordinates are planar in their own axes."""
    import trimesh

    scene = trimesh.Scene()
    for number, name in enumerate(("wood", second)):
        box = trimesh.creation.box((2, 1, 1))
        corners = box.vertices[box.faces].reshape(-1, 3)
        faces = np.arange(36).reshape(-1, 3)
        if flips:
            faces[::3] = faces[::3, [1, 0, 2]]
        image = Image.fromarray(np.full((4, 4, 3), 50 + 100 * (name == "wood"), np.uint8))
        material = trimesh.visual.material.PBRMaterial(name=name, baseColorTexture=image)
        visual = trimesh.visual.TextureVisuals(uv=corners @ PLANAR * (1, -1) + (0, 1), material=material)
        mesh = trimesh.Trimesh(corners, faces, visual=visual, process=False)
        scene.add_geometry(mesh, geom_name=f"brick{number}", node_name=f"brick{number}")
        scene.graph.update(f"brick{number}", matrix=trimesh.transformations.translation_matrix((0, number, 0)))
    path.write_bytes(scene.export(file_type="glb"))
    return path


def kit_of(path: Path, **settings: object) -> tuple[Kit, tuple[str, ...]]:
    config = KitConfig.model_validate({"name": "bricks", "shapes": (path,), **settings}).resolve(STRICTEST)
    model = read_parts(path, "nodes", texture_size=config.appearance.kept_texture_size)
    kit, observation = build_kit(config, [model])
    return kit, observation.warnings


@pytest.mark.parametrize("flips", [False, True])
def test_a_repaired_brick_keeps_the_coordinates_of_its_corners(flips: bool, tmp_path: Path) -> None:
    kit, _ = kit_of(textured_file(tmp_path / "m.glb", flips), appearance="textures")
    (brick,) = kit.types
    assert brick.appearance is not None
    np.testing.assert_allclose(brick.appearance.uv, brick.vertices[brick.faces] @ PLANAR, atol=1e-6)
    assert [material.name for material in brick.appearance.materials] == ["wood"]


def test_congruent_parts_of_other_materials_take_the_first_look_and_the_kit_says_so(tmp_path: Path) -> None:
    path = textured_file(tmp_path / "m.glb", second="stone")
    for settings in ({"appearance": "textures"}, {}):
        kit, warnings = kit_of(path, **settings)
        assert len(kit.types) == 1
        assert any("1 part has other colours or materials than the first part of their type" in w for w in warnings)


def test_colors_alone_are_what_a_kit_keeps_by_default(tmp_path: Path) -> None:
    kit, warnings = kit_of(textured_file(tmp_path / "m.glb"))
    assert kit.types[0].appearance is None
    assert any("1 texture is read as opaque colours of faces" in warning for warning in warnings)


@pytest.mark.parametrize("mirrored", [False, True])
def test_pieces_of_a_cut_surface_have_the_coordinates_of_their_positions(mirrored: bool) -> None:
    corners = truss(8)
    vertices, faces = corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)
    look = Appearance((Material("steel"),), np.zeros(len(faces), np.int32), (corners @ PLANAR).astype(np.float32))
    surface = Surface("truss", vertices, faces, np.full((len(faces), 3), 99, np.uint8), appearance=look)
    pose = np.diag([-1.0, 1.0, 1.0, 1.0]) if mirrored else np.eye(4)
    cut = cut_by_sections(ModelScene("objects", (surface,), (Placement("truss", None, 0, pose),)))
    assert len(cut.placements) > 4
    for piece in cut.surfaces:
        assert piece.appearance is not None
        place = next(p for p in cut.placements if cut.surfaces[p.surface] is piece)
        world = transform_points(place.pose, piece.vertices)[piece.faces] @ pose[:3, :3]
        np.testing.assert_allclose(piece.appearance.uv, world @ PLANAR, atol=1e-5)
