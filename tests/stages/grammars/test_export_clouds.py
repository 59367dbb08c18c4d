"""The grammar of a scanned wall is that of the wall; each neighbourhood of its shapes is one of the scan."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import ConfigError
from stages.cloud_files.read import read_cloud
from stages.exemplars.read import read_parts
from stages.grammars.description import describe_grammar
from stages.grammars.export_clouds import cloud_of_text, ply_bytes
from stages.grammars.extraction.extract import ExtractedGrammar, extract_grammar
from stages.grammars.files import write_grammar
from stages.grammars.read_surface import is_point_cloud, read_surface
from stages.grammars.scans.scanned_grid import ScannedCloud
from stages.shape.arrays import BoolArray, FloatArray
from tests.cloud_similarity import cloud_similarity
from tests.command import shapemill
from tests.stages.grammars.test_planted import extraction
from tests.stages.grammars.test_scanned_grid import CELL_SIZE, RADIUS_SHARE, cloud_of
from tests.stages.symmetry.planted import wall


@pytest.fixture(scope="module")
def cloud() -> ScannedCloud:
    return cloud_of(wall(4), count=50_000)


@pytest.fixture(scope="module")
def found(cloud: ScannedCloud) -> ExtractedGrammar:
    return extract_grammar(cloud, "scan", RADIUS_SHARE, "z", np.random.default_rng(0))


class TestGrammar:
    def test_sites_pieces_productions_and_grids_are_those_of_the_mesh(self, found: ExtractedGrammar) -> None:
        exact = extraction(wall(4), RADIUS_SHARE)
        for extracted in (found, exact):
            assert [piece.site for piece in extracted.docked_pieces] == [0] * 8
            assert [grid.counts for grid in extracted.grammar.grids] == [(3,), (3,)]
        assert len(found.grammar.productions) == len(exact.grammar.productions)

    def test_terminals_consist_of_whole_splats(self, found: ExtractedGrammar) -> None:
        for mesh in found.grammar.meshes:
            corners = mesh.vertices[mesh.faces]
            sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
            assert np.allclose(sides, sides[:, :1], rtol=1e-3)

    def test_original_grid_gives_all_points_back(self, found: ExtractedGrammar) -> None:
        back = cloud_of_text(found.grammar, "G0[3]").points
        assert len(back) == pytest.approx(len(found.grid.corners), rel=0.02)
        assert np.allclose(np.ptp(back, axis=0), np.ptp(found.grid.corners.mean(axis=1), axis=0), atol=CELL_SIZE)


class TestSimilar:
    @pytest.mark.parametrize("text", ["G0[1]", "G0[6]", "G1[4]"])
    def test_neighbourhoods_of_a_shape_are_those_of_the_scan(
        self, cloud: ScannedCloud, found: ExtractedGrammar, text: str
    ) -> None:
        shape = cloud_of_text(found.grammar, text).points
        assert np.ptp(shape[:, 0]) == pytest.approx(5.2 + int(text[3]) - 3, abs=CELL_SIZE)
        assert similarity(cloud.points, shape).all()

    def test_step_that_the_scan_lacks_is_detected(self, cloud: ScannedCloud) -> None:
        stepped = cloud.points.copy()
        stepped[stepped[:, 0] > 2.6, 1] += 3 * CELL_SIZE
        here = np.abs(stepped[:, 0] - 2.6) < CELL_SIZE
        assert similarity(cloud.points, stepped, here).mean() < 0.1


def similarity(exemplar: FloatArray, shape: FloatArray, only: np.ndarray | None = None) -> BoolArray:
    """Return whether 24 probes match, of some points only if given."""
    rng = np.random.default_rng(0)
    return cloud_similarity(exemplar, shape, 4 * CELL_SIZE, 0.75 * CELL_SIZE, 2, 24, rng, only)


class TestFiles:
    def test_ply_without_faces_is_a_cloud_with_normals_and_colours(self, tmp_path: Path, cloud: ScannedCloud) -> None:
        normals = np.tile([0.0, 1.0, 0.0], (len(cloud.points), 1))
        path = tmp_path / "scan.ply"
        path.write_bytes(ply_bytes(ScannedCloud(cloud.points, cloud.colors, normals)))
        read = read_cloud(path)
        assert read is not None
        assert read.normals is not None
        assert (read.points == cloud.points).all()
        assert (read.normals == normals).all()
        assert (read.colors == cloud.colors).all()

    @pytest.mark.parametrize(("suffix", "columns"), [("xyz", 3), ("xyzn", 6), ("xyzrgb", 6)])
    def test_table_is_a_cloud(self, tmp_path: Path, suffix: str, columns: int) -> None:
        rows = np.random.default_rng(0).random((40, columns)).round(4)
        path = tmp_path / f"scan.{suffix}"
        np.savetxt(path, rows)
        read = read_cloud(path)
        assert read is not None
        assert (read.points == rows[:, :3]).all()
        assert (read.normals is not None) == (suffix == "xyzn")
        assert is_point_cloud(path)

    def test_surface_is_in_metres_where_the_config_or_the_file_states_the_unit(self, tmp_path: Path) -> None:
        rows = np.random.default_rng(0).random((40, 3)).round(4)
        np.savetxt(tmp_path / "scan.xyz", rows)
        (silent, _, _), (stated, _, _) = (read_surface(tmp_path / "scan.xyz", units=u) for u in ("auto", "mm"))
        assert isinstance(silent, ScannedCloud)
        assert isinstance(stated, ScannedCloud)
        assert (silent.unit, stated.unit) == ("unknown", "metre")
        np.testing.assert_allclose(stated.points, rows / 1000)
        facade, _, _ = read_surface(Path("datasets/exemplars/facade/townhouse.glb"))
        assert facade.unit == "metre"

    def test_mesh_is_no_cloud(self) -> None:
        assert not is_point_cloud(Path("datasets/exemplars/facade/townhouse.glb"))

    @pytest.mark.parametrize(
        ("name", "content", "why"),
        [
            ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 2\nproperty int x\nend_header\n1\n2\n", "no property y"),
            ("b.ply", b"ply\nformat ascii 1.0\nelement vertex 9\nproperty int x\nend_header\n1\n", "cut off"),
            ("c.xyz", b"1 2 3\nfour 5 6\n", "line 2: 'four' is no number"),
            ("d.xyzn", b"1 2 3\n4 5 6\n", "3 numbers a line"),
        ],
        ids=["lacking", "cut off", "words", "narrow"],
    )  # fmt: skip
    def test_invalid_clouds_are_rejected(self, tmp_path: Path, name: str, content: bytes, why: str) -> None:
        path = tmp_path / name
        path.write_bytes(content)
        with pytest.raises(ConfigError, match=why):
            read_surface(path)

    def test_cloud_has_no_parts(self, tmp_path: Path, cloud: ScannedCloud) -> None:
        path = tmp_path / "scan.ply"
        path.write_bytes(ply_bytes(ScannedCloud(cloud.points, cloud.colors, cloud.points)))
        with pytest.raises(ConfigError, match="if it is a point cloud, which has no parts, make a grammar of it"):
            read_parts(path)


def test_command_writes_shapes_as_clouds(tmp_path: Path, found: ExtractedGrammar) -> None:
    text, arrays = tmp_path / "scan.json", tmp_path / "scan.tar"
    with text.open("wb") as json, arrays.open("wb") as tar:
        write_grammar(describe_grammar(found), found.grammar, json, tar)
    code, output = shapemill("grammar-clouds", text, "G0[2]", "--out", tmp_path)
    assert code == 0, output
    read = read_cloud(tmp_path / "scan-0.ply")
    assert read is not None
    assert np.allclose(read.points, cloud_of_text(found.grammar, "G0[2]").points)
    assert shapemill("grammar-clouds", text, "G0[2")[0] == 2
    code, output = shapemill("grammar-clouds", tmp_path / "none.json", "G0[2]")
    assert code == 2
    assert "there is no file" in output
