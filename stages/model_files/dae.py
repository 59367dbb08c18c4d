"""COLLADA through pycollada: the node tree in file order, meshes shared by its instances.

trimesh's reader is not used here: it names parts by meshes and not by nodes, and copies the mesh for each instance.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import ConfigError
from stages.model_files.colors import color_bytes, decode_image, face_paint, sample_texture, unit_colors
from stages.model_files.dae_primitives import polygon_triangles, vertex_positions, without_unreadable_primitives
from stages.model_files.enclosure import Enclosure, Outside
from stages.model_files.markup import check_markup
from stages.model_files.scene import GREY, INVALID, ModelScene, Placement, SceneNode, Surface, type_label
from stages.model_files.source_materials import (
    alpha_mode_of,
    appearance_of,
    linear_color,
    painted_faces_without_material,
    stated_number,
    stated_numbers,
)
from stages.shape.appearance import NO_MATERIAL, Material, Texture, TextureImage, Wrap, given_normals
from stages.shape.arrays import ByteArray, FloatArray, IntArray

_MAX_DEPTH = 200
_WRAPS: Mapping[str, Wrap] = {"WRAP": "repeat", "MIRROR": "mirror"}
"""By the words of COLLADA. All others are clamped: CLAMP, BORDER and NONE."""
_MAX_NODES = 200_000
"""Nodes that are visited. If every node places its children twice, their number doubles at each level."""

X_TO_Y = np.array([[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""The rotation that turns the x axis upward to y."""


def read_dae(path: Path, enclosure: Enclosure) -> ModelScene:
    """Return the scene of a `.dae` file; placements are in depth-first order of its node tree.

    Everything that one node places is one surface. Coordinates are converted to metres. The up axis is the file's; if
    it is x, the scene is turned and the axis is y. Raises ConfigError for a file that is no COLLADA, or declares XML
    entities.
    """
    import collada

    content = path.read_bytes()
    check_markup(path, content)
    enclosure.at = "its asset or one of its libraries"
    try:
        document = collada.Collada(io.BytesIO(content), ignore=[collada.common.DaeError])
        mended, warnings = without_unreadable_primitives(document)
        if mended is not None:
            document = collada.Collada(mended, ignore=[collada.common.DaeError])
        return _Reader(path, enclosure, document, warnings).scene()
    except (ArithmeticError, AttributeError, LookupError, SyntaxError, TypeError, ValueError, collada.common.DaeError):
        raise ConfigError(
            f"{path}: not a whole COLLADA file ({enclosure.at} {INVALID}); copy or export it again"
        ) from None


class _Reader:
    def __init__(self, path: Path, enclosure: Enclosure, document: Any, warnings: list[str]) -> None:
        self.path = path
        self.enclosure = enclosure
        self.document = document
        self.warnings = warnings
        self.images: dict[str, TextureImage | None] = {}
        self.not_kept: list[str] = []
        self.tree: list[SceneNode] = []

    def scene(self) -> ModelScene:
        surfaces: list[Surface] = []
        placements: list[Placement] = []
        surface_of: dict[tuple[Any, ...], int] = {}
        for error in self.document.errors:
            message = re.sub(r" `?<.*>`?", "", error.msg)  # without a name it may show a Python object
            self.warnings.append(f"left out: {message}")
        roots = [] if self.document.scene is None else self.document.scene.nodes
        for node, pose, geometries, row in self.walk(roots, np.eye(4), -1, 0):
            key = tuple(
                (placed.geometry.id, *((bound.symbol, getattr(bound.target, "id", None)) for bound in placed.materials))
                for placed in geometries
            )
            if key not in surface_of:
                surface_of[key] = len(surfaces)
                surfaces.append(self.surface(geometries))
            name = getattr(node, "name", None) or node.id or surfaces[surface_of[key]].name
            placements.append(Placement(name, type_label(name), surface_of[key], pose, row))
        up = getattr(self.document.assetInfo, "upaxis", None)
        placed = self.in_metres(surfaces, placements, X_TO_Y if up == "X_UP" else np.eye(4))
        warnings = tuple(dict.fromkeys(self.warnings))
        not_kept = tuple(dict.fromkeys(self.not_kept))
        return ModelScene("nodes", *placed, warnings, "z" if up == "Z_UP" else "y", 1.0, tuple(self.tree), not_kept)

    def in_metres(
        self, surfaces: list[Surface], placements: list[Placement], turn: FloatArray
    ) -> tuple[tuple[Surface, ...], tuple[Placement, ...]]:
        """Scale everything by the file's unit, and then rotate it by `turn`."""
        unit = float(getattr(self.document.assetInfo, "unitmeter", None) or 1.0)
        moved = []
        for placement in placements:
            pose = placement.pose.copy()
            pose[:3, 3] *= unit
            moved.append(replace(placement, pose=turn @ pose))
        scaled = (
            surfaces if unit == 1.0 else [replace(surface, vertices=unit * surface.vertices) for surface in surfaces]
        )
        return tuple(scaled), tuple(moved)

    def walk(
        self, nodes: Any, parent: FloatArray, parent_row: int, depth: int
    ) -> Iterator[tuple[Any, FloatArray, list[Any], int]]:
        """Yield nodes that place geometry, with world matrix, what they place, and their row in the tree."""
        from collada.scene import ControllerNode, GeometryNode, Node

        if depth > _MAX_DEPTH:
            raise ConfigError(f"{self.path}: its nodes nest deeper than {_MAX_DEPTH}; one may contain itself")
        for node in nodes:
            if not isinstance(node, Node):
                continue
            row = len(self.tree)
            self.tree.append(SceneNode(getattr(node, "name", None) or node.id or f"node{row}", parent_row))
            if row >= _MAX_NODES:
                raise ConfigError(
                    f"{self.path}: places more than {_MAX_NODES:,} nodes, by placing nodes again; export it simpler"
                )
            self.enclosure.at = f"node {node.id!r}"
            pose = parent @ np.asarray(node.matrix, dtype=np.float64)
            if any(isinstance(child, ControllerNode) for child in node.children):
                self.warnings.append(f"node {node.id!r} has a skin or a morph and is left out")
            geometries = [child for child in node.children if isinstance(child, GeometryNode)]
            if geometries:
                yield node, pose, geometries, row
            yield from self.walk(node.children, pose, row, depth + 1)

    def surface(self, geometries: list[Any]) -> Surface:
        names: list[str] = []
        vertices, faces = [np.empty((0, 3))], [np.empty((0, 3), np.int32)]
        colors, paint = [np.empty((0, 3), np.uint8)], [np.empty((0, 3), np.uint8)]
        material = [np.empty(0, np.int32)]
        materials: list[Material | None] = []
        vertex_paint, uv, normals = [np.empty((0, 3), np.uint8)], [np.empty((0, 3, 2))], [np.empty((0, 3, 3))]
        painted = False
        offset = 0
        for placed in geometries:
            self.enclosure.at = f"geometry {placed.geometry.id!r}"
            bound = {material.symbol: material.target for material in placed.materials}
            for primitive in placed.geometry.primitives:
                corners = self.corners(primitive)
                if corners is None:
                    continue
                points, (table, rows) = vertex_positions(primitive), corners
                triangles = table[rows, primitive.sources["VERTEX"][0][0]].astype(np.int32)
                if triangles.min(initial=0) < 0 or triangles.max(initial=-1) >= len(points):
                    raise ValueError("a face has a vertex that does not exist")
                target = bound.get(primitive.material)
                name = getattr(target, "name", None) or getattr(target, "id", None) or primitive.material
                if name is not None and name not in names:
                    names.append(name)
                    materials.append(self.material(name, target))
                own_colors, own_paint = self.face_colors(primitive, target, table, rows)
                vertices.append(points)
                faces.append(triangles + np.int32(offset))
                colors.append(own_colors)
                paint.append(own_colors if own_paint is None else own_paint)
                painted |= own_paint is not None
                vertex_paint.append(np.full((len(rows), 3), 255, np.uint8) if own_paint is None else own_paint)
                uv.append(self.corner_values(primitive, "TEXCOORD", table, rows, 2))
                normals.append(self.corner_values(primitive, "NORMAL", table, rows, 3))
                material.append(np.full(len(triangles), -1 if name is None else names.index(name), dtype=np.int32))
                offset += len(points)
        whole = Surface(
            name=geometries[0].geometry.name or geometries[0].geometry.id,
            vertices=np.concatenate(vertices),
            faces=np.concatenate(faces),
            face_colors=np.concatenate(colors),
            materials=tuple(names),
            face_material=np.concatenate(material),
            paint=np.concatenate(paint) if painted else None,
        )
        face_material = np.concatenate(material)
        is_known = np.array([*(target is not None for target in materials), False])  # the last for no material
        face_material = np.where(is_known[face_material], face_material, NO_MATERIAL).astype(np.int32)
        known = [Material(name) if own is None else own for name, own in zip(names, materials, strict=True)]
        face_material, without = painted_faces_without_material(face_material, known, np.concatenate(vertex_paint))
        self.not_kept += [f"material {name!r}: faces with vertex colours have these alone" for name in without]
        at, stated = np.concatenate(uv) * (1.0, -1.0) + (0.0, 1.0), np.concatenate(normals)
        corner_normals = given_normals(whole.vertices[whole.faces], stated) if stated.any() else None
        return replace(whole, appearance=appearance_of(known, face_material, at, corner_normals))

    def corner_values(self, primitive: Any, name: str, table: np.ndarray, rows: IntArray, width: int) -> FloatArray:
        """Return texture coordinates or normals of the corners of faces, (f, 3, width), or zeros."""
        nothing = np.zeros((len(rows), 3, width))
        if not primitive.sources.get(name):
            return nothing
        offset, *_, source = primitive.sources[name][0]
        values, at = np.asarray(source.data, dtype=np.float64), table[:, offset][rows]
        if values.ndim != 2 or values.shape[1] < width or at.min(initial=0) < 0 or at.max(initial=-1) >= len(values):
            return nothing
        return np.asarray(values[at][:, :, :width])

    def material(self, name: str, target: Any) -> Material | None:
        """Return a material; None for one that is not in the file."""
        effect = getattr(target, "effect", None)
        if effect is None:
            return None
        diffuse, texture = effect.diffuse, None
        red, green, blue = (1.0, 1.0, 1.0)
        if isinstance(diffuse, tuple):
            red, green, blue = linear_color(stated_numbers(diffuse[:3], (0.0, 0.0, 0.0)))
        elif diffuse is not None:
            texture = self.texture(diffuse.sampler)
        alpha = 1.0
        if isinstance(effect.transparent, tuple) and len(effect.transparent) == 4:
            share = stated_number(effect.transparency, 1.0)
            if getattr(effect, "opaque_mode", None) == "RGB_ZERO":
                alpha = 1.0 - share * sum(stated_numbers(effect.transparent[:3], (0.0, 0.0, 0.0))) / 3.0
            else:
                alpha = share * stated_number(effect.transparent[3], 1.0)
        elif effect.transparent is None and effect.transparency is not None:
            alpha = stated_number(effect.transparency, 1.0)
        if alpha <= 0.0:
            self.not_kept.append(f"material {name!r} is stated to be invisible; it is taken for opaque")
            alpha = 1.0
        glow = effect.emission if isinstance(effect.emission, tuple) else (0.0, 0.0, 0.0)
        maps = [key for key in ("emission", "transparent", "bumpmap") if hasattr(getattr(effect, key, None), "sampler")]
        if maps:
            self.not_kept.append(f"material {name!r}: {', '.join(maps)} textures are not kept")
        shine = effect.shininess if isinstance(effect.shininess, int | float) else 0.0
        return Material(
            name,
            (red, green, blue, alpha),
            texture,
            roughness=float(np.sqrt(2.0 / (2.0 + max(float(np.nan_to_num(shine)), 0.0)))),
            emissive=linear_color(stated_numbers(glow[:3], (0.0, 0.0, 0.0))),
            alpha_mode=alpha_mode_of(alpha, None if texture is None else texture.image.pixels),
            double_sided=True,
        )

    def corners(self, primitive: Any) -> tuple[np.ndarray, IntArray] | None:
        """Return the index table (n, inputs) and triangles as its rows; None for lines and empty primitives."""
        from collada.polylist import Polylist
        from collada.triangleset import TriangleSet

        if not len(vertex_positions(primitive)):
            return None
        if isinstance(primitive, TriangleSet):
            table = np.asarray(primitive.index).reshape(-1, primitive.nindices)
            return table, np.arange(len(table), dtype=np.int32).reshape(-1, 3)
        if isinstance(primitive, Polylist):
            table, rows, warnings = polygon_triangles(primitive, primitive.vcounts)
            self.warnings += warnings
            return table, rows
        self.warnings.append("lines are left out")
        return None

    def face_colors(
        self, primitive: Any, material: Any, table: np.ndarray, rows: IntArray
    ) -> tuple[ByteArray, ByteArray | None]:
        colors = np.tile(np.array(GREY, np.uint8), (len(rows), 1))
        paint = None
        if primitive.sources.get("COLOR"):
            offset, *_, source = primitive.sources["COLOR"][0]
            vertex_colors = color_bytes(unit_colors(source.data[table[:, offset]]))
            paint = face_paint(vertex_colors, rows)
            colors = np.rint(vertex_colors[rows].mean(axis=1)).astype(np.uint8)
        diffuse = getattr(getattr(material, "effect", None), "diffuse", None)
        if isinstance(diffuse, tuple):
            if paint is None:
                colors[:] = color_bytes(np.array(diffuse[:3], dtype=np.float64))
        elif diffuse is not None and primitive.sources.get("TEXCOORD"):
            texture = self.texture(diffuse.sampler)
            if texture is not None:
                offset, *_, source = primitive.sources["TEXCOORD"][0]
                uv = np.asarray(source.data, dtype=np.float64)[:, :2]
                wraps = texture.wrap_u, texture.wrap_v
                colors = sample_texture(texture.image.pixels, uv[table[:, offset]], rows, *wraps)
        return colors, paint

    def texture(self, sampler: Any) -> Texture | None:
        """Return an image with its sampler; None for an image that cannot be read, with a warning."""
        image = self.image(sampler.surface.image.path)
        if image is None:
            return None
        nodes = [] if sampler.xmlnode is None else sampler.xmlnode.iter()
        said = {str(node.tag).rpartition("}")[2]: (node.text or "").strip() for node in nodes}
        wrap_u, wrap_v = (_WRAPS.get(said.get(key, "WRAP"), "clamp") for key in ("wrap_s", "wrap_t"))
        return Texture(image, wrap_u, wrap_v, nearest=said.get("magfilter") == "NEAREST")

    def image(self, name: str) -> TextureImage | None:
        if name not in self.images:
            self.images[name] = None
            try:
                self.images[name] = TextureImage.of(decode_image(self.enclosure.read(name, "image", encoded=True)))
            except Outside:
                self.warnings.append(
                    f"texture {name!r} is outside the folder of the model and is not opened; its faces are grey"
                )
            except FileNotFoundError:
                self.warnings.append(f"texture {name!r} is missing; its faces are grey")
            except OSError as error:
                self.warnings.append(f"texture {name!r} cannot be read: {error}")
        return self.images[name]
