"""Looks follow their faces: selected, reordered, cut, stretched, joined and described."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np

from stages.proportions.warp import warped
from stages.rows.spanning import _clipped
from stages.shape.appearance import (
    NO_MATERIAL,
    Appearance,
    Material,
    Texture,
    TextureImage,
    barycentric,
    given_normals,
    joined_appearance,
)
from stages.shape.kit import Assembly
from stages.shape.kit_files import load_kit, write_kit
from stages.shape.shape import kit_shape
from tests.stages.proportions.stools import kit, lattice, whole

CHECKS = TextureImage.of(np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [9, 9, 9]]], np.uint8))
WOOD = Material("wood", texture=Texture(CHECKS, "mirror", "clamp", True), roughness=0.25)
GLASS = Material("glass", (0.5, 0.25, 1.0, 0.5), alpha_mode="blend", double_sided=True)
UV = np.arange(12, dtype=np.float32).reshape(2, 3, 2)
FLAT = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (2, 3, 1))


def look(uv: np.ndarray | None = UV, normals: np.ndarray | None = FLAT) -> Appearance:
    return Appearance((WOOD, GLASS), np.array([1, NO_MATERIAL], np.int32), uv, normals)


def test_selected_faces_carry_the_corners_in_the_order_asked_for() -> None:
    chosen = look().select(np.array([1, 0]), np.array([[2, 0, 1], [0, 1, 2]]))
    assert chosen.face_material.tolist() == [NO_MATERIAL, 1]
    assert chosen.uv is not None
    assert chosen.uv.tolist() == [UV[1][[2, 0, 1]].tolist(), UV[0].tolist()]


def test_a_piece_of_a_face_has_the_coordinates_of_its_own_corners() -> None:
    corners = np.array([[[0, 0, 5], [4, 0, 5], [0, 2, 5]]], float)
    piece = np.array([[[0, 0, 5], [2, 0, 5], [1, 0.5, 5]]], float)
    weights = barycentric(corners, piece)
    np.testing.assert_allclose(weights @ corners, piece, atol=1e-12)
    uv = corners[:, :, :2].astype(np.float32)
    cut = Appearance((WOOD,), np.zeros(1, np.int32), uv).interpolated(np.zeros(1, int), weights)
    assert cut.uv is not None
    assert cut.uv.tolist() == piece[:, :, :2].tolist()


def test_a_triangle_without_area_gives_its_mean() -> None:
    assert np.allclose(barycentric(np.zeros((1, 3, 3)), np.ones((1, 2, 3))), 1 / 3)


def test_the_plane_that_clips_triangles_of_a_row_interpolates_exactly() -> None:
    corners = np.random.default_rng(3).random((20, 3, 3))
    pieces, owners, _ = _clipped(corners, corners[:, :, 2], 0.5, 1.0)
    assert len(pieces) > 10
    uv = corners @ np.array([[1.0, 2.0], [3.0, -1.0], [0.5, 4.0]])
    cut = Appearance((), np.full(20, NO_MATERIAL, np.int32), uv.astype(np.float32)).interpolated(
        owners, barycentric(corners[owners], pieces)
    )
    np.testing.assert_allclose(cut.uv, pieces @ np.array([[1.0, 2.0], [3.0, -1.0], [0.5, 4.0]]), atol=1e-5)


def test_normals_stay_at_right_angles_to_a_surface_that_is_sheared_or_mirrored() -> None:
    for linear in (np.array([[1.0, 0.0, 0.7], [0.0, 2.0, 0.0], [0.0, 0.3, 1.0]]), np.diag([1.0, 1.0, -1.0])):
        turned = look().turned(linear)
        assert turned.normals is not None
        along = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]) @ linear.T
        np.testing.assert_allclose(turned.normals.reshape(-1, 3) @ along.T, 0.0, atol=1e-6)
        np.testing.assert_allclose(np.linalg.norm(turned.normals, axis=2), 1.0, atol=1e-6)


def test_normals_that_a_file_lacks_are_those_of_the_face() -> None:
    corners = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], float)
    stated = np.array([[[0, 0, 0], [np.nan, 0, 0], [0, 3, 0]]])
    assert given_normals(corners, stated).tolist() == [[[0, 0, 1], [0, 0, 1], [0, 1, 0]]]


def test_faces_that_were_turned_around_turn_their_normals() -> None:
    corners = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 0], [0, 1, 0], [1, 0, 0]]], float)
    facing = look().facing(corners).normals
    assert facing is not None
    assert facing[:, 0, 2].tolist() == [1.0, -1.0]


def test_joined_looks_share_equal_materials() -> None:
    other = Appearance((GLASS,), np.zeros(1, np.int32), None, FLAT[:1])
    both = joined_appearance([look(), other, None], [2, 1, 4])
    assert both is not None
    assert both.materials == (GLASS,), "wood is on no face"
    assert both.face_material.tolist() == [0, -1, 0, -1, -1, -1, -1]
    assert both.normals is None
    assert joined_appearance([None], [3]) is None


def names(look: Appearance) -> list[str]:
    return [look.materials[number].name if number >= 0 else "" for number in look.face_material.tolist()]


def textured_kit():
    made = kit()
    types = []
    for kind in made.types:
        count = len(kind.faces)
        uv = kind.vertices[kind.faces][:, :, :2].astype(np.float32)
        normals = given_normals(kind.vertices[kind.faces], np.zeros((count, 3, 3)))
        own = Appearance((GLASS, WOOD), np.arange(count, dtype=np.int32) % 3 - 1, uv, normals)
        types.append(replace(kind, appearance=own))
    return replace(made, types=tuple(types))


def test_a_kit_on_disk_keeps_looks_and_shares_images(tmp_path: Path) -> None:
    text, arrays = io.BytesIO(), io.BytesIO()
    write_kit(textured_kit(), text, arrays)
    (tmp_path / "kit.json").write_bytes(text.getvalue())
    (tmp_path / "kit.tar").write_bytes(arrays.getvalue())
    assert arrays.getvalue().count(b"image-") == 1
    read = load_kit(tmp_path / "kit.json", tmp_path / "kit.tar")
    for one, other in zip(textured_kit().types, read.types, strict=True):
        assert one.appearance is not None
        assert other.appearance is not None
        assert set(other.appearance.materials) == {GLASS, WOOD}
        for number, place in zip(one.appearance.face_material, other.appearance.face_material, strict=True):
            assert (
                number == place == NO_MATERIAL or one.appearance.materials[number] == other.appearance.materials[place]
            )
        np.testing.assert_array_equal(one.appearance.uv, other.appearance.uv)
        np.testing.assert_array_equal(one.appearance.normals, other.appearance.normals)
    again = io.BytesIO()
    write_kit(read, io.BytesIO(), again)
    assert again.getvalue() == arrays.getvalue()


def test_stretched_parts_keep_their_texture_coordinates_and_bend_their_normals() -> None:
    made, assembly = textured_kit(), whole()
    stretches = np.tile(np.array([[2.0, 0.0, 0.0], [0.0, 1.0, 0.5], [0.0, 0.5, 1.0]]), (len(assembly), 1, 1))
    shape = kit_shape(made, Assembly(assembly.types, assembly.poses, assembly.edges, stretches))
    for mesh in shape.meshes:
        source = made.types[made.type_names().index(mesh.name)]
        assert mesh.appearance is not None
        assert source.appearance is not None
        np.testing.assert_array_equal(mesh.appearance.uv, source.appearance.uv)
        flat = given_normals(mesh.vertices[mesh.faces], np.zeros((len(mesh.faces), 3, 3)))
        np.testing.assert_allclose(mesh.appearance.normals, flat, atol=1e-6)


def test_other_proportions_keep_texture_coordinates_and_normals_at_right_angles() -> None:
    made = textured_kit()
    warp = lattice().draw(np.random.default_rng(5), 0.4, 2.0)
    shape = warped(kit_shape(made, whole()), lattice(), warp)
    for part, mesh in enumerate(shape.meshes):
        source = made.types[whole().types[part]].appearance
        assert mesh.appearance is not None
        assert source is not None
        np.testing.assert_array_equal(mesh.appearance.uv, source.uv)
        flat = given_normals(mesh.vertices[mesh.faces], np.zeros((len(mesh.faces), 3, 3)))
        assert np.einsum("fki,fki->fk", mesh.appearance.normals, flat).min() > 0.999
