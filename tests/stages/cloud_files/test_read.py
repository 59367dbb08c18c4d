"""Clouds are read from tables as people write them; what is no row is refused with line, delimiter and header."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import ConfigError
from stages.cloud_files.cloud import PointCloud
from stages.cloud_files.read import UNREAD_SUFFIXES, read_cloud

CASES = Path(__file__).resolve().parents[3].parent / "shared" / "cases"
RNG = np.random.default_rng(0)
POINTS = RNG.normal(size=(40, 3)).round(4)
NORMALS = POINTS / np.linalg.norm(POINTS, axis=1)[:, None]
COLORS = RNG.integers(0, 256, (40, 3))
NUMBERS = np.arange(40)[:, None]


def rows(separator: str, *columns: np.ndarray, decimal: str = ".") -> str:
    """Write columns as lines."""
    table = np.hstack(columns or (POINTS,))
    return "".join(separator.join(f"{v:.10g}".replace(".", decimal) for v in row) + "\n" for row in table)


def cloud(path: Path) -> PointCloud:
    read = read_cloud(path)
    assert read is not None
    return read


def read_text(folder: Path, text: str | bytes, name: str = "scan.txt") -> PointCloud:
    path = folder / name
    path.write_bytes(text.encode("latin-1") if isinstance(text, str) else text)
    return cloud(path)


SPACES, COMMAS = rows(" "), rows(",")
QUOTED = "".join('"' + line.replace(",", '","') + '"\n' for line in COMMAS.splitlines())
TABLES: dict[str, str | bytes] = {
    "spaces": SPACES,
    "several spaces": rows("   "),
    "commas": COMMAS,
    "commas and spaces": rows(", "),
    "spaces around commas": rows(" , "),
    "tabs": rows("\t"),
    "bars": "x | y | z\n" + rows(" | "),
    "semicolons": rows(";"),
    "header": "x,y,z\n" + COMMAS,
    "header in capitals": "X Y Z\n" + SPACES,
    "quoted": '"x","y","z"\n' + QUOTED,
    "any order": "z,intensity,y,x\n" + rows(",", POINTS[:, 2:], NUMBERS, POINTS[:, 1:2], POINTS[:, :1]),
    "CloudCompare": "//X,Y,Z\n" + COMMAS,
    "CloudCompare with a count": "//X Y Z\n40\n" + SPACES,
    "comment header": "# x y z\n" + SPACES,
    "named fields": "# Fields: x y z intensity\n" + rows(" ", POINTS, NUMBERS),
    "comment that is a sentence": "# x y z are in metres\n" + SPACES,
    "units in brackets": "X [m];Y [m];Z [m]\n" + rows(";", decimal=","),
    "units in brackets and spaces": "X [m] Y [m] Z [m]\n" + SPACES,
    "units in a row": "X;Y;Z\n[m];[m];[m]\n" + rows(";"),
    "ParaView": '"w","Points:0","Points:1","Points:2"\n' + rows(",", NUMBERS * 0.5, POINTS),
    "survey": "Point,Easting,Northing,Elevation\n" + "".join(f"P{i},{row}\n" for i, row in enumerate(COMMAS.split())),
    "labels": "label,x,y,z\n" + "".join(f"chair leg,{row}\n" for row in COMMAS.split()),
    "pandas": ",x,y,z\n" + rows(",", NUMBERS, POINTS),
    "pandas without names": ",0,1,2\n" + rows(",", NUMBERS, POINTS),
    "pandas without names and rows": "0,1,2\n" + COMMAS,
    "R": '"x" "y" "z"\n' + "".join(f'"{i + 1}" {row}\n' for i, row in enumerate(SPACES.splitlines())),
    "row numbers": rows(" ", NUMBERS + 1, POINTS),
    "count": "40\n" + SPACES,
    "rows and columns": "40 3\n" + SPACES,
    "two scans with counts": "20\n" + rows(" ", POINTS[:20]) + "20\n" + rows(" ", POINTS[20:]),
    "decimal commas and semicolons": "x;y;z\n" + rows(";", decimal=","),
    "decimal commas and tabs": rows("\t", decimal=","),
    "decimal commas and spaces": rows(" ", decimal=","),
    "Fortran": "".join(" ".join(f"{v:.6e}".replace("e", "D") for v in row) + "\n" for row in POINTS),
    "blank lines and comments": "# scan\n\n" + SPACES.replace("\n", "  # point\n\n") + "// end\n",
    "trailing delimiters": "x,y,z,\n" + COMMAS.replace("\n", ",\n"),
    "trailing delimiters on some": COMMAS.replace("\n", ",\n", 5),
    "title": "Exported by Foo 3.2\nx y z\n" + SPACES,
    "CRLF": ("x,y,z\n" + COMMAS).replace("\n", "\r\n"),
    "CR": ("x,y,z\n" + COMMAS).replace("\n", "\r"),
    "end of file of DOS": COMMAS + "\x1a",
    "Latin-1": "x,y,z,H\xf6he\n" + rows(",", POINTS, NUMBERS),
    "BOM": ("x,y,z\n" + COMMAS).encode("utf-8-sig"),
    "UTF-16": ("x\ty\tz\n" + rows("\t")).encode("utf-16"),
    "UTF-16 without BOM": COMMAS.encode("utf-16-le"),
}


@pytest.mark.parametrize("name", TABLES)
def test_table_is_read_as_people_write_it(name: str, tmp_path: Path) -> None:
    read = read_text(tmp_path, TABLES[name])
    assert np.array_equal(read.points, POINTS)
    assert read.normals is None
    assert read.colors is None


@pytest.mark.parametrize("suffix", [".xyz", ".csv", ".tsv", ".asc", ".pts", ".TXT", ".CSV"])
def test_content_and_not_the_ending_says_how_rows_are_written(suffix: str, tmp_path: Path) -> None:
    assert np.array_equal(read_text(tmp_path, "X;Y;Z\n" + rows(";", decimal=","), f"scan{suffix}").points, POINTS)


def test_text_and_array_give_the_same_bits(tmp_path: Path) -> None:
    exact = RNG.normal(size=(50, 3))
    np.save(tmp_path / "scan.npy", exact)
    read = read_text(tmp_path, "".join(f"{x!r},{y!r},{z!r}\n" for x, y, z in exact.tolist()))
    assert np.array_equal(read.points, cloud(tmp_path / "scan.npy").points)


@pytest.mark.parametrize(
    ("header", "columns", "said"),
    [
        ("x,y,z,nx,ny,nz,r,g,b", (POINTS, NORMALS, COLORS), ""),
        ("//X,Y,Z,Rf,Gf,Bf,Nx,Ny,Nz", (POINTS, COLORS / 255, NORMALS), ""),
        ("red,green,blue,normal_x,normal_y,normal_z,x,y,z", (COLORS, NORMALS, POINTS), ""),
        ("x,y,z,diffuse_red,diffuse_green,diffuse_blue,NormalX,NormalY,NormalZ", (POINTS, COLORS * 257, NORMALS), ""),
        ("", (POINTS, NORMALS, COLORS), "columns 4 to 6 have no names and are unit vectors"),
        ("", (POINTS, COLORS, NORMALS), "columns 4 to 6 have no names and are from 0 to"),
        ("", (POINTS, NUMBERS * 10 - 200, COLORS / 255, NORMALS), "column 4 has no name and was left out"),
        ("x,y,z,i,r,g,b,nx,ny,nz", (POINTS, NUMBERS, COLORS, NORMALS), "columns 'i' were left out"),
    ],
)
def test_normals_and_colours_are_found_by_name_or_by_convention(
    header: str, columns: tuple[np.ndarray, ...], said: str, tmp_path: Path
) -> None:
    read = read_text(tmp_path, (header and header + "\n") + rows(",", *columns))
    assert np.array_equal(read.points, POINTS)
    assert read.normals is not None
    assert read.colors is not None
    assert np.allclose(read.normals, NORMALS)
    assert np.array_equal(read.colors, COLORS)
    assert said in "; ".join(read.warnings)
    assert bool(said) == bool(read.warnings)


def test_endings_that_state_their_columns_need_no_warning(tmp_path: Path) -> None:
    colored = read_text(tmp_path, rows(" ", POINTS, COLORS / 255), "scan.xyzrgb")
    assert np.array_equal(colored.colors, COLORS)
    normals = read_text(tmp_path, rows(" ", POINTS, 2 * NORMALS), "scan.xyzn").normals
    assert np.allclose(normals, 2 * NORMALS)
    assert colored.warnings == ()


def test_rows_without_a_finite_number_are_counted(tmp_path: Path) -> None:
    read = read_text(tmp_path, "x,y,z\n1,nan,2\n1,,2\n1,NULL,3\n1.#QNAN,2,3\n1,inf,1e999\n" + COMMAS)
    assert np.array_equal(read.points, POINTS)
    assert read.warnings == ("5 of 45 points are not finite (NaN or infinity, or a field is empty) and were left out",)


REFUSED = {
    "word": ("x,y,z\n" + COMMAS + "1,abc,3\n", r"line 42: 'abc' is no number \(delimiter comma, header 'x,y,z'\)"),
    "short row": (SPACES + "1 2\n", r"line 41 has 2 fields and line 1 has 3 \(delimiter spaces, no header\): '1 2'"),
    "long row": ("x;y;z\n" + rows(";") + "1;2;3;4\n", r"line 42 has 4 fields and line 2 has 3 \(delimiter semicolon"),
    "cut off": ("50\n" + SPACES, "line 1 announces 50 points and 40 follow"),
    "other names": ("a,b,c\n" + COMMAS, r"header 'a,b,c' \(delimiter comma\) names no x, y and z"),
    "angles": ("lat,lon,h\n" + COMMAS, "angles are no coordinates"),
    "two columns": ("x,y\n1,2\n3,4\n", "no line has three numbers; it begins with 'x,y'"),
    "labels without header": (
        "".join(f"chair,{row}\n" for row in COMMAS.split()),
        "line 1: 'chair' is no number .* name the columns x, y and z in a header",
    ),
    "decimal commas and commas": (rows(",", decimal=","), "commas between its numbers and in them"),
    "decimal commas and commas below a header": ("x,y,z\n" + rows(",", decimal=","), "3 names and the rows have 6"),
    "thousands": ("x;y;z\n" + rows(";", decimal=",") + "1.234,5;2;3\n", r"line 42: '1\.234,5' is no number"),
    "text": ("some words\nand more\n", "no line has three numbers"),
    "blank": ("\n\n \n", "blank lines only"),
    "binary": (bytes(range(256)) * 9, "holds binary data"),
    "packed": (b"\x1f\x8b\x08\x00 and more", "gunzip"),
    "all missing": ("x,y,z\nnan,nan,nan\n1,2,nan\n", r"holds no points \(2 of 2 points are not finite"),
    "underscore": (SPACES + "1_0 2 3\n", "line 41: '1_0' is no number"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_other_text_is_refused_with_its_line(name: str, tmp_path: Path) -> None:
    text, words = REFUSED[name]
    with pytest.raises(ConfigError, match=words) as caught:
        read_text(tmp_path, text)
    assert str(caught.value).startswith(f"{tmp_path / 'scan.txt'}: ")


def test_arrays_are_read_by_names_or_by_shape(tmp_path: Path) -> None:
    plain = tmp_path / "scan.npy"
    for stored in (POINTS, POINTS.astype(">f4"), np.hstack([POINTS, NORMALS]), POINTS[None], np.asfortranarray(POINTS)):
        np.save(plain, stored)
        assert np.allclose(cloud(plain).points, POINTS, atol=1e-6)
    millimetres = np.rint(POINTS * 1000).astype(np.int16)
    np.save(plain, millimetres)
    assert np.array_equal(cloud(plain).points, millimetres)
    fields = np.rec.fromarrays(POINTS.T[::-1], names="Z,Y,X")
    np.save(plain, fields)
    assert np.array_equal(cloud(plain).points, POINTS)
    archive = tmp_path / "scan.npz"
    np.savez(archive, labels=NUMBERS, points=POINTS, normals=NORMALS, colors=COLORS.astype(np.uint8))
    read = cloud(archive)
    assert np.array_equal(read.points, POINTS)
    assert np.array_equal(read.normals, NORMALS)
    assert np.array_equal(read.colors, COLORS)
    np.savez(archive, POINTS)
    assert np.array_equal(cloud(archive).points, POINTS)


@pytest.mark.parametrize(
    ("array", "words"),
    [
        (POINTS.T[:, :2], r"shape \(3, 2\): a cloud is \(points, 3\); transpose it"),
        (np.zeros((2, 40, 3)), r"shape \(2, 40, 3\)"),
        (np.array([["a", "b", "c"]]), "no numbers"),
        (np.zeros(9), r"shape \(9,\)"),
    ],
)
def test_arrays_of_other_shapes_are_refused(array: np.ndarray, words: str, tmp_path: Path) -> None:
    np.save(tmp_path / "scan.npy", array)
    with pytest.raises(ConfigError, match=words):
        cloud(tmp_path / "scan.npy")


def test_archive_with_several_candidates_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "scan.npz", a=POINTS, b=POINTS)
    with pytest.raises(ConfigError, match=r"holds the arrays a, b, .* name one `points`"):
        cloud(tmp_path / "scan.npz")


def test_pcd_and_ptx_and_points_of_obj_are_read(tmp_path: Path) -> None:
    import open3d as o3d

    written = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(POINTS))
    written.colors = o3d.utility.Vector3dVector(COLORS / 255)
    for ascii_text in (True, False):
        o3d.io.write_point_cloud(str(tmp_path / "scan.pcd"), written, write_ascii=ascii_text)
        read = cloud(tmp_path / "scan.pcd")
        assert np.allclose(read.points, POINTS, atol=1e-6)
        assert np.array_equal(read.colors, COLORS)
    content = (tmp_path / "scan.pcd").read_bytes()
    (tmp_path / "scan.pcd").write_bytes(content[:-100])
    with pytest.raises(ConfigError, match="announces 40 points"):
        cloud(tmp_path / "scan.pcd")
    turn = "0 1 0 0\n-1 0 0 0\n0 0 1 0\n5 6 7 1\n"
    grid = "2\n3\n5 6 7\n0 1 0\n-1 0 0\n0 0 1\n" + turn + "1 2 3 .5\n0 0 0 .5\n" + "4 5 6 .5\n" * 4
    read = read_text(tmp_path, grid * 2, "scan.ptx")
    assert read.points[0].tolist() == [5 - 2, 6 + 1, 7 + 3]
    assert (len(read.points), read.warnings) == (10, ("2 directions of the scanner hit nothing and are no points",))
    with pytest.raises(ConfigError, match="line 1 announces 6 points and 3 follow"):
        read_text(tmp_path, "\n".join(grid.split("\n")[:13]), "scan.ptx")
    vertices = "".join(f"v {row}\nvn 0 0 1\n" for row in SPACES.splitlines())
    assert np.array_equal(read_text(tmp_path, "# o\no scan\n" + vertices, "scan.obj").points, POINTS)
    (tmp_path / "mesh.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", encoding="utf-8")
    assert read_cloud(tmp_path / "mesh.obj") is None


@pytest.mark.parametrize("suffix", UNREAD_SUFFIXES)
def test_formats_that_are_not_read_are_named_with_a_remedy(suffix: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="files are not read; save the"):
        read_text(tmp_path, b"LASF", f"scan{suffix}")


@pytest.mark.skipif(not CASES.is_dir(), reason="needs the shared material")
@pytest.mark.parametrize("name", ["scan-header.csv", "scan-cc-header.csv", "scan-count-first.txt"])
def test_cases_give_the_cloud_of_their_control(name: str) -> None:
    read, control = cloud(CASES / name), cloud(CASES / "scan-plain.npy")
    assert np.allclose(read.points, control.points, atol=1e-5)
    assert read.warnings == ()
