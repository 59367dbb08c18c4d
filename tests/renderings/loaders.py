"""Load the GLBs of a dataset with other libraries, and count the textured materials that each shows, once a GLB.

python -m tests.renderings.loaders DATASET
"""

from __future__ import annotations

import argparse
import io
import json
import struct
import tempfile
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from stages.package.reader import Dataset
from stages.shape.views.opengl import load_pyrender

Pixels = tuple[int, int, float, float, float]
"""Height, width and mean colour of an image."""
Look = list[tuple[str, Pixels]]
"""The material and the pixels of each primitive with a texture."""
MAX_LEVELS = 2.0
"""Mean colours that differ by no more are the same: decoders of JPEG round in their own ways."""


def main() -> None:
    """Print a row for each library."""
    parser = argparse.ArgumentParser(prog="python -m tests.renderings.loaders", description="Load textured GLBs.")
    parser.add_argument("dataset", type=Path)
    folder = parser.parse_args().dataset
    contents = [sample.members["glb"] for sample in Dataset.open(folder).samples()]
    written = [stored(content) for content in contents]
    print("| loader | GLBs | textures of materials | with the material's name |\n|---|---:|---:|---:|")
    for name, load in LOADERS.items():
        shown, named, total = 0, 0, 0
        for expected, look in zip(written, load(folder, contents), strict=True):
            textures = sorted(set(expected))
            shown += overlap(textures, sorted(set(look)), with_names=False)
            named += overlap(textures, sorted(set(look)), with_names=True)
            total += len(textures)
        print(f"| {name} | {len(contents)} | {shown} of {total} | {named} |", flush=True)


def overlap(expected: Look, found: Look, with_names: bool) -> int:
    """Return how many entries of a look are in another, each as often as it is there."""
    left, count = list(found), 0
    for name, pixels in expected:
        for place, (other_name, other) in enumerate(left):
            if _alike(pixels, other) and (name == other_name or not with_names):
                del left[place]
                count += 1
                break
    return count


def _alike(one: Pixels, other: Pixels) -> bool:
    return one[:2] == other[:2] and max(abs(a - b) for a, b in zip(one[2:], other[2:], strict=True)) <= MAX_LEVELS


def stored(content: bytes) -> Look:
    """Return the look that a GLB holds, by its header: of each primitive at each node."""
    length = struct.unpack("<I", content[12:16])[0]
    header, binary = json.loads(content[20 : 20 + length]), content[28 + length :]
    images = []
    for image in header.get("images", []):
        view = header["bufferViews"][image["bufferView"]]
        start = view.get("byteOffset", 0)
        images.append(pixels_of(Image.open(io.BytesIO(binary[start : start + view["byteLength"]]))))
    look = []
    for node in header["nodes"]:
        for primitive in header["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []:
            material = header["materials"][primitive["material"]] if "material" in primitive else {}
            texture = material.get("pbrMetallicRoughness", {}).get("baseColorTexture")
            if texture is not None:
                look.append((material["name"], images[header["textures"][texture["index"]]["source"]]))
    return look


def pixels_of(image: Any) -> Pixels:
    """Return the size and the mean colour of an image, without alpha."""
    pixels = np.asarray(image.convert("RGB") if isinstance(image, Image.Image) else image)[:, :, :3]
    return (*pixels.shape[:2], *pixels.mean(axis=(0, 1)).tolist())


def trimesh_look(scene: Any) -> Look:
    """Return the look of a scene of trimesh."""
    look = []
    for node in scene.graph.nodes_geometry:
        visual = scene.geometry[scene.graph[node][1]].visual
        image = getattr(getattr(visual, "material", None), "baseColorTexture", None)
        if image is not None and visual.uv is not None:
            look.append((visual.material.name, pixels_of(image)))
    return look


def _by_trimesh(_: Path, contents: list[bytes]) -> Iterator[Look]:
    import trimesh

    for content in contents:
        yield trimesh_look(trimesh.load_scene(io.BytesIO(content), file_type="glb", process=False))


def _by_hugging_face(_: Path, contents: list[bytes]) -> Iterator[Look]:
    import trimesh

    from datasets import Dataset as Rows
    from datasets import Features, Mesh

    rows = Rows.from_list(
        [{"mesh": {"bytes": content, "path": "shape.glb"}} for content in contents], Features({"mesh": Mesh()})
    )
    for row in rows:
        mesh = row["mesh"]
        yield trimesh_look(mesh if isinstance(mesh, trimesh.Scene) else trimesh.Scene(mesh))


def _by_webdataset(folder: Path, _: list[bytes]) -> Iterator[Look]:
    import trimesh
    import webdataset as wds

    def decode(key: str, content: bytes) -> Any:
        if key.endswith("glb"):
            return trimesh.load_scene(io.BytesIO(content), file_type="glb", process=False)
        return None

    for split in ("train", "val", "test"):
        shards = [str(path) for path in sorted((folder / "data" / split).glob("*.tar"))]
        for sample in wds.WebDataset(shards, shardshuffle=False, empty_check=False).decode(decode) if shards else []:
            yield trimesh_look(sample["glb"])


def _by_open3d(_: Path, contents: list[bytes]) -> Iterator[Look]:
    import open3d as o3d

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "shape.glb"
        for content in contents:
            path.write_bytes(content)
            model = o3d.io.read_triangle_model(str(path))
            look = []
            for info in model.meshes:
                material = model.materials[info.material_idx]
                if material.albedo_img and not material.albedo_img.is_empty() and info.mesh.has_triangle_uvs():
                    look.append(("", pixels_of(np.asarray(material.albedo_img))))  # it has no names
            yield look


def _by_pyrender(_: Path, contents: list[bytes]) -> Iterator[Look]:
    import trimesh

    pyrender = load_pyrender()
    for content in contents:
        loaded = trimesh.load_scene(io.BytesIO(content), file_type="glb", process=False)
        look = []
        for node in pyrender.Scene.from_trimesh_scene(loaded).mesh_nodes:
            for primitive in node.mesh.primitives:
                texture = primitive.material.baseColorTexture
                if texture is not None and primitive.texcoord_0 is not None:
                    look.append((primitive.material.name, pixels_of(texture.source)))
        yield look


LOADERS: dict[str, Callable[[Path, list[bytes]], Iterator[Look]]] = {
    f"trimesh {version('trimesh')}": _by_trimesh,
    f"Hugging Face `Mesh`, datasets {version('datasets')}": _by_hugging_face,
    f"webdataset {version('webdataset')} and trimesh": _by_webdataset,
    f"Open3D {version('open3d')} `read_triangle_model`": _by_open3d,
    f"pyrender {version('pyrender')}": _by_pyrender,
}


if __name__ == "__main__":
    main()
