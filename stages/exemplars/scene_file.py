"""From the bytes of a model file to its parts, in the process that it is called in: `read` has one for each file."""

from __future__ import annotations

import contextlib
import difflib
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from stages.exemplars.formats.dae import read_dae
from stages.exemplars.formats.enclosure import Enclosure
from stages.exemplars.formats.gltf import read_gltf
from stages.exemplars.formats.off import read_off
from stages.exemplars.formats.ply import read_ply
from stages.exemplars.formats.scene import ModelScene, Placement, Surface, UniqueNames, plain_name, plain_text
from stages.exemplars.formats.stl import read_stl
from stages.exemplars.formats.wavefront import read_wavefront
from stages.exemplars.model import STATED_IN_CONFIG, Model, RawPart
from stages.exemplars.rigid_parts import bake_stretch, centre, distance_from_origin
from stages.exemplars.segmentation import Segmentation, count_parts, pick_segmentation, segment_scene
from stages.exemplars.settings import ReadLimits
from stages.shape.arrays import FloatArray

READERS: dict[str, Callable[[Path, Enclosure], ModelScene]] = {
    ".glb": read_gltf,
    ".gltf": read_gltf,
    ".obj": read_wavefront,
    ".ply": read_ply,
    ".stl": lambda path, _: read_stl(path),
    ".off": lambda path, _: read_off(path),
    ".dae": read_dae,
}

FARTHEST = 1e30
"""Numbers beyond this are no places: their squares and products leave the range of floats."""

SMALLEST, LARGEST = 1e-9, 1e9
"""Diagonals, in units, between which areas and their squares are numbers that can be reckoned with."""

MOST_WARNINGS = 200

FAR = 1e3
"""How many of its own diagonals a model stands from the origin when it is moved there."""

COARSE = 1e-3
"""Spacing of 32-bit floats, as a share of the median part's diagonal, at which contacts begin to be lost."""


def parse_model(path: Path, segmentation: Segmentation, limits: ReadLimits) -> Model:
    """The parts of a model file: GLB, glTF, OBJ with MTL, PLY, STL, OFF or DAE.

    Opens nothing outside the folder of `path`. Scale, shear and mirroring of the scene are in the vertices, so that
    poses are rigid. A model far from the origin is moved there, with a warning.
    Raises ConfigError, with the file, the element and the mend, for a file of which no parts can be made, and whatever
    a reader did not foresee.
    """
    scene = _read(path)
    _check_size(path, scene, limits)
    warnings = list(scene.warnings)
    if segmentation == "auto":
        source, why, parted = pick_segmentation(scene)
    else:
        source, why = segmentation, STATED_IN_CONFIG
        if source not in (scene.kind, "symmetry", "sections") and source not in (counts := count_parts(scene)):
            offered = ", ".join(f"{name} ({count})" for name, count in counts.items())
            raise ConfigError(f"{path}: has no {source} to take parts from; it has {offered}, or set `parts: auto`")
        parted = segment_scene(scene, source)
    _check_size(path, parted, limits)
    surfaces, placements = bake_stretch(*centre(parted.surfaces, parted.placements))
    offset = _off_origin(path, surfaces, placements, warnings)
    names = UniqueNames()
    parts = []
    for placement in placements:
        surface = surfaces[placement.surface]
        pose = placement.pose.copy()
        pose[:3, 3] -= offset
        parts.append(
            RawPart(
                names(placement.name),
                surface.name,
                placement.label,
                pose,
                surface.vertices,
                surface.faces,
                surface.face_colors,
            )
        )
    return Model(path, tuple(parts), source, why, _few(warnings), scene.up)


def _read(path: Path) -> ModelScene:
    """The scene in a file, once it is known to be a readable file of a known format."""
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        near = difflib.get_close_matches(path.suffix.lower(), READERS, n=1, cutoff=0.4)
        hint = f"did you mean {near[0]}? " if near else ""
        raise ConfigError(
            f"{path}: {path.suffix or 'a name without an extension'} is no model format; {hint}"
            f"Shapemill reads {', '.join(READERS)}"
        )
    if not os.access(path, os.F_OK):  # Path.exists() raises where a folder on the way may not be entered
        beside: list[str] = []
        with contextlib.suppress(OSError):
            beside = [each.name for each in path.parent.iterdir()]
        near = difflib.get_close_matches(path.name, beside, n=1)
        raise ConfigError(f"{path}: no such file" + (f"; did you mean {near[0]}?" if near else ""))
    if not path.is_file():
        raise ConfigError(f"{path}: is {'a folder' if path.is_dir() else 'no regular file'}; name one model file")
    if not os.access(path, os.R_OK):
        raise ConfigError(f"{path}: may not be read; give this user permission to read it (chmod u+r)")
    if path.stat().st_size == 0:
        raise ConfigError(f"{path}: the file is empty; copy or export it again")
    enclosure = Enclosure(path)
    try:
        scene = reader(path, enclosure)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from None
    except MemoryError:
        raise ConfigError(
            f"{path}: {enclosure.at} needs more memory than exemplars.limits.memory_mb allows; export it again, simpler"
        ) from None
    except RecursionError:
        raise ConfigError(f"{path}: {enclosure.at} nests too deeply; export it again, flatter") from None
    return _solid_placements(path, scene)


def _check_size(path: Path, scene: ModelScene, limits: ReadLimits) -> None:
    """Raise ConfigError for a scene of more parts or triangles than are read."""
    triangles = sum(len(each.faces) for each in scene.surfaces)
    for count, most, what in (
        (len(scene.placements), limits.parts, "parts"),
        (triangles, limits.triangles, "triangles"),
    ):
        if count > most:
            raise ConfigError(
                f"{path}: has {count:,} {what} and at most {most:,} are read; simplify it, or raise "
                f"exemplars.limits.{what} in the config"
            )


def _few(warnings: list[str]) -> tuple[str, ...]:
    """The first warnings, each one line that can be shown anywhere, and how many there are beyond."""
    shown = tuple(map(plain_text, warnings[:MOST_WARNINGS]))
    beyond = len(warnings) - len(shown)
    return (*shown, f"and {beyond:,} more warnings") if beyond else shown


def _solid_placements(path: Path, scene: ModelScene) -> ModelScene:
    """The scene without placements that show no triangle, and without vertices that no face uses.

    Raises ConfigError if nothing is left, or for coordinates that are not finite.
    """
    warnings = list(scene.warnings)
    surfaces = [_plainly_named(each.select(np.arange(len(each.faces)))) for each in scene.surfaces]
    broken_vertices = [int(np.count_nonzero(~(np.abs(each.vertices) <= FARTHEST).all(axis=1))) for each in surfaces]
    placements = []
    for placement in scene.placements:
        label = None if placement.label is None else plain_name(placement.label)
        placement = replace(placement, name=plain_name(placement.name), label=label)
        surface, broken = surfaces[placement.surface], broken_vertices[placement.surface]
        if broken:
            raise ConfigError(
                f"{path}: part {placement.name!r} has {broken} vertices that are not finite numbers up to "
                f"{FARTHEST:g}; mend the part in the modelling tool (delete broken vertices) and export it again"
            )
        if not (np.abs(placement.pose) <= FARTHEST).all():
            raise ConfigError(
                f"{path}: part {placement.name!r} has a transform that is not finite, or beyond {FARTHEST:g}; export "
                "it again"
            )
        if not len(surface.faces):
            warnings.append(f"part {placement.name!r} has no triangles and is left out")
        elif np.linalg.matrix_rank(placement.pose[:3, :3]) < 3:
            warnings.append(f"part {placement.name!r} is scaled to nothing along an axis and is left out")
        else:
            placements.append(placement)
    if not placements:
        reasons = f" ({'; '.join(warnings)})" if warnings else ""
        raise ConfigError(
            f"{path}: holds no triangles{reasons}; export it as a triangle mesh, or, if it is a point cloud, "
            "which has no parts, make a grammar of it: grammars.models"
        )
    used = sorted({each.surface for each in placements})
    return ModelScene(
        kind=scene.kind,
        surfaces=tuple(surfaces[index] for index in used),
        placements=tuple(replace(each, surface=used.index(each.surface)) for each in placements),
        warnings=tuple(warnings),
        up=scene.up,
    )


def _plainly_named(surface: Surface) -> Surface:
    return replace(surface, name=plain_name(surface.name), materials=tuple(map(plain_name, surface.materials)))


def _off_origin(path: Path, surfaces: list[Surface], placements: list[Placement], warnings: list[str]) -> FloatArray:
    """What is to be taken off all poses, float64 (3,): zero unless the model stands far from the origin. Raises
    ConfigError for a model that is too small or too large to be reckoned with."""
    middle, diagonal = distance_from_origin(surfaces, placements)
    if 0 < diagonal < SMALLEST or diagonal > LARGEST:
        raise ConfigError(
            f"{path}: the model is {diagonal:.2g} units across, and only sizes from {SMALLEST:g} to {LARGEST:g} can be "
            "reckoned with; scale it in the modelling tool, to metres say, and export it again"
        )
    distance = float(np.linalg.norm(middle))
    if distance <= FAR * diagonal:
        return np.zeros(3)
    spacing = float(np.spacing(np.float32(np.abs(middle).max())))
    diagonals = [float(np.linalg.norm(np.ptp(surfaces[each.surface].vertices, axis=0))) for each in placements]
    share = spacing / (float(np.median(diagonals)) or 1.0)
    advice = "; contacts may be lost, move it to the origin before the export" if share > COARSE else ""
    warnings.append(
        f"the model stands {distance:.4g} units from the origin and is moved there; 32-bit floats are {spacing:.2g} "
        f"units apart at that place, {share:.2g} of the median part{advice}"
    )
    return middle
