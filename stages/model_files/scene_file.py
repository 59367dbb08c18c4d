"""Read the scene of a model file: surfaces and their placements, checked and without what shows no triangle."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from stages.model_files.dae import read_dae
from stages.model_files.enclosure import Enclosure
from stages.model_files.gltf import read_gltf
from stages.model_files.limits import ReadLimits
from stages.model_files.off import read_off
from stages.model_files.ply import read_ply
from stages.model_files.scene import ModelScene, Placement, SceneNode, Surface, plain_name, plain_text
from stages.model_files.stl import read_stl
from stages.model_files.wavefront import read_wavefront
from stages.shape.input_file import check_input_file

READERS: dict[str, Callable[[Path, Enclosure], ModelScene]] = {
    ".glb": read_gltf,
    ".gltf": read_gltf,
    ".obj": read_wavefront,
    ".ply": read_ply,
    ".stl": lambda path, _: read_stl(path),
    ".off": lambda path, _: read_off(path),
    ".dae": read_dae,
}

MAX_COORDINATE = 1e30
"""Larger numbers are no positions: their squares and products leave the range of floats."""
MAX_WARNINGS_SHOWN = 200


def read_scene(path: Path) -> ModelScene:
    """Return the scene of a model file, once it is known to be a readable file of a known format.

    Raises ConfigError, with the file, the element and the remedy.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        near = difflib.get_close_matches(path.suffix.lower(), READERS, n=1, cutoff=0.4)
        hint = f"did you mean {near[0]}? " if near else ""
        raise ConfigError(
            f"{path}: {path.suffix or 'a name without an extension'} is no model format; {hint}"
            f"Shapemill reads {', '.join(READERS)}"
        )
    check_input_file(path)
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


def check_size(path: Path, scene: ModelScene, limits: ReadLimits) -> None:
    """Raise ConfigError for a scene with more parts or triangles than `limits` allow."""
    triangles = sum(len(surface.faces) for surface in scene.surfaces)
    for count, limit, what in (
        (len(scene.placements), limits.parts, "parts"),
        (triangles, limits.triangles, "triangles"),
    ):
        if count > limit:
            raise ConfigError(
                f"{path}: has {count:,} {what} and at most {limit:,} are read; simplify it, or raise "
                f"exemplars.limits.{what} in the config"
            )


def first_warnings(warnings: Sequence[str]) -> tuple[str, ...]:
    """Return the first warnings, each one printable line, and how many more there are."""
    shown = tuple(map(plain_text, warnings[:MAX_WARNINGS_SHOWN]))
    more = len(warnings) - len(shown)
    return (*shown, f"and {more:,} more warnings") if more else shown


def _solid_placements(path: Path, scene: ModelScene) -> ModelScene:
    """Return the scene without placements that show no triangle, and without unused vertices.

    Raises ConfigError if nothing is left, or for coordinates that are not finite.
    """
    warnings = list(scene.warnings)
    surfaces = [_plainly_named(surface.select(np.arange(len(surface.faces)))) for surface in scene.surfaces]
    broken_vertices = [
        int(np.count_nonzero(~(np.abs(surface.vertices) <= MAX_COORDINATE).all(axis=1))) for surface in surfaces
    ]
    placements = []
    for placement in scene.placements:
        label = None if placement.label is None else plain_name(placement.label)
        placement = replace(placement, name=plain_name(placement.name), label=label)
        surface, broken = surfaces[placement.surface], broken_vertices[placement.surface]
        if broken:
            raise ConfigError(
                f"{path}: part {placement.name!r} has {broken} vertices that are not finite numbers up to "
                f"{MAX_COORDINATE:g}; mend the part in the modelling tool (delete broken vertices) and export it again"
            )
        if not (np.abs(placement.pose) <= MAX_COORDINATE).all():
            raise ConfigError(
                f"{path}: part {placement.name!r} has a transform that is not finite, or beyond {MAX_COORDINATE:g}; "
                "export it again"
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
    used = sorted({placement.surface for placement in placements})
    number_of = {surface: number for number, surface in enumerate(used)}
    nodes, row_of = _used_nodes(scene.nodes, placements)
    return replace(
        scene,
        surfaces=tuple(surfaces[index] for index in used),
        placements=tuple(
            replace(
                placement,
                surface=number_of[placement.surface],
                node=None if placement.node is None else row_of[placement.node],
            )
            for placement in placements
        ),
        warnings=tuple(warnings),
        nodes=nodes,
    )


def _used_nodes(
    nodes: tuple[SceneNode, ...], placements: list[Placement]
) -> tuple[tuple[SceneNode, ...], dict[int, int]]:
    """Return the nodes at and above the placements, with plain names, and the new row of each."""
    used: set[int] = set()
    for placement in placements:
        row = -1 if placement.node is None else placement.node
        while row >= 0 and row not in used:
            used.add(row)
            row = nodes[row].parent
    row_of = {row: number for number, row in enumerate(sorted(used))}
    kept = [nodes[row] for row in sorted(used)]
    return tuple(SceneNode(plain_name(node.name), row_of.get(node.parent, -1)) for node in kept), row_of


def _plainly_named(surface: Surface) -> Surface:
    look = surface.appearance
    if look is not None:
        look = replace(
            look, materials=tuple(replace(material, name=plain_name(material.name)) for material in look.materials)
        )
    materials = tuple(map(plain_name, surface.materials))
    return replace(surface, name=plain_name(surface.name), materials=materials, appearance=look)
