"""Read model files: from the bytes of a file to parts with rigid poses, in a child process with limits."""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import ConfigError
from stages.exemplars.model import Model, pack_model, unpack_model
from stages.exemplars.rigid_parts import rigid_parts
from stages.exemplars.segmentation import segment_into_parts
from stages.exemplars.settings import Segmentation
from stages.model_files.limits import ReadLimits
from stages.model_files.read import read_bounded
from stages.model_files.scene_file import check_size, first_warnings, read_scene


def read_parts(path: Path, segmentation: Segmentation = "auto", limits: ReadLimits | None = None) -> Model:
    """Return the parts of a model file, cut as `segmentation` says; as `parse_parts`.

    Raises ConfigError, with the file, the element and the remedy, for a file without usable parts, whatever it did
    to the child process, and for one that takes more than `limits`.
    """
    limits = limits or ReadLimits()
    content = read_bounded(path, lambda: pack_model(parse_parts(path, segmentation, limits)), limits)
    try:
        return unpack_model(path, content)
    except ValueError:
        raise ConfigError(f"{path}: cannot be read: its parts are no meshes; export it again") from None


def parse_parts(path: Path, segmentation: Segmentation, limits: ReadLimits) -> Model:
    """Return the parts of a model file, in the calling process.

    Opens nothing outside the folder of `path`. Scale, shear and mirroring of the scene move into the vertices, so that
    poses are rigid. A model far from the origin is moved there, with a warning. Raises ConfigError, with the file, the
    element and the remedy, for a file without usable parts, and any error that a reader did not foresee.
    """
    scene = read_scene(path)
    check_size(path, scene, limits)
    segmented, source, why = segment_into_parts(path, scene, segmentation)
    check_size(path, segmented, limits)
    parts, warnings = rigid_parts(path, segmented)
    return Model(path, parts, source, why, first_warnings([*scene.warnings, *warnings]), scene.up, scene.unit)
