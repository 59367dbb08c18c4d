"""Reading exemplars: each model file in a process of its own, which may take so much and no more."""

from __future__ import annotations

from pathlib import Path

from pipeline.bounded import ChildFailed, in_child
from pipeline.errors import ConfigError
from stages.exemplars.model import Model, pack_model, unpack_model
from stages.exemplars.scene_file import parse_model
from stages.exemplars.segmentation import Segmentation
from stages.exemplars.settings import ReadLimits


def read_model(path: Path, segmentation: Segmentation = "auto", limits: ReadLimits | None = None) -> Model:
    """The parts of a model file: GLB, glTF, OBJ with MTL, PLY, STL, OFF or DAE; as `parse_model`.

    Raises ConfigError, with the file, the element and the mend, for a file of which no parts can be made, whatever it
    did to the process that read it, and for one that takes more than `limits`.
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
