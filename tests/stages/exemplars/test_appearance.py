"""Looks pass from model files through cutting, repair and types into the kit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from stages.exemplars.build import build_kit
from stages.exemplars.cut_surface import cut_by_sections
from stages.exemplars.moved_look import look_on
from stages.exemplars.read import read_parts
from stages.exemplars.settings import STRICTEST, KitConfig
from stages.model_files.scene import ModelScene, Placement, Surface
from stages.shape.appearance import Appearance, Material, Texture, TextureImage
from stages.shape.geometry.pose import transform_points
from stages.shape.kit import Kit, PartType
from tests.stages.symmetry.test_slabs import truss

PLANAR = np.array([[0.5, 0.0], [0.25, 1.0], [0.0, 2.0]])
"""Texture coordinates of a position: with them a look can be checked wherever its faces are cut."""


def textured_file(path: Path, flips: bool = False, second: str = "wood") -> Path:
    """Write two congruent bricks, the second above the first, whose coordinates are planar in their own axes."""
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


def test_congruent_parts_of_other_colors_take_the_first_look_and_the_kit_says_so(tmp_path: Path) -> None:
    kit, warnings = kit_of(textured_file(tmp_path / "m.glb", second="stone"))
    assert len(kit.types) == 1
    assert not kit.types[0].other_looks
    assert any("1 part has other colours or materials than the first part of their type" in w for w in warnings)


def test_congruent_parts_of_other_materials_keep_theirs_with_textures(tmp_path: Path) -> None:
    kit, warnings = kit_of(textured_file(tmp_path / "m.glb", second="stone"), appearance="textures")
    (brick,) = kit.types
    assert [look.materials[look.face_material[0]].name for look in looks(brick)] == ["wood", "stone"]
    assert not any("other colours or materials" in warning for warning in warnings)
    for look in looks(brick):
        np.testing.assert_allclose(look.uv, brick.vertices[brick.faces] @ PLANAR, atol=1e-6)
    (exemplar,) = kit.exemplars
    assert exemplar.assembly.looks is not None
    assert exemplar.assembly.looks.tolist() == [0, 1]


def looks(kind: PartType) -> list[Appearance]:
    return [looked.appearance for looked in kind.looked if looked.appearance is not None]


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_look_is_laid_on_the_faces_of_its_type_in_any_order(mirrored: bool) -> None:
    corners = truss(4)
    vertices, faces = corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)
    colors = np.full((len(faces), 3), 9, np.uint8)
    kind = PartType("truss", vertices, faces, colors, frame=np.eye(4), symmetries=np.eye(4)[None])
    transform = np.diag([-1.0 if mirrored else 1.0, 1.0, 1.0, 1.0])
    transform[:3, 3] = 5, 6, 7
    rng = np.random.default_rng(1)
    moved = transform_points(transform, vertices)[np.stack([rng.permutation(row) for row in rng.permutation(faces)])]
    image = TextureImage.of(np.zeros((2, 2, 3), np.uint8))
    look = Appearance((Material("steel", texture=Texture(image)),), np.zeros(len(faces), np.int32), None)
    look = replace(look, uv=(moved @ PLANAR).astype(np.float32))
    part = Surface("other", moved.reshape(-1, 3), faces, colors, appearance=look)
    found = look_on(kind, part, np.stack([np.eye(4), transform]), 1e-3)
    assert found is not None
    assert found[0].tolist() == transform.tolist()
    assert found[1].appearance is not None
    expected = transform_points(transform, vertices)[faces] @ PLANAR
    np.testing.assert_allclose(found[1].appearance.uv, expected, atol=1e-5)
    assert look_on(kind, part, np.eye(4)[None], 1e-3) is None


def test_a_part_of_one_plain_material_gives_its_look_to_other_triangles() -> None:
    box = trimesh.creation.box((2, 1, 1))
    corners = np.asarray(box.vertices)
    colors = np.full((12, 3), 9, np.uint8)
    kind = PartType("box", corners, box.faces, colors, frame=np.eye(4), symmetries=np.eye(4)[None])
    finer = box.subdivide()
    plain = Appearance((Material("red", (1.0, 0.0, 0.0, 1.0)),), np.zeros(len(finer.faces), np.int32))
    paint = np.full((len(finer.faces), 3), 99, np.uint8)
    part = Surface("finer", np.asarray(finer.vertices), np.asarray(finer.faces, np.int32), paint, appearance=plain)
    found = look_on(kind, part, np.eye(4)[None], 1e-3)
    assert found is not None
    assert found[1].appearance is not None
    assert [material.name for material in found[1].appearance.materials] == ["red"]
    assert found[1].face_colors.tolist() == [[99, 99, 99]] * 12
    paint[3] = 5
    assert look_on(kind, part, np.eye(4)[None], 1e-3) is None


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
