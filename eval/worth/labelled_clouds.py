"""Clouds with the part of each point: of finished datasets, and of real shapes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import islice
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pipeline.errors import ConfigError, Rejected
from stages.exemplars.read import read_parts
from stages.exemplars.segmentation import CUTS
from stages.exemplars.settings import Segmentation
from stages.model_files.read import ReadFailed
from stages.package.reader import Dataset
from stages.points.area_sampling import sample_shape, sample_surface
from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import transform_points
from stages.shapeassembly.extraction.readers.child_process import read_grass_in_child
from stages.shapeassembly.shape import shape_of_program_text
from stages.shapeassembly.sources import program_texts
from stages.training.point_encoder.clouds import LabelledClouds

Z_UP_TO_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def labelled_dataset_clouds(folder: Path, shapes: int, points: int, rng: np.random.Generator) -> LabelledClouds:
    """Return clouds of at most `shapes` random training shapes of a finished dataset.

    Raises ConfigError for a folder without dataset, and for a dataset without clouds.
    """
    dataset = Dataset.open(folder)
    total = int(dataset.manifest["splits"]["train"])
    chosen = set(rng.permutation(total)[:shapes].tolist())
    samples = (sample for index, sample in enumerate(dataset.samples("train")) if index in chosen)
    try:
        return LabelledClouds.of(((sample.points, sample.instances) for sample in samples), points, rng)
    except KeyError as error:
        raise ConfigError(f"{folder}: {error.args[0]}; leave out `points: false` in its config") from error


def program_clouds(
    archive: Path, category: str, split: str, shapes: int, points: int, rng: np.random.Generator
) -> LabelledClouds:
    """Return clouds of at most `shapes` random shapes of the published ShapeAssembly programs.

    archive: folder or tar archive with `data/<category>/<id>.txt` and `data_splits/<category>/<split>.txt`.
    """
    texts = _texts(archive, f"data/{category}")
    names = _texts(archive, f"data_splits/{category}")[f"data_splits/{category}/{split}.txt"].split()
    chosen = [names[index] for index in rng.permutation(len(names))[:shapes].tolist()]
    clouds = (sample_shape(shape_of_program_text(texts[f"data/{category}/{name}.txt"]), points, rng) for name in chosen)
    return LabelledClouds.of(((cloud.points, cloud.instances) for cloud in clouds), points, rng)


@cache
def _texts(archive: Path, folder: str) -> dict[str, str]:
    """Return the texts below a folder by name; a compressed archive takes seconds to read."""
    return dict(program_texts(archive, folder))


def grass_clouds(path: Path, shapes: int, points: int, rng: np.random.Generator) -> LabelledClouds:
    """Return clouds of at most `shapes` random shapes of a GRASS file; shapes with invalid boxes are left out."""
    from eval.programs.quality import shape_of_boxes

    file = read_grass_in_child(path)

    def clouds() -> Iterator[tuple[FloatArray, npt.NDArray[np.int16]]]:
        for index in rng.permutation(len(file)).tolist():
            try:
                shape = shape_of_boxes([leaf.box for leaf in file.shape(index).root.leaves()])
            except (Rejected, ConfigError):
                continue
            cloud = sample_shape(shape, points, rng)
            yield cloud.points, cloud.instances

    return LabelledClouds.of(islice(clouds(), shapes), points, rng)


@dataclass(frozen=True)
class SkippedModels:
    """Models without use as labelled shapes: how many cannot be read, and how many have one part or none stated."""

    unreadable: int
    without_parts: int


def model_clouds(
    files: Sequence[Path], segmentation: Segmentation, shapes: int, points: int, rng: np.random.Generator
) -> tuple[LabelledClouds, SkippedModels]:
    """Return clouds of at most `shapes` random models, and how many others were skipped on the way.

    Parts are objects, nodes, materials, colours or components, as the segmentation says; others are skipped.
    """
    unreadable, without_parts = 0, 0

    def clouds() -> Iterator[tuple[FloatArray, npt.NDArray[np.int64]]]:
        nonlocal unreadable, without_parts
        for index in rng.permutation(len(files)).tolist():
            try:
                model = read_parts(files[index], segmentation)
            except (ConfigError, ReadFailed):
                unreadable += 1
                continue
            if len(model.parts) < 2 or model.segmentation in CUTS:
                without_parts += 1
                continue
            placed = [transform_points(part.pose, part.vertices) for part in model.parts]
            starts = np.cumsum([0, *map(len, placed[:-1])])
            faces = [part.faces + start for part, start in zip(model.parts, starts, strict=True)]
            part_of_face = np.repeat(np.arange(len(faces)), [len(corners) for corners in faces])
            mesh = np.concatenate(placed), np.concatenate(faces).astype(np.int32)
            try:
                cloud, _, hit = sample_surface(*mesh, points, rng)
            except ValueError:  # it has no area
                unreadable += 1
                continue
            yield cloud @ Z_UP_TO_Y_UP.T if model.up == "z" else cloud, part_of_face[hit]

    return LabelledClouds.of(islice(clouds(), shapes), points, rng), SkippedModels(unreadable, without_parts)
