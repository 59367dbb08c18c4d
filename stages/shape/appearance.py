"""How the surface of a mesh looks: materials and textures of faces, texture coordinates and normals of their corners.

Everything is indexed by face. What selects or reorders faces carries an appearance by the same index; what cuts faces
interpolates it. A mesh without an appearance has the colours of its faces alone.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

import numpy as np

from stages.shape.arrays import ByteArray, Float32Array, FloatArray, IntArray
from stages.shape.geometry.triangles import area_vectors, unit_normals

Wrap = Literal["repeat", "mirror", "clamp"]
"""What a texture shows outside its borders: itself again, its mirror image, or the pixels of the border."""
AlphaMode = Literal["opaque", "mask", "blend"]
"""Whether alpha is ignored, hides what is below the cutoff, or mixes a surface with what is behind it."""
TEXTURE_FIELDS = (
    "texture",
    "metallic_roughness_texture",
    "normal_texture",
    "occlusion_texture",
    "emissive_texture",
)
"""The textures of a material, in the order in which files list them."""
NO_MATERIAL = -1
"""Material of a face that has its face colour instead."""


@dataclass(frozen=True)
class TextureImage:
    """The pixels of a texture; images of equal pixels are equal.

    pixels: uint8 (h, w, 3), or (h, w, 4) with alpha that the colours are not multiplied by; first row at the top; sRGB
        where it is a colour, else numbers
    digest: sha256 of size and pixels
    """

    pixels: ByteArray = field(compare=False, repr=False)
    digest: str

    @staticmethod
    def of(pixels: ByteArray) -> TextureImage:
        """Return the image of these pixels."""
        digest = hashlib.sha256(repr(pixels.shape).encode() + np.ascontiguousarray(pixels).tobytes()).hexdigest()
        return TextureImage(pixels, digest)


@dataclass(frozen=True)
class Texture:
    """An image with its sampler.

    wrap_u, wrap_v: what is outside its borders
    nearest: whether pixels are seen as squares, and not blended with their neighbours
    """

    image: TextureImage
    wrap_u: Wrap = "repeat"
    wrap_v: Wrap = "repeat"
    nearest: bool = False


@dataclass(frozen=True)
class Material:
    """A material, with the meanings of glTF 2.0.

    base_color: linear red, green, blue, and alpha; the texture is multiplied by it
    metallic, roughness: blue and green of their texture are multiplied by them
    emissive: linear red, green, blue; its texture is multiplied by it

    All textures are read at the same texture coordinates.
    """

    name: str
    base_color: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    texture: Texture | None = None
    metallic: float = 0.0
    roughness: float = 1.0
    emissive: tuple[float, float, float] = (0.0, 0.0, 0.0)
    alpha_mode: AlphaMode = "opaque"
    alpha_cutoff: float = 0.5
    double_sided: bool = False
    metallic_roughness_texture: Texture | None = None
    normal_texture: Texture | None = None
    normal_scale: float = 1.0
    occlusion_texture: Texture | None = None
    occlusion_strength: float = 1.0
    emissive_texture: Texture | None = None

    @property
    def textures(self) -> dict[str, Texture]:
        """The textures that it has, by their field."""
        stated = {name: getattr(self, name) for name in TEXTURE_FIELDS}
        return {name: texture for name, texture in stated.items() if texture is not None}


@dataclass(frozen=True, eq=False)
class Appearance:
    """The look of a mesh with f faces.

    face_material: index into `materials`, or NO_MATERIAL, int32 (f,)
    uv: texture coordinates of the corners, origin at the upper left of the image, float32 (f, 3, 2), or None
    normals: unit normals of the corners, float32 (f, 3, 3), or None where they follow from the faces
    """

    materials: tuple[Material, ...]
    face_material: IntArray
    uv: Float32Array | None = None
    normals: Float32Array | None = None

    def __len__(self) -> int:
        return len(self.face_material)

    def select(self, faces: np.ndarray, corners: np.ndarray | None = None) -> Appearance:
        """Return the look of some faces.

        faces: indices, int (k,)
        corners: which corner of its face each corner is, int (k, 3); by default in their order
        """
        order = np.arange(3) if corners is None else corners
        rows = np.asarray(faces)[:, None]
        return Appearance(
            self.materials,
            self.face_material[faces],
            None if self.uv is None else self.uv[rows, order],
            None if self.normals is None else self.normals[rows, order],
        )

    def interpolated(self, faces: np.ndarray, weights: FloatArray) -> Appearance:
        """Return the look of pieces of faces.

        faces: the face of each piece, int (k,)
        weights: barycentric coordinates of the corners of the pieces, float64 (k, 3, 3)
        """
        normals = None if self.normals is None else unit_vectors(weights @ self.normals[faces])
        uv = None if self.uv is None else (weights @ self.uv[faces]).astype(np.float32)
        return Appearance(self.materials, self.face_material[faces], uv, normals)

    def mirrored(self) -> Appearance:
        """Return the look of the same faces with their corners in reverse order."""
        return self.select(np.arange(len(self)), np.tile([2, 1, 0], (len(self), 1)))

    def turned(self, linear: FloatArray) -> Appearance:
        """Return the look of the surface under a linear map (3, 3), which moves normals by its inverse transpose."""
        if self.normals is None:
            return self
        return replace(self, normals=unit_vectors(self.normals @ np.linalg.inv(linear)))

    def facing(self, corners: FloatArray) -> Appearance:
        """Return the look with the normals of each face on the side to which its corners (f, 3, 3) turn it."""
        if self.normals is None:
            return self
        away = np.einsum("fi,fi->f", area_vectors(corners), self.normals.sum(axis=1)) < 0.0
        return replace(self, normals=np.where(away[:, None, None], -self.normals, self.normals))


@dataclass(frozen=True, eq=False)
class Look:
    """Colours and appearance of a surface.

    face_colors: sRGB, uint8 (f, 3)
    """

    face_colors: ByteArray
    appearance: Appearance | None


def joined_appearance(appearances: Sequence[Appearance | None], face_counts: Sequence[int]) -> Appearance | None:
    """Return the look of meshes one after another, or None if none has one.

    Meshes without an appearance have no material. Normals are left out unless all meshes have them.
    """
    known = [appearance for appearance in appearances if appearance is not None]
    if not known:
        return None
    materials, places = shared_materials(known)
    place_of = iter(places)
    material, uv, normals = [], [], []
    for appearance, count in zip(appearances, face_counts, strict=True):
        if appearance is None:
            material.append(np.full(count, NO_MATERIAL, np.int32))
        else:
            material.append(next(place_of)[appearance.face_material])
        uv.append(np.zeros((count, 3, 2), np.float32) if appearance is None or appearance.uv is None else appearance.uv)
        normals.append(None if appearance is None else appearance.normals)
    has_uv = any(appearance.uv is not None for appearance in known)
    whole = [corner_normals for corner_normals in normals if corner_normals is not None]
    return Appearance(
        materials,
        np.concatenate(material),
        np.concatenate(uv) if has_uv else None,
        np.concatenate(whole) if len(whole) == len(normals) else None,
    )


def shared_materials(appearances: Sequence[Appearance]) -> tuple[tuple[Material, ...], list[IntArray]]:
    """Return the materials in use, each once, and for each appearance the place of each of its materials, int32.

    The places end with NO_MATERIAL, so that they also map that index. Materials not in use have it too.
    """
    index_of: dict[Material, int] = {}
    places = []
    for appearance in appearances:
        place = np.full(len(appearance.materials) + 1, NO_MATERIAL, np.int32)
        for number in np.unique(appearance.face_material).tolist():
            if number != NO_MATERIAL:
                place[number] = index_of.setdefault(appearance.materials[number], len(index_of))
        places.append(place)
    return tuple(index_of), places


def barycentric(corners: FloatArray, points: FloatArray) -> FloatArray:
    """Return weights with which the corners of triangles make points in their planes.

    corners: float64 (k, 3, 3)
    points: float64 (k, n, 3)

    The weights are float64 (k, n, 3), with the sum 1. A triangle without area gives equal weights.
    """
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(first, second)
    square = np.einsum("ki,ki->k", normal, normal)
    safe = np.where(square > 0.0, square, 1.0)[:, None]
    across = points - corners[:, None, 0]
    one = np.einsum("kni,ki->kn", np.cross(across, second[:, None]), normal) / safe
    two = np.einsum("kni,ki->kn", np.cross(first[:, None], across), normal) / safe
    weights = np.stack([1.0 - one - two, one, two], axis=2)
    return np.where(square[:, None, None] > 0.0, weights, 1.0 / 3.0)


def given_normals(corners: FloatArray, normals: FloatArray) -> Float32Array:
    """Return unit normals of the corners of faces (f, 3, 3), float32 (f, 3, 3), from those of a file.

    Where the file has none, or none of any length, a corner has the normal of its face.
    """
    lengths = np.linalg.norm(np.nan_to_num(normals), axis=2, keepdims=True)
    flat = np.broadcast_to(unit_normals(corners)[:, None], normals.shape)
    is_given = (lengths > 1e-6) & np.isfinite(normals).all(axis=2, keepdims=True)
    return np.where(is_given, normals / np.where(is_given, lengths, 1.0), flat).astype(np.float32)


def unit_vectors(vectors: FloatArray) -> Float32Array:
    """Return vectors (..., 3) at length 1, float32; those of no length stay."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return (vectors / np.where(lengths > 0.0, lengths, 1.0)).astype(np.float32)


def describe_materials(materials: Sequence[Material]) -> tuple[list[dict[str, Any]], tuple[TextureImage, ...]]:
    """Return materials as JSON whose textures name their image by its index, and these images."""
    images = tuple(dict.fromkeys(texture.image for material in materials for texture in material.textures.values()))
    described = []
    for material in materials:
        without: dict[str, Any] = dict.fromkeys(TEXTURE_FIELDS)
        fields = asdict(replace(material, **without))
        for name in TEXTURE_FIELDS:
            texture = material.textures.get(name)
            if texture is None:
                del fields[name]
            else:
                fields[name] = {
                    "image": images.index(texture.image),
                    "wrap_u": texture.wrap_u,
                    "wrap_v": texture.wrap_v,
                    "nearest": texture.nearest,
                }
        described.append(fields)
    return described, images


def restore_materials(described: Sequence[Mapping[str, Any]], images: Sequence[TextureImage]) -> tuple[Material, ...]:
    """Return the materials that `describe_materials` described."""
    materials = []
    for fields in described:
        stated: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value for name, value in fields.items()
        }
        for name in TEXTURE_FIELDS:
            if name in stated:
                texture: Mapping[str, Any] = stated[name]
                stated[name] = Texture(**{**texture, "image": images[texture["image"]]})
        materials.append(Material(**stated))
    return tuple(materials)
