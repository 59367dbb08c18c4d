"""Hostile model files are read correctly or refused within seconds, with file and element."""

from __future__ import annotations

import json
import re
import zipfile
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import ConfigError
from stages.exemplars.model import pack_model, unpack_model
from stages.exemplars.read import parse_parts, read_parts
from stages.exemplars.settings import Segmentation
from stages.model_files.limits import ReadLimits
from tests.hostile.corpus import LIMITS, Outcome, outcomes
from tests.hostile.good import write_good
from tests.stages.exemplars.model_files import BOX_FACES, Glb, box, textured_dae, textured_glb, write_obj

HOSTILE = Path(__file__).resolve().parents[4] / "shared" / "hostile"
PLY = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n{}end_header\n{}"
POINTS = "0 0 0\n1 0 0\n0 1 0\n"


def two_boxes() -> Glb:
    return textured_glb("skin.png")


def ply(header: str, body: str) -> bytes:
    return PLY.format(header, body).encode()


def doubling(levels: int) -> str:
    """Return nodes that place the next level twice, on every level."""
    nodes = "".join(
        f'<node id="d{k}"><instance_node url="#d{k + 1}"/><instance_node url="#d{k + 1}"/></node>'
        for k in range(levels)
    )
    text = textured_dae("a.png").replace("<library_nodes>", f"<library_nodes>{nodes}<node id='d{levels}'/>")
    return text.replace('<instance_node url="#leaf"/>', '<instance_node url="#d0"/>')


def changed_glb(change: Callable[[dict], None]) -> bytes:  # type: ignore[type-arg]
    glb = two_boxes()
    change(glb.header)
    return glb.content()


REFUSED: dict[str, tuple[str, bytes, str]] = {
    "an integer beyond floats": (
        "m.glb",
        changed_glb(lambda header: header["nodes"][1].update(translation=[10**400, 0, 0])),
        "malformed glTF: node 1 ",
    ),
    "deep JSON": ("m.gltf", b"[" * 200_000, "its JSON nests too deeply"),
    "endless digits": ("m.gltf", b'{"a": ' + b"9" * 5000 + b"}", "holds endless numbers"),
    "nodes that double": ("m.dae", doubling(25).encode(), "places more than 200,000 nodes"),
    "deep elements": ("m.dae", b"<COLLADA>" + b"<node>" * 1000, "its elements nest deeper than 250, at <node>"),
    "entities in UTF-16": (
        "m.dae",
        '<?xml version="1.0" encoding="UTF-16"?><!DOCTYPE x [<!ENTITY e "e">]><COLLADA/>'.encode("utf-16"),
        "declares XML entities",
    ),
    "corners beyond the file": (
        "m.dae",
        textured_dae("a.png").replace("<vcount>4<", "<vcount>999999999<").encode(),
        "<vcount> in line 19 announces more corners",
    ),
    "list-typed colours": (
        "m.ply",
        ply(
            "property list uchar uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n"
            "property list uchar int vertex_indices\n",
            "0 0 0 1 9 9 9\n1 0 0 2 9 9 9 9\n0 1 0 1 9 9 9\n3 0 1 2\n",
        ),
        "property red of element vertex is a list",
    ),
    "coordinates beyond range": (
        "m.obj",
        b"v 1e300 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n",
        "part 'm' has 1 vertices that are not finite numbers up to 1e+30",
    ),
    "a line that is no vertex": (
        "m.stl",
        b"solid a\nfacet\nouter loop\nvertex 0 0 x\n",
        "line 4, 'vertex 0 0 x', is no vertex",
    ),
}


@pytest.mark.parametrize("fault", REFUSED)
def test_fault_is_named_with_its_file_and_its_element(tmp_path: Path, fault: str) -> None:
    name, content, message = REFUSED[fault]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ConfigError) as caught:
        read_parts(tmp_path / name, "auto", LIMITS)
    assert str(caught.value).startswith(f"{tmp_path / name}: ")
    assert message in str(caught.value)


def test_zip_in_place_of_a_model_is_not_unpacked(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "m.dae", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("m.dae", b" " * 10_000_000)
    with pytest.raises(ConfigError, match=r"is packed \(zip\)"):
        read_parts(tmp_path / "m.dae", "auto", LIMITS)


def test_buffer_that_links_to_itself_is_refused(tmp_path: Path) -> None:
    glb = two_boxes()
    glb.header["buffers"] = [{"byteLength": len(glb.chunk), "uri": "loop.bin"}]
    (tmp_path / "m.gltf").write_text(json.dumps(glb.header), encoding="utf-8")
    (tmp_path / "loop.bin").symlink_to("loop.bin")
    with pytest.raises(ConfigError, match=r"buffer 0 names 'loop.bin', a path outside the folder"):
        read_parts(tmp_path / "m.gltf", "auto", LIMITS)


def test_texture_that_is_a_program_is_ignored(tmp_path: Path) -> None:
    (tmp_path / "t.png").write_bytes(b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\nshowpage\n")
    model = read_parts(textured_glb("t.png").write(tmp_path / "m.glb"), "auto", LIMITS)
    assert len(model.parts) == 2
    assert "image 0 (t.png) cannot be read: it is not one of PNG, JPEG" in model.warnings[0]


def test_name_that_is_no_text_is_ignored(tmp_path: Path) -> None:
    (tmp_path / "m.glb").write_bytes(changed_glb(lambda header: header["meshes"][0].update(name=7)))
    model = read_parts(tmp_path / "m.glb", "auto", LIMITS)
    assert {part.mesh_name for part in model.parts} == {"mesh0"}
    assert model.warnings[0] == "mesh 0 has a name that is no text; it is ignored"


def test_names_can_be_shown_and_written_anywhere(tmp_path: Path) -> None:
    names = ["\ud800", "a\x1b[31mb\n", "n" * 100_000]
    (tmp_path / "m.glb").write_bytes(
        changed_glb(lambda header: [node.update(name=name) for node, name in zip(header["nodes"], names, strict=False)])
    )
    names = [part.name for part in read_parts(tmp_path / "m.glb", "auto", LIMITS).parts]
    assert names == ["\ufffd", "a\ufffd[31mb\ufffd"]
    write_obj(tmp_path / "m.obj", {"n" * 100_000: box(), "m": box(at=(2, 0, 0))})
    assert len(read_parts(tmp_path / "m.obj", "auto", LIMITS).parts[0].name) == 201


def test_many_parts_of_one_name_take_no_longer_than_many_names(tmp_path: Path) -> None:
    glb = Glb()
    mesh = glb.mesh(glb.primitive(box(), BOX_FACES), name="wall")
    for place in range(4000):
        glb.node(name="wall", mesh=mesh, translation=[2 * place, 0, 0])
    model = parse_parts(glb.write(tmp_path / "m.glb"), "auto", ReadLimits())
    assert [part.name for part in model.parts[:3]] == ["wall", "wall#2", "wall#3"]
    assert model.parts[-1].name == "wall#4000"


def test_element_without_properties_takes_no_time(tmp_path: Path) -> None:
    header = "element void 1000000000000\nelement face 1\nproperty list uchar int vertex_indices\n"
    (tmp_path / "m.ply").write_bytes(ply(header, POINTS + "3 0 1 2\n"))
    assert len(read_parts(tmp_path / "m.ply", "objects", LIMITS).parts[0].faces) == 1


def test_odd_texture_coordinates_are_ignored(tmp_path: Path) -> None:
    for path in write_good(tmp_path):
        if path.name == "skin.ply":
            text = (
                path.read_text(encoding="utf-8")
                .replace("6 0 0 1 0 1 1 255", "5 0 0 1 0 1 255")
                .replace("uchar red", "uchar rot")
            )
            path.write_text(text, encoding="utf-8")
            unknown, odd = read_parts(path, "objects", LIMITS).warnings
            assert unknown.startswith("properties green, blue of element face are no red, green and blue")
            assert odd.startswith("property texcoord of element face has no two numbers for each corner")


def test_newlines_before_a_solid_take_no_time(tmp_path: Path) -> None:
    triangle = "outer loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n"
    (tmp_path / "m.stl").write_text(
        "\n" * 200_000 + f"solid a\nfacet normal 0 0 1\n{triangle}endfacet\nendsolid a\n", encoding="utf-8"
    )
    assert len(read_parts(tmp_path / "m.stl", "objects", ReadLimits(cpu_seconds=5)).parts[0].faces) == 1


def test_colour_of_two_numbers_is_a_warning(tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_text("newmtl a\nKd 1 0\n", encoding="utf-8")
    path = write_obj(tmp_path / "m.obj", {"a": box(), "b": box(at=(2, 0, 0))}, "mtllib m.mtl\nusemtl a")
    assert read_parts(path, "auto", LIMITS).warnings == (
        "material colour 'Kd 1 0' is not red, green, blue; its faces are grey",
    )


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ({"parts": 1}, "has 2 parts and at most 1 are read; simplify it, or raise exemplars.limits.parts"),
        ({"triangles": 11}, "has 12 triangles and at most 11 are read"),
    ],
)
def test_limits_are_those_of_the_config(tmp_path: Path, limits: dict[str, int], message: str) -> None:
    path = two_boxes().write(tmp_path / "m.glb")
    with pytest.raises(ConfigError, match=message):
        read_parts(path, "auto", ReadLimits(**limits))


def test_model_survives_the_way_out_of_its_process(tmp_path: Path) -> None:
    path = two_boxes().write(tmp_path / "m.glb")
    here, there = parse_parts(path, "auto", ReadLimits()), read_parts(path)
    assert (here.segmentation, here.why, here.warnings, here.up) == (
        there.segmentation,
        there.why,
        there.warnings,
        there.up,
    )
    for one, other in zip(here.parts, there.parts, strict=True):
        assert (one.name, one.mesh_name, one.label) == (other.name, other.mesh_name, other.label)
        for key in ("pose", "vertices", "faces", "face_colors"):
            np.testing.assert_array_equal(getattr(one, key), getattr(other, key))
            assert getattr(one, key).dtype == getattr(other, key).dtype
    assert there.parts[0].vertices.base is there.parts[1].vertices.base


def test_faces_beyond_the_vertices_are_refused(tmp_path: Path) -> None:
    model = parse_parts(two_boxes().write(tmp_path / "m.glb"), "auto", ReadLimits())
    model.parts[0].faces[0, 0] = 8
    with pytest.raises(ValueError, match="a face has a vertex that does not exist"):
        unpack_model(model.path, pack_model(model))


def test_good_files_are_read_without_warnings(tmp_path: Path) -> None:
    for path in write_good(tmp_path):
        model = read_parts(path, "auto", LIMITS, texture_size=512)
        assert len(model.parts) >= 2, path
        assert model.warnings == (), path


def mutated(folder: Path) -> list[Outcome]:
    """Return the results of mutated files, which are made in a folder."""
    return list(outcomes(folder, 110, seed=1))


@pytest.mark.slow
def test_mutated_files_are_read_or_refused(tmp_path: Path) -> None:
    # Each file is read in a fork: of a process that has run other tests it takes ten times as long as of a small one.
    with ProcessPoolExecutor(1, get_context("spawn")) as small:
        results = small.submit(mutated, tmp_path).result()
    assert len(results) == 110
    assert [outcome.message for outcome in results if outcome.end == "escaped"] == []
    assert [outcome.message for outcome in results if outcome.end == "stopped"] == []
    assert Counter(outcome.end for outcome in results)["read"] >= 20


@pytest.mark.skipif(not HOSTILE.is_dir(), reason="the files that showed a fault are not next to the project")
def test_files_with_known_faults_are_handled() -> None:
    read = {"239-name-mesh-m.glb", "681-ply-texcoord-odd-m.ply", "empty-element.ply", "regr01.obj", "m.obj"}
    files = [
        file for file in sorted(HOSTILE.rglob("*")) if file.suffix.lower() in (".glb", ".gltf", ".obj", ".ply", ".dae")
    ]
    assert read <= {file.name for file in files}
    for path in files:
        source: Segmentation = "objects" if path.suffix in (".obj", ".ply") else "nodes"
        if path.name in read:
            assert read_parts(path, source, LIMITS).parts
        else:
            with pytest.raises(ConfigError, match=re.escape(f"{path}: ")):
                read_parts(path, source, LIMITS)
