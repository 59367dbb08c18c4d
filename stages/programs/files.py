"""Shapes of programs as files: parameters from JSON, shapes as GLB."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from stages.programs.draws import Share
from stages.programs.parameters import ParameterError, Value
from stages.programs.program import Program, build_shape
from stages.programs.sampling import Sampler
from stages.programs.schema import Values
from stages.shape.arrays import FloatArray
from stages.shape.views.palette import srgb_to_linear

PLACED_NODE = "placed"
"""Name of the node that moves a whole shape."""


def named_values(program: Program, name: str) -> dict[str, Value]:
    """The values that a command line names: `base`, the seed of a random shape, or a JSON file.

    The file holds parameters, at its top level or, as `make recover` writes it, under `parameters`. Raises ConfigError
    with the file and the parameter for a file that is missing or gives no valid shape.
    """
    if name == "base":
        return program.schema.canonical(program.schema.base)[0]
    if name.isdecimal():
        return random_shapes(program, 1, int(name))[0]
    try:
        values = program.schema.from_text(_parameters(program, Path(name).read_text(encoding="utf-8")))
    except OSError as error:
        raise ConfigError(f"{name}: {error.strerror}; give a JSON file of parameters, a seed, or base") from error
    except (ParameterError, UnicodeDecodeError) as error:
        raise ConfigError(f"{name}: {error}") from error
    for constraint in program.violated(values):
        raise ConfigError(f"{name}: a {program.name} needs {constraint.condition.text}: {constraint.description}")
    return values


def _parameters(program: Program, text: str) -> str:
    """The JSON of the parameters in the text of a file. Raises ParameterError for those of another program."""
    try:
        given = json.loads(text)
    except (json.JSONDecodeError, RecursionError):
        return text  # the schema reports what is wrong with it
    if not isinstance(given, dict) or not isinstance(given.get("parameters"), dict):
        return text
    if given.get("program", program.name) != program.name:
        raise ParameterError(f"these are parameters of {given['program']!r}, not of {program.name}")
    return json.dumps(given["parameters"])


def random_shapes(program: Program, count: int, seed: int) -> list[dict[str, Value]]:
    """Draw values of `count` different random valid shapes."""
    sampler = Sampler(program, Share(), off_grid=False)
    rng = np.random.default_rng(seed)
    return [sampler.find(None, rng) for _ in range(count)]


def shape_glb(program: Program, values: Values, placement: FloatArray | None = None) -> bytes:
    """The shape at `values` as GLB: one node per part at its pose, named by label and number, in its colour.

    placement: float64 (4, 4), moves all parts by a node above them; scaling and rotating, without mirroring.
    """
    import trimesh

    shape = build_shape(program, values)
    scene = trimesh.Scene()
    parent = None
    if placement is not None:
        parent = PLACED_NODE
        scene.graph.update(frame_to=parent, matrix=placement)
    for name, mesh, pose in zip(shape.part_names, shape.meshes, shape.assembly.poses, strict=True):
        color = np.append(srgb_to_linear(mesh.face_colors[0]), 1.0)
        material = trimesh.visual.material.PBRMaterial(baseColorFactor=color, metallicFactor=0.0, roughnessFactor=0.7)
        visual = trimesh.visual.TextureVisuals(material=material)
        part = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False, visual=visual)
        scene.add_geometry(part, node_name=name, geom_name=name, parent_node_name=parent, transform=pose)
    glb: bytes = scene.export(file_type="glb")
    return glb
