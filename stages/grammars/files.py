"""A grammar on disk: `<name>.json` for people and programs, and `<name>.tar` with the arrays."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.paths import DatasetPaths
from pipeline.shards import ShardWriter, array_bytes, bytes_array, read_shard
from stages.grammars.derivation import GRID_PARTS, Derivation, NonTerminal
from stages.grammars.grammar import Grid, Production, ShapeGrammar
from stages.shape.kit import PartMesh


def write_grammar(description: Mapping[str, Any], grammar: ShapeGrammar, text: Any, arrays: Any) -> None:
    """Write a grammar to two binary streams: what `describe_grammar` returns to `text`, the tar to `arrays`."""
    text.write(json.dumps(description, indent=1, ensure_ascii=False, allow_nan=False).encode() + b"\n")
    with ShardWriter(arrays) as writer:
        for number, mesh in enumerate(chain(grammar.meshes, (grammar.exemplar,))):
            members = {
                "vertices.npy": array_bytes(mesh.vertices),
                "faces.npy": array_bytes(mesh.faces),
                "colors.npy": array_bytes(mesh.face_colors),
            }
            writer.write(f"mesh-{number:05d}", members)
        for site, points in sorted(grammar.seams.items()):
            writer.write(f"seam-{site:05d}", {"points.npy": array_bytes(points)})


@lru_cache(maxsize=8)
def load_grammar(text: Path, arrays: Path) -> ShapeGrammar:
    """Load a grammar that `write_grammar` wrote to these two files; it is read once per process."""
    stored = json.loads(text.read_text(encoding="utf-8"))
    names = [*(terminal["name"] for terminal in stored["terminals"]), "exemplar"]
    meshes: list[PartMesh] = []
    seams: dict[int, np.ndarray] = {}
    for key, members in read_shard(arrays):
        kind, _, number = key.partition("-")
        if kind == "seam":
            seams[int(number)] = bytes_array(members["points.npy"])
            continue
        vertices, faces = bytes_array(members["vertices.npy"]), bytes_array(members["faces.npy"])
        meshes.append(PartMesh(names[len(meshes)], vertices, faces, bytes_array(members["colors.npy"])))
    return ShapeGrammar(
        name=stored["grammar"],
        up=stored["up"],
        radius=stored["radius"],
        meshes=tuple(meshes[:-1]),
        middles=np.array([terminal["middle"] for terminal in stored["terminals"]]).reshape(-1, 3),
        productions=tuple(_production(number, production) for number, production in enumerate(stored["productions"])),
        grids=tuple(map(_grid, stored["grids"])),
        seams=seams,
        exemplar=meshes[-1],
        splats=stored["made_of"] == "points",
        unit=stored["unit"],
    )


def _production(number: int, stored: Mapping[str, Any]) -> Production:
    non_terminals = [
        NonTerminal(known["site"], np.array(known["frame"]), _derivation(known["tree"]))
        for known in stored["non_terminals"]
    ]
    return Production(stored["name"], stored["site"], np.array(stored["frame"]), number, tuple(non_terminals))


def _derivation(tree: Sequence[Any]) -> Derivation:
    return Derivation(tree[0], tuple(map(_derivation, tree[1:])))


def _grid(stored: Mapping[str, Any]) -> Grid:
    rows = stored["rows"]
    return Grid(
        name=stored["name"],
        transforms=np.array([row["transform"] for row in rows]),
        counts=tuple(row["cells"] for row in rows),
        sites=tuple(row["site"] for row in rows),
        frames=np.array([row["frame"] for row in rows]),
        pieces=tuple((piece["terminal"], tuple(map(GRID_PARTS.index, piece["along"]))) for piece in stored["pieces"]),
    )


def load_grammars(paths: DatasetPaths) -> dict[str, ShapeGrammar]:
    """Load the grammars of a dataset from its work folder."""
    folder = paths.stage("grammars").root
    return {
        path.stem: load_grammar(path, path.with_suffix(".tar"))
        for path in sorted(folder.glob("*.json"))
        if path.with_suffix(".tar").is_file()
    }
