"""Draw models and variants of them with the renderer of `views`, with pyrender and with Blender, side by side.

python -m tests.renderings --out FOLDER [--as-inspected] [--blender PYTHON] MODEL...

The variants are exchanges and growth of the parts, and longer and shorter rows, as GLB files. With --as-inspected the
model goes through inspect, its config is run as it is, and the variants are samples of that. Writes
FOLDER/<model>/sheet.png and prints a table: the share of the pixels of the shape that both renderers cover, and how far
their unlit colours differ. PYTHON has the package bpy; without one there are no pictures by Blender.
"""

from __future__ import annotations

import argparse
import itertools
import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.paths import DatasetPaths
from stages.api import read_kit, vary
from stages.exemplars.language import dataset_kits
from stages.inspection.config_text import dataset_name
from stages.model_files.read import read_model
from stages.model_files.scene import ModelScene
from stages.package.glb import glb_bytes
from stages.proportions.text import ProportionShapes, shape_of_proportion_text
from stages.rows.draws import LayoutDraws
from stages.rows.layout import layout_of
from stages.rows.settings import RowsConfig
from stages.shape.kit import Assembly, Kit, PartMesh
from stages.shape.sample import read_samples
from stages.shape.shape import Shape, kit_shape, upright
from stages.shape.views.sheet import Cell, Section, contact_sheet, picture_png
from tests.bench.exemplars import STAGES
from tests.renderings.peers import blender_pictures, pyrender_pictures
from tests.stages.views.rendered import views_of

SIDE_PIXELS = 320
VARIANTS_A_WAY = 2
MAX_DRAWS = 20
KIT_SETTINGS: dict[str, Any] = {
    "appearance": "textures",
    "up": "y",
    "contact": {"tolerance": 0.005, "kinds": ("point", "line", "face")},
    "grammar": "count_and_types",
    "hubs": {"types": "none"},
    "disconnected": "largest",
}
"""Loose ones that find variants of most models without a search for settings."""
MAX_LEVELS = 8
"""Colours that differ by no more, of 255, count as the same."""
CAMERA = {"kind": "ring", "count": 1, "elevation": 22.0, "azimuth": -35.0}
HEADER = "| model | shape | covered by both | mean difference, of 255 | within 8 |\n|---|---|---:|---:|---:|"


def main() -> None:
    """Print the table and write the sheets."""
    parser = argparse.ArgumentParser(prog="python -m tests.renderings", description="Compare pictures of models.")
    parser.add_argument("models", nargs="+", type=Path, metavar="MODEL")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--blender", type=Path, help="a Python with bpy")
    parser.add_argument("--as-inspected", action="store_true", help="show samples of the config of inspect")
    options = parser.parse_args()
    print(HEADER, flush=True)
    for model in options.models:
        name = dataset_name([model])
        for row in compared(model, options.out / name, name, options.as_inspected, options.blender):
            print(f"| {name} | {' | '.join(row)} |", flush=True)


def compared(model: Path, folder: Path, name: str, as_inspected: bool, blender: Path | None) -> Iterator[Sequence[str]]:
    """Write the sheet of a model; yield the cells of a row for each shape."""
    folder.mkdir(parents=True, exist_ok=True)
    kit = read_kit(model, **KIT_SETTINGS)
    scene = read_model(model, texture_size=512)
    shapes = [("source", model, upright(_whole(scene, kit.up)), kit.up)]
    for label, variant in _inspected(model, folder) if as_inspected else _variants(kit):
        path = folder / f"{label.replace(' ', '-')}.glb"
        path.write_bytes(glb_bytes(upright(variant)))
        shapes.append((label, path, _whole(read_model(path, texture_size=512), "y"), "y"))
    jobs, rows = [], []
    for label, path, shape, up in shapes:
        lit, unlit = _ours(shape, "lit"), _ours(shape, "unlit")
        theirs, flat, seen = pyrender_pictures(path, up, lit.camera)
        jobs.append({"model": str(path.resolve()), "up": up, "camera": dict(lit.camera)})
        pictures = {label: lit.color, "pyrender": theirs, "unlit": unlit.color, "pyrender, unlit": flat}
        rows.append([Cell(picture, caption) for caption, picture in pictures.items()])
        both, either = seen & (unlit.instances >= 0), seen | (unlit.instances >= 0)
        difference = np.abs(unlit.color[both].astype(int) - flat[both]).max(axis=1)
        close = (difference <= MAX_LEVELS).mean()
        yield label, f"{both.sum() / either.sum():.1%}", f"{difference.mean():.1f}", f"{close:.1%}"
    if blender is not None:
        for row, picture in zip(rows, blender_pictures(blender, jobs, folder), strict=True):
            row.insert(1, Cell(picture, "Cycles"))
    sheet = contact_sheet([Section("ours, lit, and others", rows)], name, SIDE_PIXELS)
    (folder / "sheet.png").write_bytes(picture_png(sheet))


def _run(*arguments: object) -> str:
    """Return what `python -m pipeline` prints."""
    done = subprocess.run([sys.executable, "-m", "pipeline", *map(str, arguments)], capture_output=True, text=True)
    if done.returncode:
        print(f"{arguments[0]} ended with {done.returncode}: {(done.stderr or done.stdout)[-600:]}", file=sys.stderr)
    return done.stdout


def _inspected(model: Path, folder: Path) -> Iterator[tuple[str, Shape]]:
    """Run the config of inspect; yield a caption and a shape for the first samples of each way."""
    inspected = _run("inspect", "--json", "--out", folder / "inspect", model)
    config = Path(json.loads(inspected)["files"]["config"])
    for stage in STAGES:
        _run("run", stage, "--config", config, "--out", folder, "--workers", 1)
    paths = DatasetPaths(folder, config.stem)
    shapes = {name: ProportionShapes(kit) for name, kit in dataset_kits(paths).items()}
    for stage in STAGES[2:]:
        shards = sorted(paths.stage(stage).root.glob(f"{config.stem}-train-*.tar"))
        samples = itertools.islice((sample for shard in shards for sample in read_samples(shard)), VARIANTS_A_WAY)
        for number, sample in enumerate(samples, start=1):
            of_kit = shapes[sample.kit]
            if sample.text:
                yield f"{stage} {number}", shape_of_proportion_text(of_kit, sample.text)
            else:
                yield f"{stage} {number}", kit_shape(of_kit.kit, sample.assembly)


def _variants(kit: Kit) -> Iterator[tuple[str, Shape]]:
    """Yield a caption and a shape for a few exchanges and a few other rows."""
    for number, variant in enumerate(vary(kit, VARIANTS_A_WAY, seed=1), start=1):
        yield f"exchange {number}", variant
    rng, number = np.random.default_rng(1), 0
    for exemplar in kit.exemplars:
        draws = LayoutDraws(layout_of(kit, exemplar), RowsConfig(), is_alone=True)
        for _ in range(MAX_DRAWS):
            drawn = draws.draw(rng)
            if drawn is not None and number < VARIANTS_A_WAY:
                number += 1
                yield f"rows {number}", drawn[1].shape(kit)


def _whole(scene: ModelScene, up: Any) -> Shape:
    """Return all placements of a file as parts of a shape."""
    meshes, names = [], []
    for placement in scene.placements:
        surface, turn = scene.surfaces[placement.surface], placement.pose[:3, :3]
        vertices, faces, look = surface.vertices @ turn.T + placement.pose[:3, 3], surface.faces, surface.appearance
        look = look and look.turned(turn)
        if np.linalg.det(turn) < 0.0:
            faces, look = faces[:, ::-1].copy(), look and look.mirrored()
        meshes.append(PartMesh(placement.name, vertices, faces, surface.face_colors, appearance=look))
        names.append(placement.name)
    types, edges = np.arange(len(meshes), dtype=np.int16), np.empty((0, 2), dtype=np.int32)
    assembly = Assembly(types, np.tile(np.eye(4), (len(meshes), 1, 1)), edges)
    return Shape(tuple(meshes), assembly, up, tuple(dict.fromkeys(names)), tuple(names))


def _ours(shape: Shape, lighting: str) -> Any:
    keys = {"cameras": [CAMERA], "width": SIDE_PIXELS, "height": SIDE_PIXELS, "images": ["color", "instances"]}
    (view,) = views_of(shape, **keys, color={"lighting": lighting})
    return view


if __name__ == "__main__":
    main()
