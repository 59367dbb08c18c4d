"""Compare what our readers find in a model file with what other libraries find."""

from __future__ import annotations

import html
import re
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from stages.model_files.scene import GREY
from stages.model_files.scene_file import READERS
from stages.model_files.wavefront_text import decode_wavefront_text
from tests.model_readers.peers import PEERS, Contents, read_ours

MAX_DIFFERENCE = 1e-4
"""Of lengths, areas and volumes, as shares of the diagonal, the area, and diagonal times area."""
MAX_POLYGON_DIFFERENCE = 0.05
"""Of the results of triangulating polygons that are not flat, or touch themselves."""
MAX_OUTLINE_DIFFERENCE = 0.005
"""Of the area of triangulated polygons and that of their outlines, which are not all flat."""
FIELDS = ("triangles", "points", "bounds", "area", "volume", "names", "materials", "colors")


@dataclass(frozen=True)
class Comparison:
    """How the contents of one file compare.

    refusal: our reader's message, if it refused the file; `differing` is then empty.
    peers: the libraries that read the file.
    differing: the fields for which no library agrees with us, nor is there an explanation.
    explained: the fields for which no library agrees with us, each with the explanation.
    seconds: CPU time of our reader.
    """

    path: Path
    refusal: str
    peers: tuple[str, ...]
    differing: tuple[str, ...]
    explained: tuple[str, ...]
    seconds: float


def compare_models(folders: list[Path]) -> Iterator[Comparison]:
    """Yield the comparison of each model file below some folders, in the order of their names."""
    files = {path for folder in folders for path in folder.rglob("*") if path.is_file()}
    for path in sorted(files):
        if path.suffix.lower() in READERS and not path.name.startswith("._"):
            yield compare(path)


def compare(path: Path) -> Comparison:
    """Compare what is in one file; libraries that fail on it have no say."""
    started = time.process_time()
    try:
        ours, refusal = read_ours(path), ""
    except ConfigError as error:
        ours, refusal = None, str(error)
    seconds = time.process_time() - started
    others = {}
    for name, read in PEERS.items():
        try:
            others[name] = read(path)
        except Exception:  # whatever a library raises, it has not read the file
            continue
    differing: list[str] = []
    explained: list[str] = []
    if ours is not None and others:
        differing = [
            field for field in FIELDS if not any(_agree(field, path, ours, other) for other in others.values())
        ]
        for field in tuple(differing):
            reasons = {_explanation(field, path, ours, name, other) for name, other in others.items()}
            if None not in reasons or len(reasons) > 1:
                differing.remove(field)
                explained.append(f"{field}: {', '.join(sorted(reason for reason in reasons if reason))}")
    return Comparison(path, refusal, tuple(others), tuple(differing), tuple(explained), seconds)


def _explanation(field: str, path: Path, ours: Contents, peer: str, other: Contents) -> str | None:
    """Return why a library finds something else; None if that is not known."""
    suffix = path.suffix.lower()
    if field in ("triangles", "points", "area", "volume") and suffix in (".obj", ".dae"):
        first, second = getattr(ours, field), getattr(other, field)
        scale = ours.area * float(np.linalg.norm(ours.high - ours.low)) if field == "volume" else first
        if abs(first - second) <= MAX_POLYGON_DIFFERENCE * scale:
            return f"{peer} triangulates polygons otherwise"
    if field == "area" and suffix == ".obj":
        outlines, fans = polygon_areas(path)
        if abs(ours.area - outlines) <= MAX_OUTLINE_DIFFERENCE * outlines and _nearly(other.area, fans):
            return f"{peer} makes fans of polygons that are not convex"
    if field == "bounds" and suffix in (".glb", ".gltf") and b'"skins"' in path.read_bytes():
        return f"{peer} leaves skins out"
    if field == "materials" and peer == "trimesh":
        libraries = " ".join(
            " ".join(decode_wavefront_text(file.read_bytes()).split()) for file in path.parent.glob("*.mtl")
        )
        if not any(f"newmtl {name}" in libraries for name in ours.materials - other.materials):
            return "trimesh names no material that is not in a library"
    if field == "colors" and peer == "trimesh" and suffix in (".glb", ".gltf"):
        return "trimesh takes linear colours for sRGB"
    return None


def polygon_areas(path: Path) -> tuple[float, float]:
    """Return the areas of all polygons of an OBJ file: of their outlines, projected, and of fans from first corners."""
    points: list[list[float]] = []
    outlines = fans = 0.0
    for line in decode_wavefront_text(path.read_bytes()).splitlines():
        key, *fields = line.split() or [""]
        if key == "v":
            points.append([float(field) for field in fields[:3]])
        elif key == "f":
            numbers = [int(field.split("/")[0]) for field in fields]
            corners = np.array([points[number - 1 if number > 0 else number] for number in numbers])
            sides = corners[1:] - corners[0]
            crosses = np.cross(sides[:-1], sides[1:]) / 2
            outlines += float(np.linalg.norm(crosses.sum(axis=0)))
            fans += float(np.linalg.norm(crosses, axis=1).sum())
    return outlines, fans


def _nearly(first: float, second: float) -> bool:
    return abs(first - second) <= MAX_DIFFERENCE * abs(second)


def _agree(field: str, path: Path, ours: Contents, other: Contents) -> bool:
    diagonal = float(np.linalg.norm(ours.high - ours.low))
    if field == "bounds":
        ends = [(item.low, item.high) for item in (ours, other)]
        if path.suffix.lower() == ".dae":  # assimp turns what is z up
            ends = [(np.sort(high - low), np.zeros(3)) for low, high in ends]
        return bool(np.abs(np.array(ends[0]) - np.array(ends[1])).max() <= MAX_DIFFERENCE * diagonal)
    if field == "area":
        return _nearly(other.area, ours.area)
    if field == "volume":
        return abs(ours.volume - other.volume) <= MAX_DIFFERENCE * diagonal * ours.area
    if field == "names":
        text = html.unescape(decode_wavefront_text(path.read_bytes()))
        given = {name for name in ours.names if name != path.stem and not re.fullmatch(r"(node|mesh)\d+", name)}
        return given <= other.names or all(name in " ".join(text.split()) for name in given)
    if field == "materials":
        return {name for name in ours.materials if not re.fullmatch(r"material\d+", name)} <= other.materials
    if field == "colors":
        known = [*other.colors, GREY]
        return other.is_textured or all(
            any(max(abs(a - b) for a, b in zip(color, seen, strict=True)) <= 1 for seen in known)
            for color in ours.colors
        )
    return bool(getattr(ours, field) == getattr(other, field))
