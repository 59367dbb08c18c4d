from __future__ import annotations

import io

import numpy as np
import pytest
import trimesh

from shipped_kits.kit_shape import KitShape, glb_bytes
from shipped_kits.solids import box, revolved

BROWN, DARK = (146, 103, 66), (66, 62, 70)


def small_shape() -> KitShape:
    post = revolved([(0.5, 0.0), (0.5, 1.0), (0.0, 2.0)], 6, [BROWN, DARK])
    shape = KitShape({"post": post, "slab": box((2.0, 0.5, 1.0), (0.0, 0.0, 0.0), DARK)})
    shape.put("post", 0.0, 0.0, 0.0)
    shape.put("slab", 0.0, -0.5, 0.0)
    shape.put("post", 3.0, 1.0, 0.0, 90.0)
    return shape


def test_parts_are_nodes_named_by_type_that_share_one_mesh_a_type() -> None:
    scene = trimesh.load_scene(io.BytesIO(glb_bytes(small_shape())), file_type="glb", process=False)
    nodes = {name: scene.graph[name] for name in scene.graph.nodes_geometry}
    assert {name: geometry for name, (_, geometry) in nodes.items()} == {
        "post.000": "post",
        "slab.000": "slab",
        "post.001": "post",
    }
    moved = nodes["post.001"][0] @ [1.0, 0.0, 0.0, 1.0]
    assert moved == pytest.approx([3.0, 1.0, -1.0, 1.0])


def test_colours_are_crisp_and_linear_in_the_file() -> None:
    scene = trimesh.load_scene(io.BytesIO(glb_bytes(small_shape())), file_type="glb", process=False)
    post = scene.geometry["post"]
    per_corner = np.asarray(post.visual.vertex_colors)[post.faces][:, :, :3]
    assert (per_corner == per_corner[:, :1]).all()
    value = per_corner[:, 0] / 255.0
    srgb = 255 * np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1 / 2.4) - 0.055)
    _, _, colors = small_shape().types["post"].mesh()
    assert np.abs(srgb - colors).max() <= 4.0


def test_the_same_shape_gives_the_same_bytes() -> None:
    assert glb_bytes(small_shape()) == glb_bytes(small_shape())


def test_part_of_unknown_type_is_rejected() -> None:
    with pytest.raises(KeyError, match="tower"):
        small_shape().put("tower", 0.0, 0.0, 0.0)
