"""OBJ, MTL, STL, OFF and PLY in the forms in which people write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import ConfigError
from stages.model_files.scene_file import read_scene
from tests.stages.exemplars.model_files import png
from tests.stages.model_files.measures import Measured, measured

CORNERS = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
TRIANGLES = [triangle for a, b, c, d in QUADS for triangle in ((a, b, c), (a, c, d))]
GREY = (160, 160, 160)


def read_text(folder: Path, name: str, text: str | bytes) -> tuple[list[Measured], tuple[str, ...]]:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    scene = read_scene(path)
    return measured(scene), scene.warnings


def obj(vertices: str = "v {} {} {}\n", faces: str = "f {} {} {} {}\n", add: int = 1) -> str:
    return "".join(vertices.format(*corner) for corner in CORNERS) + "".join(
        faces.format(*(corner + add for corner in quad)) for quad in QUADS
    )


def is_box(part: Measured) -> bool:
    return bool(
        np.allclose(part.low, 0)
        and np.allclose(part.high, 1)
        and np.isclose(part.area, 6)
        and np.isclose(part.volume, 1)
    )


@pytest.mark.parametrize(
    "text",
    [
        obj("v\t{} {}\u00a0{}\n", "f\v{}\f{} {}\t{}  \n"),
        obj().replace("\n", "\r\n"),
        obj().replace("\n", "\r"),
        obj("v {} \\\n {} {} # x \\\n").replace("f 1", "f \\\r\n 1"),
        "# D:\\cad\\\n" + obj("  v {} {} {}#here\n", "\tf {} {} {} {} # side\\\n"),
        obj(faces="f {0}/1 {1}/1/1 {2}//1 {3}\n") + "vt 0 0\n",
        obj("v {} {} {} 1.0\n", "f {} {} {} {}\n", add=-8),
        "".join(line + "\n" for line in reversed(obj("v {0} {1} {2}\n").splitlines()[8:]))
        + obj().partition("f ")[0],
        "\ufeff" + obj("v {}. +{}e0 {}.0\n"),
        obj("v {}.0 {}.0 {}.0\n", "fo {} {} {} {}\n"),
    ],
    ids=["white space", "CRLF", "CR", "continued", "comments", "mixed forms", "relative", "faces first", "BOM", "fo"],
)  # fmt: skip
def test_box_is_read_from_every_form_of_obj(tmp_path: Path, text: str) -> None:
    (part,), warnings = read_text(tmp_path, "m.obj", text)
    assert is_box(part)
    assert warnings == ()


def test_obj_lines_that_are_not_read_are_counted_and_named(tmp_path: Path) -> None:
    text = obj() + "vc 1 0 0\nvc 0 1 0\nl 1 2\nl 2 3\np 1\nf 1 2\ncstype bezier\nvn 0 0 1\ns off\n"
    _, warnings = read_text(tmp_path, "m.obj", text)
    assert warnings == (
        "1 faces with fewer than three corners are left out",
        "1 free-form curves and surfaces are left out",
        "2 lines are left out",
        "1 points are left out",
        "2 lines that begin with 'vc', the first of them line 15, are not read",
    )


def test_every_o_line_begins_an_object_and_groups_of_one_name_are_one(tmp_path: Path) -> None:
    triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n"
    objects = "".join(f"o {name} # here\n{triangle}" for name in ("box", "ball", "box", ""))
    assert [part.name for part in read_text(tmp_path, "m.obj", objects)[0]] == ["box", "ball", "box", "m"]
    groups = "".join(f"g {name}\n{triangle}" for name in ("leg  left", "ball", "leg left", "Part #2"))
    assert [part.name for part in read_text(tmp_path, "m.obj", groups)[0]] == ["leg left", "ball", "Part #2"]


@pytest.mark.parametrize(
    ("library", "color"),
    [
        ("Kd 0.5", (128, 128, 128)),
        ("\tKd\t1\t0\t0\t# red", (255, 0, 0)),
        ("Ka 0 1 0", (0, 255, 0)),
        ("Ka 1 1 1\nd -halo 0.5\nTr 0.1\nKd 0 0 1", (0, 0, 255)),
        ("Kd xyz 0.9505 1 1.089", (255, 255, 255)),
        ("Kd spectral red.rfl 1", GREY),
        ("Kd 255 128 0", (255, 128, 0)),
        ("map_Kd -s 1 1 1 -blendu on my wood #2.png", (9, 8, 7)),
        ('map_Kd "my wood #2.png" # wood', (9, 8, 7)),
        ("Kd 0 1 0\nmap_Kd missing.png", (0, 255, 0)),
    ],
)
def test_material_is_read_from_every_form_of_mtl(tmp_path: Path, library: str, color: tuple[int, ...]) -> None:
    (tmp_path / "my wood #2.png").write_bytes(png(np.full((2, 2, 3), (9, 8, 7))))
    (tmp_path / "b.mtl").write_text(f"newmtl the\tpaint  # all\r\n{library}\r\n", encoding="utf-8")
    text = "usemtl the paint # of all\n" + obj(faces="f {}/1 {}/1 {}/1 {}/1\n") + "vt 0 0\nmtllib a.mtl b.mtl\n"
    (part,), warnings = read_text(tmp_path, "m.obj", text)
    assert part.colors == [color]
    assert "material library 'a.mtl b.mtl' is missing; its faces are grey" not in warnings
    assert "material library 'a.mtl' is missing; its faces are grey" in warnings


def test_names_in_windows_letters_are_the_same_in_obj_and_mtl(tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_bytes("newmtl mét\nKd 1 0 0\nnewmtl mèt\nKd 0 1 0\n".encode("latin-1"))
    text = "mtllib m.mtl\nusemtl mét\n" + obj()
    assert read_text(tmp_path, "m.obj", text.encode("latin-1"))[0][0].colors == [(255, 0, 0)]


@pytest.mark.parametrize(
    "vertices",
    ["v {} {} {} 128 64 32\n", "v {} {} {} 0.50196 0.25098 0.12549 1.0\n", "v {} {} {} 1.0 128 64 32\n",
     "v {} {} {} 128 64 32 255\n"],
)  # fmt: skip
def test_vertex_colours_of_obj_in_every_range(tmp_path: Path, vertices: str) -> None:
    assert read_text(tmp_path, "m.obj", obj(vertices))[0][0].colors == [(128, 64, 32)]


def test_vertex_colours_on_some_vertices_and_in_comments_of_zbrush(tmp_path: Path) -> None:
    part, warnings = read_text(tmp_path, "m.obj", obj().replace("v 0 0 0\nv 0 0 1\nv 0 1 0\nv 0 1 1\n",
        "v 0 0 0 1 0 0\nv 0 0 1 1 0 0\nv 0 1 0 1 0 0\nv 0 1 1 1 0 0\n"))  # fmt: skip
    assert part[0].colors == [GREY, (255, 0, 0)] or part[0].colors == sorted([GREY, (255, 0, 0)])
    assert warnings[0].startswith("only 4 of 8 vertices have a colour")
    assert read_text(tmp_path, "z.obj", obj() + "#MRGB " + "ff102030" * 8 + "\n")[0][0].colors == [(16, 32, 48)]


def test_material_that_is_numbered_is_no_comment(tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_text("newmtl Material #25\nKd 1 0 0\nnewmtl Material #26\nKd 0 1 0\n", encoding="utf-8")
    text = "mtllib m.mtl\nusemtl Material #26\n" + obj()
    assert read_text(tmp_path, "m.obj", text)[0][0].colors == [(0, 255, 0)]


def facets(loop: str) -> str:
    return "".join(loop.format(*(" ".join(map(str, CORNERS[corner])) for corner in face)) for face in TRIANGLES)


LOOP = "facet normal 0 0 0\nouter loop\nvertex {}\nvertex {}\nvertex {}\nendloop\nendfacet\n"


@pytest.mark.parametrize(
    "text",
    [
        f"solid a solid thing\n{facets(LOOP)}endsolid a solid thing\n",
        f"solid\n{facets(LOOP.replace(chr(10), ' '))}\nendsolid\n",
        "solid a " + facets(LOOP.replace("\n", " ")) + "endsolid a",
        f"SOLID a\n{facets(LOOP.upper())}ENDSOLID\n",
        f"solid\r\n{facets(LOOP.replace('vertex', 'vertex' + chr(10)))}endsolid\n",
        f"\n\tsolid\tx\n{facets(LOOP.replace('0 0 0', '-nan 1E+00 1e-3', 1))}endsolid x\n",
    ],
)  # fmt: skip
def test_box_is_read_from_every_form_of_text_stl(tmp_path: Path, text: str) -> None:
    (part,), warnings = read_text(tmp_path, "m.stl", text)
    assert is_box(part)
    assert warnings == ()


@pytest.mark.parametrize(
    ("body", "fault"),
    [
        ("facet\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nendloop\nendfacet\n", "line 6: a facet has 2 vertices"),
        ("vertex 0 0 0\n", "line 2: a vertex is outside a loop"),
        ("facet\nouter loop\nvertex 0 0\nvertex 1 0 0\n", "line 5: the vertex before it has not three numbers"),
    ],
)
def test_facet_of_text_stl_that_is_no_triangle_is_named(tmp_path: Path, body: str, fault: str) -> None:
    with pytest.raises(ConfigError, match=fault):
        read_text(tmp_path, "m.stl", f"solid\n{body}endsolid\n")


def binary_stl(head: bytes = b"solid by a program", attribute: int = 0, count: int = 12) -> bytes:
    row = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows = np.zeros(len(TRIANGLES), row)
    rows["corners"] = np.array(CORNERS, "<f4")[np.array(TRIANGLES)]
    rows["attribute"] = attribute
    return head.ljust(80, b"\0") + count.to_bytes(4, "little") + rows.tobytes()


@pytest.mark.parametrize(
    ("content", "color", "warning"),
    [
        (binary_stl(), GREY, ""),
        (binary_stl(attribute=0x8000 | 31 << 10), (255, 0, 0), ""),
        (binary_stl(b"COLOR=\x0a\x14\x1e\xff", attribute=31), (255, 0, 0), ""),
        (binary_stl(b"made by x COLOR=\x0a\x14\x1e\xff,MATERIAL=", attribute=0x8000), (10, 20, 30), ""),
        (binary_stl(attribute=7), GREY, "the attribute bytes of 12 triangles are no colours"),
        (binary_stl(count=0), GREY, "the header announces no triangles; the 12 that follow are read"),
        (binary_stl() + b"tail", GREY, "4 bytes after the last of the 12 announced triangles are left out"),
    ],
)
def test_binary_stl_with_colours_and_tails(
    tmp_path: Path, content: bytes, color: tuple[int, ...], warning: str
) -> None:
    (part,), warnings = read_text(tmp_path, "m.stl", content)
    assert is_box(part)
    assert part.colors == [color]
    assert [text[: len(warning)] for text in warnings] == ([warning] if warning else [])


def off(header: str, vertices: str = "{} {} {}\n", faces: str = "4 {} {} {} {}\n") -> str:
    return (
        header
        + "".join(vertices.format(*corner) for corner in CORNERS)
        + "".join(faces.format(*quad) for quad in QUADS)
    )


@pytest.mark.parametrize(
    ("text", "color"),
    [
        (off("OFF8 6 0\n"), GREY),
        (off("OFF 8 6 0\n"), GREY),
        (off("# a box\n\noff\n# counts\n8 6\n", "{}\t{} {} # corner\n"), GREY),
        (off("8 6 12\n"), GREY),
        (off("COFF\n8 6 0\n", "{} {} {} 255 128 0 255\n"), (255, 128, 0)),
        (off("COFF\n8 6 0\n", "{} {} {} 1.0 0.5 0.0 1\n"), (255, 128, 0)),
        (off("NOFF\n8 6 0\n", "{} {} {} 0 0 1\n"), GREY),
        (off("STCNOFF\n8 6 0\n", "{} {} {} 0 0 1 255.0 128.0 0.0 1 0.5 0.5\n"), (255, 128, 0)),
        (off("4OFF\n8 6 0\n", "{} {} {} 1\n"), GREY),
        (off("nOFF\n3\n8 6 0\n"), GREY),
        (off("OFF\n8 6 0\n", faces="4 {} {} {} {} 0 255 0\n"), (0, 255, 0)),
        (off("OFF\n8 6 0\n", faces="4 {} {} {} {} 0 1 0\n"), (0, 255, 0)),
    ],
)
def test_box_is_read_from_every_form_of_off(tmp_path: Path, text: str, color: tuple[int, ...]) -> None:
    (part,), warnings = read_text(tmp_path, "m.off", text)
    assert is_box(part)
    assert part.colors == [color]
    assert warnings == ()


def test_binary_off_and_four_dimensions_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="it is binary OFF"):
        read_text(tmp_path, "m.off", b"OFF BINARY\n\0\0\0\x08")
    with pytest.raises(ConfigError, match="another dimension than 3"):
        read_text(tmp_path, "m.off", off("nOFF\n4\n8 6 0\n"))


def ply(vertex: str = "", values: str = "", face: str = "", of_face: str = "", more: str = "", body: str = "") -> str:
    header = (
        f"ply\nformat ascii 1.0\ncomment end_header of a box\nobj_info x\n{more}element vertex 8\nproperty double x\n"
    )
    header += f"property double y\nproperty double z\n{vertex}element face 6\n"
    header += f"property list uchar int vertex_index\n{face}end_header\n{body}"
    vertices = "".join(f"{x} {y} {z} {values}\n" for x, y, z in CORNERS)
    return header + vertices + "".join(f"4 {a} {b} {c} {d} {of_face}\n" for a, b, c, d in QUADS)


def properties(kind: str, *names: str) -> str:
    return "".join(f"property {kind} {name}\n" for name in names)


@pytest.mark.parametrize(
    ("text", "color"),
    [
        (ply(), GREY),
        (ply(properties("uchar", "r", "g", "b"), "255 128 0"), (255, 128, 0)),
        (ply(properties("uchar", "ambient_red", "ambient_green", "ambient_blue"), "255 128 0"), (255, 128, 0)),
        (ply(properties("ushort", "red", "green", "blue", "alpha"), "65535 32896 0 1"), (255, 128, 0)),
        (ply(properties("int", "red", "green", "blue"), "255 128 0"), (255, 128, 0)),
        (ply(properties("char", "red", "green", "blue"), "-1 -128 0"), (255, 128, 0)),
        (ply(properties("float", "Red", "Green", "Blue"), "1 0.50196 0"), (255, 128, 0)),
        (ply(face="property list uchar uchar rgb\n", of_face="3 255 128 0"), (255, 128, 0)),
        (ply("property uint rgba\n", str(255 << 16 | 128 << 8)), (255, 128, 0)),
    ],
)
def test_colours_of_ply_in_every_spelling_and_range(tmp_path: Path, text: str, color: tuple[int, ...]) -> None:
    for ends in ("\n", "\r\n", "\r"):
        (part,), warnings = read_text(tmp_path, "m.ply", text.replace("\n", ends))
        assert is_box(part)
        assert part.colors == [color]
        assert warnings == ()


def test_elements_and_colours_of_ply_that_are_not_read_are_named(tmp_path: Path) -> None:
    more = "element camera 2\nproperty float view\nproperty list uchar int cells\n"
    text = ply(properties("uchar", "redness"), "7", more=more, body="1.5 2 7 8\n2.5 0\n")
    (part,), warnings = read_text(tmp_path, "m.ply", text)
    assert is_box(part)
    assert warnings == (
        "element 'camera' with 2 rows is left out",
        "properties redness of element vertex are no red, green and blue that are known; they are left out",
    )


def test_strips_of_ply_begin_again_with_their_first_side(tmp_path: Path) -> None:
    strip = "7 0 1 2 3 -1 0 1"
    header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    text = (
        f"{header}element tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n"
    )
    scene = read_text(tmp_path, "m.ply", text + strip + "\n")[0]
    assert scene[0].area == 1.0
    path = tmp_path / "m.ply"
    faces = read_scene(path).surfaces[0].faces.tolist()
    assert faces == [[0, 1, 2], [2, 1, 3]]


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n", "is a Git LFS pointer"),
        (b"\n<!DOCTYPE HTML>\n<html><body>404</body></html>", "is a web page"),
        (b"\xef\xbb\xbf<html lang='en'>", "is a web page"),
        (b"\x1f\x8b\x08\0\0", r"is packed \(gzip\)"),
        (b"PK\x03\x04\0\0", r"is packed \(zip\)"),
        (b"\0\x05\x16\x07\0\x02\0\0", "AppleDouble"),
    ],
)
@pytest.mark.parametrize("suffix", ["glb", "gltf", "obj", "ply", "stl", "off", "dae"])
def test_first_bytes_tell_a_file_that_is_no_model(tmp_path: Path, content: bytes, fault: str, suffix: str) -> None:
    with pytest.raises(ConfigError, match=fault):
        read_text(tmp_path, f"m.{suffix}", content)


def test_texture_and_library_that_are_pointers_are_named(tmp_path: Path) -> None:
    pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n"
    (tmp_path / "a.png").write_bytes(pointer)
    (tmp_path / "m.mtl").write_text("newmtl a\nmap_Kd a.png\n", encoding="utf-8")
    _, warnings = read_text(tmp_path, "m.obj", "mtllib m.mtl\nusemtl a\n" + obj())
    assert "texture 'a.png' cannot be read: it is a Git LFS pointer" in warnings[0]
    (tmp_path / "m.mtl").write_bytes(pointer)
    _, warnings = read_text(tmp_path, "m.obj", "mtllib m.mtl\nusemtl a\n" + obj())
    assert "material library 'm.mtl' is a Git LFS pointer" in warnings[0]
