"""Read model files: from the bytes of a file to parts with rigid poses, in a child process with limits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from stages.exemplars.model import Model, pack_model, unpack_model
from stages.exemplars.rigid_parts import rigid_parts
from stages.exemplars.segmentation import CUTS, segment_into_parts
from stages.exemplars.settings import METRES, Segmentation, Units
from stages.model_files.kept_appearance import keep_appearance
from stages.model_files.limits import ReadLimits
from stages.model_files.read import ReadFailed, read_bounded
from stages.model_files.scene import ModelScene
from stages.model_files.scene_file import check_size, first_warnings, read_scene


def read_parts(
    path: Path,
    segmentation: Segmentation = "auto",
    limits: ReadLimits | None = None,
    units: Units = "auto",
    texture_size: int | None = None,
) -> Model:
    """Return the parts of a model file, cut as `segmentation` says; as `parse_parts`.

    Where `auto` fails on a file that can be read without cutting one mesh by its symmetries, the model is that one,
    with a warning. Raises ConfigError, with the file, the element and the remedy, for a file without usable parts,
    whatever it did to the child process, and for one that takes more than `limits`; and, with the name of the cut, for
    a stated cut that fails.
    """
    limits = limits or ReadLimits()
    try:
        return _read_in_child(path, segmentation, limits, units, texture_size)
    except ReadFailed as error:
        if segmentation not in ("auto", *CUTS):
            raise
        reason = error.reason
    model = _read_in_child(path, "auto", limits, units, texture_size, may_cut=False)
    if segmentation == "auto":
        warning = f"cutting it by symmetry failed: {reason}; its parts are taken in other ways"
        return replace(model, warnings=first_warnings([*model.warnings, warning]))
    raise ConfigError(
        f"{path}: the file can be read, but `parts: {segmentation}` failed: {reason}; set `parts: auto` or another "
        "source of parts, or raise exemplars.limits in the config"
    )


def _read_in_child(
    path: Path,
    segmentation: Segmentation,
    limits: ReadLimits,
    units: Units,
    texture_size: int | None,
    may_cut: bool = True,
) -> Model:
    def read() -> bytes:
        return pack_model(parse_parts(path, segmentation, limits, units, texture_size, may_cut))

    content = read_bounded(path, read, limits)
    try:
        return unpack_model(path, content)
    except ValueError:
        raise ConfigError(f"{path}: cannot be read: its parts are no meshes; export it again") from None


def parse_parts(
    path: Path,
    segmentation: Segmentation,
    limits: ReadLimits,
    units: Units = "auto",
    texture_size: int | None = None,
    may_cut: bool = True,
) -> Model:
    """Return the parts of a model file, in the calling process; in metres if `units` or the file states the unit.

    texture_size: largest side of textures, in pixels; None leaves colours of faces alone.
    may_cut: whether `auto` may cut one mesh by its symmetries.

    Opens nothing outside the folder of `path`. Scale, shear and mirroring of the scene move into the vertices, so that
    poses are rigid. A model far from the origin is moved there, with a warning. Raises ConfigError, with the file, the
    element and the remedy, for a file without usable parts, and any error that a reader did not foresee.
    """
    scene = _in_metres(keep_appearance(read_scene(path), texture_size), units)
    check_size(path, scene, limits)
    segmented, source, why = segment_into_parts(path, scene, segmentation, may_cut)
    check_size(path, segmented, limits)
    parts, warnings = rigid_parts(path, segmented)
    return Model(
        *(path, parts, source, why, first_warnings([*scene.warnings, *warnings])),
        *(scene.up, scene.unit, scene.nodes, scene.writer),
    )


def _in_metres(scene: ModelScene, units: Units) -> ModelScene:
    """Return the scene scaled to metres; as it is if nobody states its unit."""
    unit = scene.unit if units == "auto" else METRES[units]
    if unit is None or unit == 1.0:
        return replace(scene, unit=unit)
    scale = np.ones((4, 4))
    scale[:3, 3] = unit
    return replace(
        scene,
        surfaces=tuple(replace(surface, vertices=unit * surface.vertices) for surface in scene.surfaces),
        placements=tuple(replace(placement, pose=scale * placement.pose) for placement in scene.placements),
        unit=1.0,
    )
