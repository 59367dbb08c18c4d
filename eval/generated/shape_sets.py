"""Sets of shapes as clouds: a split of a dataset, its exemplars, a folder of models, or an array."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from eval.engine.dataset_run import DatasetRun
from eval.engine.shapes import split_shapes
from pipeline.display import ticking
from pipeline.errors import ConfigError
from pipeline.randomness import decision_rng
from stages.model_files.read import read_model
from stages.model_files.scene_file import READERS
from stages.package.layout import MANIFEST
from stages.points.area_sampling import sample_shape, sample_surface
from stages.shape.arrays import FloatArray
from stages.shape.collection.assignment import SPLITS
from stages.shape.input_file import without_sidecars
from stages.shape.shape import Shape

_KINDS_OF_SETS = "a folder of models, the folder of a dataset, or an .npy file of clouds"

Sampler = Callable[[np.random.Generator], FloatArray]
"""Samples the cloud of a shape, float64 (n, 3)."""


def clouds_of_set(name: str, run: DatasetRun, kit: str, max_shapes: int, points: int) -> FloatArray:
    """Return the clouds of a split of a dataset, of its exemplars, or of a path, float64 (n, points, 3), y up.

    kit: only shapes of this kit; empty for all. Raises ConfigError for an unknown name, and for fewer than two shapes.
    """
    if name in SPLITS:
        shapes = (
            (key, _points_of(shape, points))
            for shape_kit, split, key, shape in split_shapes(run.folder)
            if split == name and kit in ("", shape_kit)
        )
        return _selected(name, shapes, max_shapes)
    if name == "exemplars":
        return _selected(name, _exemplars(run, kit, points), max_shapes)
    if not Path(name).exists():
        raise ConfigError(f"{name} does not exist; name {', '.join(SPLITS)}, exemplars, {_KINDS_OF_SETS}")
    return clouds_of_path(Path(name), max_shapes, points)


def clouds_of_path(path: Path, max_shapes: int, points: int) -> FloatArray:
    """Return the clouds of a dataset, a folder of models, or an array (n, k, 3), float64 (n, points, 3), y up.

    Raises ConfigError for any other path, and for fewer than two shapes.
    """
    if not path.exists():
        raise ConfigError(f"{path} does not exist; name {_KINDS_OF_SETS}")
    if path.suffix == ".npy" and path.is_file():
        return _from_array(path, max_shapes, points)
    if (path / MANIFEST).is_file():
        shapes = ((key, _points_of(shape, points)) for _, _, key, shape in split_shapes(path))
        return _selected(str(path), shapes, max_shapes)
    if not path.is_dir():
        raise ConfigError(f"{path} is no set of shapes; name {_KINDS_OF_SETS}")
    files, _ = without_sidecars(sorted(file for file in path.rglob("*") if file.suffix.lower() in READERS))
    samplers = ((str(file.relative_to(path)), _points_of_file(file, points)) for file in files)
    return _selected(str(path), samplers, max_shapes)


def _points_of(shape: Shape, points: int) -> Sampler:
    return lambda rng: sample_shape(shape, points, rng).points


def _points_of_file(file: Path, points: int) -> Sampler:
    def sample(rng: np.random.Generator) -> FloatArray:
        scene = read_model(file)
        vertices, faces, start = [], [], 0
        for placement in scene.placements:
            surface = scene.surfaces[placement.surface]
            vertices.append(surface.vertices @ placement.pose[:3, :3].T + placement.pose[:3, 3])
            faces.append(surface.faces + start)
            start += len(surface.vertices)
        try:
            return sample_surface(np.concatenate(vertices), np.concatenate(faces), points, rng)[0]
        except ValueError as error:
            raise ConfigError(f"{file}: {error}; leave it out or repair it") from None

    return sample


def _exemplars(run: DatasetRun, kit: str, points: int) -> Iterable[tuple[str, Sampler]]:
    from stages.exemplars.language import dataset_kits
    from stages.shape.shape import kit_shape

    for name, source in dataset_kits(run.paths).items():
        if kit in ("", name):
            for index, exemplar in enumerate(source.exemplars):
                yield f"{name}-{index}", _points_of(kit_shape(source, exemplar.assembly), points)


def _selected(name: str, samplers: Iterable[tuple[str, Sampler]], max_shapes: int) -> FloatArray:
    """Sample a cloud of `max_shapes` shapes, which are chosen by their keys alone."""
    clouds: dict[tuple[float, int], FloatArray] = {}
    with ticking("eval", f"sampling the shapes of {name}"):
        for index, (key, sampler) in enumerate(samplers):
            rng = decision_rng(0, "generation", key, index)
            rank = (rng.random(), index)
            if len(clouds) < max_shapes or rank < max(clouds):
                clouds[rank] = sampler(rng)
            if len(clouds) > max_shapes:
                del clouds[max(clouds)]
    return _enough(name, np.array([clouds[rank] for rank in sorted(clouds)], dtype=np.float64))


def _from_array(path: Path, max_shapes: int, points: int) -> FloatArray:
    array = np.load(path, allow_pickle=False)
    if array.ndim != 3 or array.shape[2] != 3 or array.shape[1] < points or not np.isfinite(array).all():
        raise ConfigError(
            f"{path} has the shape {array.shape}; clouds are (n, k, 3), finite, with k >= {points} points"
        )
    rng = decision_rng(0, "generation", path.name)
    chosen = np.sort(rng.permutation(len(array))[:max_shapes])
    return _enough(str(path), array[chosen][:, rng.permutation(array.shape[1])[:points]].astype(np.float64))


def _enough(name: str, clouds: FloatArray) -> FloatArray:
    if len(clouds) < 2:
        raise ConfigError(f"{name} holds {len(clouds)} shapes; a comparison of sets needs at least 2")
    return clouds
