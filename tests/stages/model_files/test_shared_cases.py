"""Files on which other readers end wrongly, with the right value of each; they are kept outside the project."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import ConfigError
from stages.api import read_kit
from stages.model_files.read import read_model
from stages.model_files.scene_file import read_scene
from stages.shape.physics.judge import Judge
from stages.shape.physics.settings import PhysicsConfig
from tests.stages.model_files.measures import measured

CASES = Path(__file__).resolve().parents[4] / "shared" / "cases"

pytestmark = pytest.mark.skipif(not CASES.is_dir(), reason="the cases are not here")

BOX_A, BOX_C = ((0, 0, 0), (1, 1, 1), 6, 1), ((1, 0, 0), (2, 1, 1), 6, 1)
BOTH = ((0, 0, 0), (2, 1, 1), 12, 2)

RIGHT = {
    "obj-tab-vertices.obj": [BOX_A, ((5, 0, 0), (7, 3, 1), 22, 6), BOX_C],
    "obj-comment-backslash-face.obj": [BOX_A, BOX_C],
    "obj-usemtl-comment.obj": [BOX_A, BOX_C],
    "obj-same-name.obj": [BOX_A, *(((x, 0, 0), (x + 1, 1, 1), 6, 1) for x in (3, 6, 9))],
    "obj-kd-one.obj": [BOX_A, BOX_C],
    "obj-colour-255.obj": [BOTH],
    "obj-colour-unit.obj": [BOTH],
    "ply-colour-diffuse.ply": [BOTH],
    "ply-colour-float255.ply": [BOTH],
    "ply-colour-float1.ply": [BOTH],
    "stl-viscam-colour.stl": [BOTH],
    "ply-tristrips.ply": [BOX_A],
    "stl-trailing-bytes.stl": [BOX_A],
    "stl-one-line-facets.stl": [BOX_A],
    "off-modelnet.off": [BOX_A],
    "gltf-skin-armature-scale.glb": [BOX_A, ((0, 1, 0), (1, 2, 1), 6, 1)],
    "gltf-node-hidden-required.glb": [BOX_A, BOX_C],
    "gltf-clamp-sampler.glb": [BOX_A, BOX_C],
    "gltf-morph-default-weight.glb": [BOX_A, ((0, 1, 0), (1, 2, 1), 6, 1)],
    "gltf-json-nul-padding.glb": [BOX_A, BOX_C],
    "dae-polygon-holes.dae": [((0, 0, 0), (3, 1, 3), 32, 8)],
}
"""Lower and upper corner, area and volume of each part."""

COLORS = {
    "obj-kd-one.obj": [[(128, 128, 128)], [(255, 0, 0)]],
    "obj-usemtl-comment.obj": [[(255, 0, 0)], [(0, 0, 255)]],
    "obj-colour-255.obj": [[(32, 64, 128), (128, 64, 32)]],
    "obj-colour-unit.obj": [[(32, 64, 128), (128, 64, 32)]],
    "ply-colour-diffuse.ply": [[(20, 20, 200), (200, 20, 20)]],
    "ply-colour-float255.ply": [[(32, 64, 128), (128, 64, 32)]],
    "ply-colour-float1.ply": [[(32, 64, 128), (128, 64, 32)]],
    "stl-viscam-colour.stl": [[(0, 0, 255), (255, 0, 0)]],
    "gltf-clamp-sampler.glb": [[(20, 20, 200)], [(160, 160, 160)]],
}

REFUSED = {
    "stl-quad-facets.stl": "line 8: a facet has 4 vertices",
    "gltf-required-unknown.glb": "'ACME_vertex_offsets', which is not read",
    "lfs-pointer.glb": "is a Git LFS pointer to 123,456 bytes, not the file itself; run `git lfs pull`",
    "lfs-pointer.ply": "is a Git LFS pointer to 123,456 bytes, not the file itself; run `git lfs pull`",
}


@pytest.mark.parametrize("name", RIGHT)
def test_case_has_its_right_shape_and_colours(name: str) -> None:
    scene = read_scene(CASES / name)
    found = measured(scene)
    assert len(found) == len(RIGHT[name])
    for part, (low, high, area, volume) in zip(found, RIGHT[name], strict=True):
        np.testing.assert_allclose(
            [*part.low, *part.high, part.area, part.volume], [*low, *high, area, volume], atol=1e-6
        )
    if name in COLORS:
        assert [part.colors for part in found] == COLORS[name]


@pytest.mark.parametrize("name", REFUSED)
def test_case_without_a_right_shape_is_refused(name: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read_scene(CASES / name)
    assert REFUSED[name] in str(caught.value)


def test_tabs_in_a_material_library(tmp_path: Path) -> None:
    for source, target in (("obj-tab-kd.obj", "m.obj"), ("obj-tab2.mtl", "obj-tab-names.mtl")):
        (tmp_path / target).write_bytes((CASES / source).read_bytes())
    assert [part.colors for part in measured(read_scene(tmp_path / "m.obj"))] == [[(255, 0, 0)], [(0, 0, 255)]]


@pytest.mark.parametrize("kind", ["", "-split", "-same-start"])
def test_two_sided_boxes_are_equal_parts_of_volume_one(kind: str) -> None:
    kit = read_kit(CASES / f"obj-two-sided{kind}.obj")
    (box,) = kit.types
    corners = box.vertices[box.faces]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert (len(box.faces), volume) == (12, pytest.approx(1))
    assert kit.exemplars[0].assembly.types.tolist() == [0, 0]


def test_balance_of_a_two_sided_arm_is_that_of_its_control() -> None:
    plain, two_sided = (read_kit(CASES / f"obj-balance-{name}.obj") for name in ("plain", "two-sided"))
    verdicts = [
        Judge(kit.types, kit.up, PhysicsConfig()).validity(kit.exemplars[0].assembly) for kit in (plain, two_sided)
    ]
    assert verdicts[0].stable
    assert verdicts[1] == verdicts[0]


def test_one_table_is_the_same_in_three_encodings() -> None:
    plain, quantised, relative = (
        measured(read_model(CASES / f"table-{name}"))
        for name in ("plain.glb", "quantised-normalised.glb", "negative.obj")
    )
    assert len(plain) == 5
    for first, second, third in zip(plain, quantised, relative, strict=True):
        for other in (second, third):
            np.testing.assert_allclose([*other.low, *other.high], [*first.low, *first.high], atol=1e-4)
