"""Read model files, each in a child process with limits: every part of the project that takes a mesh reads it here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from pipeline.bounded import ChildFailed, in_child
from pipeline.errors import ConfigError
from stages.model_files.kept_appearance import keep_appearance
from stages.model_files.limits import ReadLimits
from stages.model_files.packing import pack_scene, unpack_scene
from stages.model_files.scene import ModelScene
from stages.model_files.scene_file import check_size, first_warnings, read_scene


class ReadFailed(ConfigError):
    """The child process that read a file gave no answer.

    reason: why, as the end of a sentence about the file
    """

    def __init__(self, path: Path, reason: str) -> None:
        self.reason = reason
        super().__init__(
            f"{path}: cannot be read: {reason}; export it again, simpler if it is large, or raise exemplars.limits in "
            "the config"
        )


def read_model(path: Path, limits: ReadLimits | None = None, texture_size: int | None = None) -> ModelScene:
    """Return the scene of a model file: GLB, glTF, OBJ with MTL, PLY, STL, OFF or DAE.

    texture_size: largest side of textures, in pixels; None leaves colours of faces alone

    Its placements are the nodes or objects of the file, each with its surface, world matrix and name, in file order.
    No placement lacks triangles, and all coordinates are finite. Opens nothing outside the folder of `path`. Raises
    ConfigError, with the file, the element and the remedy, for a file without triangles, whatever it did to the child
    process, and for one that takes more than `limits`.
    """
    limits = limits or ReadLimits()

    def read() -> bytes:
        scene = keep_appearance(read_scene(path), texture_size)
        check_size(path, scene, limits)
        return pack_scene(replace(scene, warnings=first_warnings(scene.warnings)))

    content = read_bounded(path, read, limits)
    try:
        return unpack_scene(content)[0]
    except ValueError:
        raise ConfigError(f"{path}: cannot be read: its parts are no meshes; export it again") from None


def read_bounded(path: Path, read: Callable[[], bytes], limits: ReadLimits) -> bytes:
    """Return what `read` makes of the file `path`, in a child process with limits.

    Raises ReadFailed, with the remedy, whatever happens to the child process, and ConfigError where `read` does.
    """
    try:
        return in_child(read, cpu_seconds=limits.cpu_seconds, memory_mb=limits.memory_mb, refusal=ConfigError)
    except ChildFailed as error:
        raise ReadFailed(path, str(error)) from None
