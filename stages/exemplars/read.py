"""Read model files: from the bytes of a file to parts with rigid poses, in a child process with limits."""

from __future__ import annotations

from pathlib import Path

from pipeline.bounded import ChildFailed, in_child
from pipeline.errors import ConfigError
from stages.exemplars.model import Model, pack_model, unpack_model
from stages.exemplars.rigid_parts import rigid_parts
from stages.exemplars.scene_file import check_size, first_warnings, read_scene
from stages.exemplars.segmentation import segment_into_parts
from stages.exemplars.settings import ReadLimits, Segmentation


def read_model(path: Path, segmentation: Segmentation = "auto", limits: ReadLimits | None = None) -> Model:
    """Return the parts of a model file: GLB, glTF, OBJ with MTL, PLY, STL, OFF or DAE; as `parse_model`.

    Raises ConfigError, with the file, the element and the remedy, for a file without usable parts, whatever it did
    to the child process, and for one that takes more than `limits`.
    """
    limits = limits or ReadLimits()
    try:
        content = in_child(
            lambda: pack_model(parse_model(path, segmentation, limits)),
            cpu_seconds=limits.cpu_seconds,
            memory_mb=limits.memory_mb,
            refusal=ConfigError,
        )
        return unpack_model(path, content)
    except ChildFailed as error:
        raise ConfigError(
            f"{path}: cannot be read: {error}; export it again, simpler if it is large, or raise exemplars.limits in "
            "the config"
        ) from None
    except ValueError:
        raise ConfigError(f"{path}: cannot be read: its parts are no meshes; export it again") from None


def parse_model(path: Path, segmentation: Segmentation, limits: ReadLimits) -> Model:
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
    return Model(path, parts, source, why, first_warnings([*scene.warnings, *warnings]), scene.up)
