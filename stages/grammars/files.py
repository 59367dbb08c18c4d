"""A grammar on disk: `<name>.json`, for people to read, and `<name>.tar`, the arrays for programs."""

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
from stages.grammars.derivation import ENDS, Derivation, NonTerminal
from stages.grammars.grammar import Grid, Production, ShapeGrammar
from stages.shape.kit import PartMesh


def write_grammar(described: Mapping[str, Any], grammar: ShapeGrammar, text: Any, arrays: Any) -> None:
    """Write a grammar to two binary streams: what `describe_grammar` says of it to `text`, the tar to `arrays`."""
    text.write(json.dumps(described, indent=1, ensure_ascii=False, allow_nan=False).encode() + b"\n")
    with ShardWriter(arrays) as writer:
        for number, each in enumerate(chain(grammar.meshes, (grammar.exemplar,))):
            members = {
                "vertices.npy": array_bytes(each.vertices),
                "faces.npy": array_bytes(each.faces),
                "colors.npy": array_bytes(each.face_colors),
            }
            writer.write(f"mesh-{number:05d}", members)
        for site, points in sorted(grammar.seams.items()):
            writer.write(f"seam-{site:05d}", {"points.npy": array_bytes(points)})


@lru_cache(maxsize=8)
def load_grammar(text: Path, arrays: Path) -> ShapeGrammar:
    """The grammar that `write_grammar` wrote to these two files; read once for each process."""
    said = json.loads(text.read_text())
    names = [*(each["name"] for each in said["terminals"]), "exemplar"]
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
        name=said["grammar"],
        up=said["up"],
        radius=said["radius"],
        meshes=tuple(meshes[:-1]),
        middles=np.array([each["middle"] for each in said["terminals"]]).reshape(-1, 3),
        productions=tuple(_rule(number, each) for number, each in enumerate(said["rules"])),
        grids=tuple(map(_grid, said["grids"])),
        seams=seams,
        exemplar=meshes[-1],
        splats=said["made_of"] == "points",
    )


def _rule(number: int, said: Mapping[str, Any]) -> Production:
    places = [NonTerminal(each["site"], np.array(each["frame"]), _derivation(each["tree"])) for each in said["places"]]
    return Production(said["name"], said["site"], np.array(said["frame"]), number, tuple(places))


def _derivation(tree: Sequence[Any]) -> Derivation:
    return Derivation(tree[0], tuple(map(_derivation, tree[1:])))


def _grid(said: Mapping[str, Any]) -> Grid:
    rows = said["rows"]
    return Grid(
        name=said["name"],
        transforms=np.array([each["motion"] for each in rows]),
        counts=tuple(each["cells"] for each in rows),
        sites=tuple(each["site"] for each in rows),
        frames=np.array([each["frame"] for each in rows]),
        pieces=tuple((each["terminal"], tuple(map(ENDS.index, each["along"]))) for each in said["pieces"]),
    )


def load_grammars(places: DatasetPaths) -> dict[str, ShapeGrammar]:
    """The grammars of a dataset out of the mill's folder."""
    made = places.stage("grammars").root
    return {
        path.stem: load_grammar(path, path.with_suffix(".tar"))
        for path in sorted(made.glob("*.json"))
        if path.with_suffix(".tar").is_file()
    }
