"""Shapes of the grammar of a point cloud, which are clouds again, as PLY files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from pipeline.paths import write_file
from stages.grammars.derivation_text import parse_derivation
from stages.grammars.derived_shape import placed_terminals
from stages.grammars.grammar import ShapeGrammar
from stages.grammars.scans.scanned_grid import ScannedCloud
from stages.shape.geometry.pose import transform_points
from stages.shape.geometry.triangles import unit_normals

POINT_ROW = np.dtype([("position", "<f8", 3), ("normal", "<f4", 3), ("color", "u1", 3)])
PLY_HEADER = """\
ply
format binary_little_endian 1.0
element vertex {count}
property double x
property double y
property double z
property float nx
property float ny
property float nz
property uchar red
property uchar green
property uchar blue
end_header
"""


def cloud_of_text(grammar: ShapeGrammar, text: str) -> ScannedCloud:
    """Return the shape of a derivation as a cloud.

    Its points are those of the exemplar, projected onto their patches and moved with their terminals. Raises
    DerivationError for a text that is no derivation of the grammar.
    """
    points, normals, colors = [], [], []
    for piece in placed_terminals(grammar, parse_derivation(grammar, text)):
        mesh = grammar.meshes[piece.mesh]
        corners = transform_points(piece.pose, mesh.vertices)[mesh.faces]
        points.append(corners.mean(axis=1))
        normals.append(unit_normals(corners))
        colors.append(mesh.face_colors)
    return ScannedCloud(np.concatenate(points), np.concatenate(colors), np.concatenate(normals))


def ply_bytes(cloud: ScannedCloud) -> bytes:
    """Return a binary PLY file of a cloud with normals."""
    rows = np.empty(len(cloud.points), dtype=POINT_ROW)
    rows["position"], rows["normal"], rows["color"] = cloud.points, cloud.normals, cloud.colors
    return PLY_HEADER.format(count=len(rows)).encode() + rows.tobytes()


def write_clouds(folder: Path, name: str, grammar: ShapeGrammar, texts: Sequence[str]) -> Iterator[tuple[str, Path]]:
    """Write the shapes of derivations as `<name>-<number>.ply`; yield each text with its file."""
    for number, text in enumerate(texts):
        yield text, write_file(folder / f"{name}-{number}.ply", ply_bytes(cloud_of_text(grammar, text)))
