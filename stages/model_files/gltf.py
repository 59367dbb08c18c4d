"""glTF 2.0 and GLB, read from the specification: the node tree in file order, one surface for each mesh.

trimesh's reader is not used here: it takes sparse accessors for zeros and normalised integers for their raw values,
breaks a node with several materials into parts with random names, and loses whatever hangs below a camera.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from pipeline.errors import ConfigError
from stages.model_files.colors import (
    decode_image,
    face_paint,
    linear_from_srgb,
    sample_texture,
    srgb_from_linear,
    unit_colors,
)
from stages.model_files.enclosure import Enclosure, Outside
from stages.model_files.gltf_file import COMPRESSED, GltfFile
from stages.model_files.scene import (
    GREY,
    INVALID,
    Malformed,
    ModelScene,
    Placement,
    SceneNode,
    Surface,
    type_label,
)
from stages.model_files.source_materials import (
    appearance_of,
    painted_faces_without_material,
    stated_number,
    stated_numbers,
)
from stages.shape.appearance import Appearance, Material, Texture, TextureImage, Wrap, given_normals
from stages.shape.arrays import ByteArray, FloatArray, IntArray

_MODE_TRIANGLES, _MODE_STRIP, _MODE_FAN = 4, 5, 6
_GLOSSY = "KHR_materials_pbrSpecularGlossiness"
_NEAREST_FILTER = 9728
_WRAPS: Mapping[int, Wrap] = {33071: "clamp", 33648: "mirror", 10497: "repeat"}


def read_gltf(path: Path, enclosure: Enclosure) -> ModelScene:
    """Return the scene of a `.glb` or `.gltf` file; placements are in depth-first order of its node tree.

    Several primitives of a mesh are one surface. Meshes have the shape of their default morph weights and, with a skin,
    of its joints; hidden nodes, cameras, lights and animations are left out. Raises ConfigError for a file that is cut
    off, malformed or compressed, or requires an extension that is not read.
    """
    try:
        return _Reader(GltfFile(path, enclosure)).scene()
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        reason = error if isinstance(error, Malformed) else f"{enclosure.at} {INVALID}"
        raise ConfigError(
            f"{path}: malformed glTF: {reason}; check it with a glTF validator and export it again"
        ) from None


class _Reader:
    def __init__(self, file: GltfFile) -> None:
        self.file = file
        self.header = file.header
        self.warnings: list[str] = []
        self.images: dict[int, TextureImage | None] = {}
        self.read_materials: dict[int, Material] = {}
        self.not_kept: list[str] = []
        self.tree: list[SceneNode] = []
        self.hidden = 0
        self.parents: dict[int, int] | None = None

    def scene(self) -> ModelScene:
        nodes = list(self.walk())
        if self.hidden:
            self.warnings.append(f"{self.hidden:,} hidden nodes are left out, with what is below them")
        shapes = {index: self.shape_of(index) for index, _, _ in nodes}
        used = sorted(set(shapes.values()))
        surfaces = [self.surface(*shape) for shape in used]
        surface_of = {shape: index for index, shape in enumerate(used)}
        placements = []
        for index, pose, row in nodes:
            self.file.enclosure.at = f"node {index}"
            node = self.header["nodes"][index]
            mesh_name = self.name("mesh", node["mesh"])
            node_name = self.name("node", index)
            name = node_name or mesh_name or f"node{index}"
            label = type_label(name) if type_label(name) != name else mesh_name or node_name
            placements.append(Placement(name, label, surface_of[shapes[index]], pose, row))
        return ModelScene(
            "nodes",
            tuple(surfaces),
            tuple(placements),
            tuple(dict.fromkeys(self.warnings)),
            unit=1.0,
            nodes=tuple(self.tree),
            not_kept=tuple(dict.fromkeys(self.not_kept)),
            writer=str(self.header.get("asset", {}).get("generator", "")),
        )

    def walk(self) -> Iterator[tuple[int, FloatArray, int]]:
        """Yield index, world matrix and row in the tree of each node with a mesh, depth first, in file order."""
        nodes = self.header.get("nodes", [])
        scenes = self.header.get("scenes", [])
        if len(scenes) > 1:
            self.warnings.append(f"the file has {len(scenes)} scenes; only scene {self.header.get('scene', 0)} is read")
        if scenes:
            roots = scenes[self.header.get("scene", 0)].get("nodes", [])
        else:
            children = {child for node in nodes for child in node.get("children", [])}
            roots = [index for index in range(len(nodes)) if index not in children]
        stack = [(root, np.eye(4), -1) for root in reversed(roots)]
        seen: set[int] = set()
        while stack:
            index, parent, parent_row = stack.pop()
            if index in seen:
                raise Malformed(f"node {index} has two parents in the node tree")
            seen.add(index)
            self.file.enclosure.at = f"node {index}"
            node = nodes[index]
            pose = parent @ _local_matrix(node)
            if not np.isfinite(pose).all():
                raise ConfigError(
                    f"{self.file.path}: node {node.get('name', index)!r} has a transform that is not finite"
                )
            if "EXT_mesh_gpu_instancing" in node.get("extensions", {}):
                raise ConfigError(
                    f"{self.file.path}: node {node.get('name', index)!r} is instanced on the GPU "
                    "(EXT_mesh_gpu_instancing), which is not read; export it again with one node for each instance"
                )
            if node.get("extensions", {}).get("KHR_node_visibility", {}).get("visible", True) is False:
                self.hidden += 1
                continue
            row = len(self.tree)
            self.tree.append(SceneNode(self.name("node", index) or f"node{index}", parent_row))
            if "mesh" in node:
                yield index, (pose if self.shape_of(index)[1] < 0 else np.eye(4)), row
            stack.extend((child, pose, row) for child in reversed(node.get("children", [])))

    def name(self, kind: Literal["node", "mesh", "material"], index: int) -> str | None:
        """Return the name of a node, mesh or material, if it has one."""
        name = self.header[f"{kind}es" if kind == "mesh" else f"{kind}s"][index].get("name")
        if name is not None and not isinstance(name, str):
            self.warnings.append(f"{kind} {index} has a name that is no text; it is ignored")
            return None
        return name or None

    def shape_of(self, node_index: int) -> tuple[int, int, tuple[float, ...]]:
        """Return what gives a node's mesh its shape: mesh, skin (-1 for none) and morph weights."""
        node = self.header["nodes"][node_index]
        mesh = self.header["meshes"][node["mesh"]]
        weights = node.get("weights") or mesh.get("weights") or ()
        return int(node["mesh"]), int(node.get("skin", -1)), tuple(map(float, weights))

    def surface(self, index: int, skin: int, weights: tuple[float, ...]) -> Surface:
        self.file.enclosure.at = f"mesh {index}"
        mesh = self.header["meshes"][index]
        name = self.name("mesh", index) or f"mesh{index}"
        materials = self.header.get("materials", [])
        vertices, faces, colors, material, paint = [np.empty((0, 3))], [np.empty((0, 3), np.int32)], [], [], []
        vertex_paint, uv, normals = [], [], []
        painted = False
        offset = 0
        for number, primitive in enumerate(mesh["primitives"]):
            element = self.file.enclosure.at = f"mesh {name!r}, primitive {number}"
            triangles = self.triangles(primitive, element)
            if triangles is None:
                continue
            own_vertices, own_faces = triangles
            own_vertices = own_vertices + self.morph(primitive, weights, element)
            if skin >= 0:
                own_vertices = self.skinned(skin, primitive["attributes"], own_vertices, element)
            own_uv = self.texture_coordinates(primitive, element)
            linear, own_paint = self.face_colors(primitive, own_faces, own_uv, element)
            colors.append(srgb_from_linear(linear))
            paint.append(colors[-1] if own_paint is None else own_paint)
            vertex_paint.append(np.full((len(own_faces), 3), 255, np.uint8) if own_paint is None else own_paint)
            painted |= own_paint is not None
            material.append(np.full(len(own_faces), primitive.get("material", -1), dtype=np.int32))
            uv.append(np.zeros((len(own_faces), 3, 2)) if own_uv is None else own_uv[own_faces])
            normals.append(None if skin >= 0 else self.normals(primitive, own_faces, element))
            vertices.append(own_vertices)
            faces.append(own_faces + np.int32(offset))
            offset += len(own_vertices)
        whole = Surface(
            name=name,
            vertices=np.concatenate(vertices),
            faces=np.concatenate(faces),
            face_colors=np.concatenate(colors) if colors else np.empty((0, 3), np.uint8),
            materials=tuple(self.name("material", number) or f"material{number}" for number in range(len(materials))),
            face_material=np.concatenate(material) if material else np.empty(0, np.int32),
            paint=np.concatenate(paint) if painted else None,
        )
        return replace(whole, appearance=self.appearance(whole, vertex_paint, uv, normals))

    def appearance(
        self,
        surface: Surface,
        vertex_paint: list[ByteArray],
        uv: list[FloatArray],
        normals: list[FloatArray | None],
    ) -> Appearance | None:
        """Return the look of a surface from what its primitives have.

        vertex_paint: vertex colours of the faces, white without them
        normals: None for a primitive without; those get the normals of their faces if others have normals
        """
        if surface.face_material is None or not uv:
            return None
        used = set(np.unique(surface.face_material).tolist())
        materials = [
            self.material(number) if number in used else Material(name) for number, name in enumerate(surface.materials)
        ]
        face_material, painted = painted_faces_without_material(
            surface.face_material, materials, np.concatenate(vertex_paint)
        )
        self.not_kept += [f"material {name!r}: faces with vertex colours have these alone" for name in painted]
        corner_normals = None
        if any(own is not None for own in normals):
            missing = [np.zeros((*own.shape[:2], 3)) for own in uv]
            stated = np.concatenate([gap if own is None else own for own, gap in zip(normals, missing, strict=True)])
            corner_normals = given_normals(surface.vertices[surface.faces], stated)
        return appearance_of(materials, face_material, np.concatenate(uv), corner_normals)

    def normals(self, primitive: dict[str, Any], faces: IntArray, element: str) -> FloatArray | None:
        """Return the normals of the corners of a primitive's faces, (f, 3, 3), if it has them and they do not move."""
        attributes = primitive["attributes"]
        if "NORMAL" not in attributes or primitive.get("targets"):
            return None
        try:
            normals: FloatArray = self.file.accessor(attributes["NORMAL"], element).astype(np.float64)[faces]
        except (ArithmeticError, LookupError, TypeError, ValueError):
            self.not_kept.append(f"{element} has normals that cannot be read")
            return None
        return normals if normals.shape == (len(faces), 3, 3) else None

    def material(self, index: int) -> Material:
        """Return a material; what of it is not kept is noted."""
        if index not in self.read_materials:
            stated = self.header["materials"][index]
            name = self.name("material", index) or f"material{index}"
            surface = stated.get("pbrMetallicRoughness", {})
            factor = surface.get("baseColorFactor")
            metallic, roughness = surface.get("metallicFactor", 1.0), surface.get("roughnessFactor", 1.0)
            glossy = stated.get("extensions", {}).get(_GLOSSY)
            if glossy is not None:
                factor, metallic = glossy.get("diffuseFactor"), 0.0
                roughness = 1.0 - stated_number(glossy.get("glossinessFactor"), 1.0)
            red, green, blue, alpha = stated_numbers(factor, (1.0, 1.0, 1.0, 1.0))
            glow_red, glow_green, glow_blue = stated_numbers(stated.get("emissiveFactor"), (0.0, 0.0, 0.0))
            mode = str(stated.get("alphaMode", "OPAQUE")).lower()
            textures, lost = self.other_textures(stated)
            self.read_materials[index] = Material(
                name,
                (red, green, blue, alpha),
                self.sampled_texture(_base_texture(stated)),
                stated_number(metallic, 1.0),
                stated_number(roughness, 1.0),
                (glow_red, glow_green, glow_blue),
                "mask" if mode == "mask" else "blend" if mode == "blend" else "opaque",
                stated_number(stated.get("alphaCutoff"), 0.5),
                stated.get("doubleSided") is True,
                **textures,
                normal_scale=_factor(stated.get("normalTexture", {}).get("scale")),
                occlusion_strength=stated_number(stated.get("occlusionTexture", {}).get("strength"), 1.0),
            )
            lost += [extension for extension in stated.get("extensions", {}) if extension != _GLOSSY]
            if lost:
                self.not_kept.append(f"material {name!r}: {', '.join(map(str, lost))} is not kept")
        return self.read_materials[index]

    def other_textures(self, material: dict[str, Any]) -> tuple[dict[str, Texture], list[str]]:
        """Return the textures of a material besides that of its base colour, and the names of those not kept.

        A texture is not kept if its image cannot be read, or if it is read at other coordinates than the first one.
        """
        textures, lost = {}, []
        first = _placing(_first_texture(material))
        for name, (key, reference) in _other_references(material).items():
            before = len(self.warnings)
            texture = self.sampled_texture(reference) if _placing(reference) == first else None
            del self.warnings[before:]
            if texture is None:
                lost.append(key)
            else:
                textures[name] = texture
        return textures, lost

    def sampled_texture(self, reference: dict[str, Any] | None) -> Texture | None:
        """Return the texture that a material refers to, if its image can be read."""
        if reference is None:
            return None
        stated = self.header["textures"][reference["index"]]
        image = self.texture(stated)
        if image is None:
            return None
        sampler = self.header["samplers"][stated["sampler"]] if "sampler" in stated else {}
        wrap_u, wrap_v = (_WRAPS.get(sampler.get(key, 0), "repeat") for key in ("wrapS", "wrapT"))
        return Texture(image, wrap_u, wrap_v, sampler.get("magFilter") == _NEAREST_FILTER)

    def texture_coordinates(self, primitive: dict[str, Any], element: str) -> FloatArray | None:
        """Return the coordinates at which the textures of a primitive are read at its vertices, (n, 2)."""
        if "material" not in primitive:
            return None
        texture = _first_texture(self.header["materials"][primitive["material"]])
        if texture is None:
            return None
        number, placing = _placing(texture)
        coordinates = f"TEXCOORD_{number}"
        if coordinates not in primitive["attributes"]:
            return None
        uv = self.file.accessor(primitive["attributes"][coordinates], element).astype(np.float64)
        turn = placing.get("rotation", 0.0)
        spin = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        placed: FloatArray = uv * placing.get("scale", (1.0, 1.0)) @ spin.T + placing.get("offset", (0.0, 0.0))
        return placed

    def triangles(self, primitive: dict[str, Any], element: str) -> tuple[FloatArray, IntArray] | None:
        """Return vertices and faces of a primitive; None for points, lines and primitives without vertices."""
        mode = primitive.get("mode", _MODE_TRIANGLES)
        if mode not in (_MODE_TRIANGLES, _MODE_STRIP, _MODE_FAN):
            self.warnings.append(f"{element} is made of {'points' if mode == 0 else 'lines'} and is left out")
            return None
        attributes = primitive["attributes"]
        if "POSITION" not in attributes:
            return None
        if "KHR_draco_mesh_compression" in primitive.get("extensions", {}) and not self.file.is_stored(
            attributes["POSITION"]
        ):
            raise ConfigError(f"{self.file.path}: {element} is compressed with Draco, which is not read; {COMPRESSED}")
        vertices = self.file.accessor(attributes["POSITION"], element).astype(np.float64)
        if "indices" in primitive:
            corners = self.file.accessor(primitive["indices"], element).astype(np.int64).ravel()
        else:
            corners = np.arange(len(vertices))
        if len(corners) and corners.max() >= len(vertices):
            raise Malformed(f"{element} has a face on vertex {corners.max()} of {len(vertices)}")
        if mode == _MODE_TRIANGLES:
            faces = corners[: len(corners) // 3 * 3].reshape(-1, 3)
            if further := len(corners) % 3:
                self.warnings.append(f"{element} has {further} corners after its last triangle; they are left out")
        else:
            faces = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
            if mode == _MODE_STRIP:
                faces[1::2] = faces[1::2, ::-1]
            else:
                faces[:, 0] = corners[0]
        return vertices, faces.astype(np.int32)

    def morph(self, primitive: dict[str, Any], weights: tuple[float, ...], element: str) -> FloatArray | float:
        """Return by how much the default weights of its morph targets move the vertices of a primitive."""
        moved: FloatArray | float = 0.0
        for weight, target in zip(weights, primitive.get("targets", ()), strict=False):
            if weight and "POSITION" in target:
                moved = moved + weight * self.file.accessor(target["POSITION"], element).astype(np.float64)
        return moved

    def skinned(self, skin: int, attributes: dict[str, int], vertices: FloatArray, element: str) -> FloatArray:
        """Return the vertices of a primitive in the world, moved by the joints of its skin.

        Each moves by the weighted mean of its joints' world matrices times their inverse bind matrices; the transform
        of the node that holds the mesh does not count. Vertices without weights stay where they are.
        """
        joints = self.joint_matrices(skin, element)
        total = np.zeros((len(vertices), 4, 4))
        sums = np.zeros(len(vertices))
        number = 0
        while f"JOINTS_{number}" in attributes:
            index = self.file.accessor(attributes[f"JOINTS_{number}"], element).astype(np.int64)
            weights = self.file.accessor(attributes[f"WEIGHTS_{number}"], element)
            if weights.dtype.kind == "u":
                weights = weights / np.iinfo(weights.dtype).max
            weights = np.nan_to_num(weights.astype(np.float64))
            if index.max(initial=0) >= len(joints):
                raise Malformed(f"{element} has a vertex on joint {index.max()} of {len(joints)}")
            for column in range(index.shape[1]):
                total += weights[:, column, None, None] * joints[index[:, column]]
            sums += weights.sum(axis=1)
            number += 1
        if not (sums > 0).all():
            without = np.count_nonzero(~(sums > 0))
            self.warnings.append(f"{element} has {without:,} vertices without a joint of its skin; they stay unposed")
        total[sums > 0] /= sums[sums > 0, None, None]
        total[~(sums > 0)] = np.eye(4)
        moved: FloatArray = np.einsum("nij,nj->ni", total[:, :3, :3], vertices) + total[:, :3, 3]
        return moved

    def joint_matrices(self, skin: int, element: str) -> FloatArray:
        """Return the world matrix of each joint of a skin times its inverse bind matrix, float64 (j, 4, 4)."""
        stated = self.header["skins"][skin]
        worlds = np.array([self.world(joint) for joint in stated["joints"]]).reshape(-1, 4, 4)
        if "inverseBindMatrices" not in stated:
            return worlds
        inverse = self.file.accessor(stated["inverseBindMatrices"], element).astype(np.float64)
        bound: FloatArray = worlds @ inverse[: len(worlds)].reshape(-1, 4, 4).transpose(0, 2, 1)
        return bound

    def world(self, index: int) -> FloatArray:
        """Return the world matrix of a node, whether or not the scene shows it."""
        nodes = self.header["nodes"]
        if self.parents is None:
            self.parents = {child: number for number, node in enumerate(nodes) for child in node.get("children", [])}
        matrix = _local_matrix(nodes[index])
        for _ in range(len(nodes)):
            if index not in self.parents:
                return matrix
            index = self.parents[index]
            matrix = _local_matrix(nodes[index]) @ matrix
        raise Malformed(f"node {index} is below itself")

    def face_colors(
        self, primitive: dict[str, Any], faces: IntArray, uv: FloatArray | None, element: str
    ) -> tuple[FloatArray, ByteArray | None]:
        """Return linear colours (f, 3) of the faces of a primitive, and its vertex colours as face paint, if any."""
        attributes = primitive["attributes"]
        paint = None
        if "material" in primitive:
            linear = self.material_colors(self.header["materials"][primitive["material"]], uv, faces)
        elif "COLOR_0" in attributes:
            linear = np.ones((len(faces), 3))
        else:
            linear = np.tile(linear_from_srgb(np.array(GREY, np.uint8)), (len(faces), 1))
        if "COLOR_0" in attributes:
            vertex_colors = unit_colors(self.file.accessor(attributes["COLOR_0"], element))
            linear = linear * vertex_colors[faces].mean(axis=1)
            paint = face_paint(srgb_from_linear(vertex_colors), faces)
        return linear, paint

    def material_colors(self, material: dict[str, Any], uv: FloatArray | None, faces: IntArray) -> FloatArray:
        factor = material.get("pbrMetallicRoughness", {}).get("baseColorFactor")
        glossy = material.get("extensions", {}).get(_GLOSSY)
        if glossy is not None:
            factor = glossy.get("diffuseFactor")
        linear = np.tile(np.array(factor or (1.0, 1.0, 1.0, 1.0), dtype=np.float64)[:3], (len(faces), 1))
        texture = self.sampled_texture(_base_texture(material))
        if texture is None or uv is None:
            return linear
        at = np.column_stack([uv[:, 0], 1.0 - uv[:, 1]])
        colors = sample_texture(texture.image.pixels, at, faces, texture.wrap_u, texture.wrap_v)
        textured: FloatArray = linear * linear_from_srgb(colors)
        return textured

    def texture(self, stated: dict[str, Any]) -> TextureImage | None:
        """Return the first readable image of a texture: those of extensions, then the fallback."""
        before = len(self.warnings)
        for holder in [*stated.get("extensions", {}).values(), stated]:
            if holder.get("source") is not None:
                image = self.image(holder["source"])
                if image is not None:
                    del self.warnings[before:]  # an image that has a readable fallback is not missed
                    return image
        return None

    def image(self, index: int) -> TextureImage | None:
        """Return an image, decoded once; None, with a warning, for one that is not readable."""
        if index not in self.images:
            image = self.header["images"][index]
            try:
                if "bufferView" in image:
                    content = self.file.view(image["bufferView"], f"image {index}")[0]
                else:
                    content = self.file.enclosure.read(image["uri"], f"image {index}", encoded=True)
                self.images[index] = TextureImage.of(decode_image(content))
            except Outside:
                self.images[index] = None
                self.warnings.append(f"image {index} is a file outside the folder of the model, which is not opened")
            except OSError as error:
                self.images[index] = None
                fault = "is missing" if isinstance(error, FileNotFoundError) else f"cannot be read: {error}"
                self.warnings.append(f"image {index} ({image.get('uri', 'embedded')[:80]}) {fault}")
        return self.images[index]


def _base_texture(material: dict[str, Any]) -> dict[str, Any] | None:
    """Return the reference of a material to the texture of its base colour."""
    glossy = material.get("extensions", {}).get(_GLOSSY)
    if glossy is not None:
        return cast("dict[str, Any] | None", glossy.get("diffuseTexture"))
    return cast("dict[str, Any] | None", material.get("pbrMetallicRoughness", {}).get("baseColorTexture"))


def _other_references(material: dict[str, Any]) -> dict[str, tuple[str, dict[str, Any]]]:
    """Return the key and the reference of each texture but that of the base colour, by the field of `Material`."""
    surface = material.get("pbrMetallicRoughness", {})
    holders = {
        "metallic_roughness_texture": ("metallicRoughnessTexture", surface),
        "normal_texture": ("normalTexture", material),
        "occlusion_texture": ("occlusionTexture", material),
        "emissive_texture": ("emissiveTexture", material),
    }
    return {name: (key, holder[key]) for name, (key, holder) in holders.items() if key in holder}


def _first_texture(material: dict[str, Any]) -> dict[str, Any] | None:
    """Return the reference whose coordinates count for all textures: that of the base colour, or the next one."""
    others = (reference for _, reference in _other_references(material).values())
    return next((reference for reference in (_base_texture(material), *others) if reference is not None), None)


def _placing(reference: dict[str, Any] | None) -> tuple[int, dict[str, Any]]:
    """Return the number of the coordinates of a texture, and how they are transformed."""
    if reference is None:
        return 0, {}
    placing = dict(reference.get("extensions", {}).get("KHR_texture_transform", {}))
    return placing.pop("texCoord", reference.get("texCoord", 0)), placing


def _factor(value: Any) -> float:
    """Return a number of a file, or 1 for anything else."""
    return float(value) if isinstance(value, int | float) and np.isfinite(value) else 1.0


def _local_matrix(node: dict[str, Any]) -> FloatArray:
    """Return the transform of a node, float64 (4, 4): its matrix, or translation @ rotation @ scale."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    x, y, z, w = np.array(node.get("rotation", (0, 0, 0, 1)), dtype=np.float64) / (
        np.linalg.norm(node.get("rotation", (0, 0, 0, 1))) or 1.0
    )
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= np.array(node.get("scale", (1, 1, 1)), dtype=np.float64)
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix
