"""Shapes of the grammar of a point cloud, which are clouds again, as PLY files.

python -m stages.grammars.export_clouds GRAMMAR.json TEXT... [--out FOLDER]

GRAMMAR.json is what stage `grammars` has written, with its .tar beside it; TEXT a derivation, as samples of a dataset
have it: 'S1(B0)' or 'G0[5]'.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from pipeline.paths import write_file
from stages.grammars.derivation_text import DerivationError, parse_derivation, placed_terminals
from stages.grammars.files import load_grammar
from stages.grammars.grammar import ShapeGrammar
from stages.grammars.scans.scanned_grid import ScannedCloud
from stages.shape.geometry.pose import transform_points
from stages.shape.geometry.triangles import unit_normals

ROW = np.dtype([("place", "<f8", 3), ("normal", "<f4", 3), ("color", "u1", 3)])
HEADER = """\
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
    """The shape of a derivation: points of the exemplar, on the planes of their patches, moved as the pieces are that
    they are in. Raises DerivationError for a text that is no derivation of the grammar."""
    points, normals, colors = [], [], []
    for piece in placed_terminals(grammar, parse_derivation(grammar, text)):
        mesh = grammar.meshes[piece.mesh]
        corners = transform_points(piece.pose, mesh.vertices)[mesh.faces]
        points.append(corners.mean(axis=1))
        normals.append(unit_normals(corners))
        colors.append(mesh.face_colors)
    return ScannedCloud(np.concatenate(points), np.concatenate(colors), np.concatenate(normals))


def ply_bytes(cloud: ScannedCloud) -> bytes:
    """A binary PLY file of a cloud with normals."""
    rows = np.empty(len(cloud.points), dtype=ROW)
    rows["place"], rows["normal"], rows["color"] = cloud.points, cloud.normals, cloud.colors
    return HEADER.format(count=len(rows)).encode() + rows.tobytes()


def write_clouds(folder: Path, name: str, grammar: ShapeGrammar, texts: Sequence[str]) -> Iterator[tuple[str, Path]]:
    """Write the shapes of some derivations as `<name>-<number>.ply`; each with where it is."""
    for number, text in enumerate(texts):
        yield text, write_file(folder / f"{name}-{number}.ply", ply_bytes(cloud_of_text(grammar, text)))


def main(arguments: list[str]) -> int:
    """Write the clouds that the arguments ask for; 0, or 2 with a message where that cannot be."""
    parser = argparse.ArgumentParser(
        prog="python -m stages.grammars.export_clouds", description="Shapes of a scan as clouds."
    )
    parser.add_argument("grammar", type=Path, help="the JSON of a grammar, its .tar beside it")
    parser.add_argument("texts", nargs="+", metavar="TEXT", help="derivations, such as 'S1(B0)' or 'G0[5]'")
    parser.add_argument("--out", type=Path, default=Path("datasets", "clouds"), help="where the PLY files go")
    asked = parser.parse_args(arguments)
    try:
        for each in (asked.grammar, asked.grammar.with_suffix(".tar")):
            if not each.is_file():
                raise ConfigError(f"there is no file {each}; a dataset's grammars are in its .work/grammars")
        grammar = load_grammar(asked.grammar, asked.grammar.with_suffix(".tar"))
        if not grammar.splats:
            raise ConfigError(f"{asked.grammar}: is of a mesh, of which shapes are meshes and no clouds")
        for text, path in write_clouds(asked.out, grammar.name, grammar, asked.texts):
            print(f"{text:<18} {path}")
    except (ConfigError, DerivationError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
