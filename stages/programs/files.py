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
from stages.shape.views.palette import srgb_to_linear


def named_values(program: Program, name: str) -> dict[str, Value]:
    """The values that a command line means: `base`, a whole number for the random shape of that seed, or a JSON file:
    of parameters, or one that `make recover` has written, which holds them under `parameters`.

    Raises ConfigError, which names the file and the parameter, for one that is not there or says no shape.
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
    broken = program.violated(values)
    if broken:
        raise ConfigError(f"{name}: a {program.name} needs {broken[0].condition.text}: {broken[0].description}")
    return values


def _parameters(program: Program, text: str) -> str:
    """The object of parameters in the text of a file. Raises ParameterError for that of another program."""
    try:
        said = json.loads(text)
    except (json.JSONDecodeError, RecursionError):
        return text  # the schema says what is wrong with it
    if not isinstance(said, dict) or not isinstance(said.get("parameters"), dict):
        return text
    if said.get("program", program.name) != program.name:
        raise ParameterError(f"these are parameters of {said['program']!r}, not of {program.name}")
    return json.dumps(said["parameters"])


def random_shapes(program: Program, count: int, seed: int) -> list[dict[str, Value]]:
    """Values of `count` random valid shapes, no two alike."""
    sampler = Sampler(program, Share(), off_grid=False)
    rng = np.random.default_rng(seed)
    return [sampler.find(None, rng) for _ in range(count)]


def shape_glb(program: Program, values: Values) -> bytes:
    """The shape at `values` as GLB: a node a part at its pose, named by label and number, in its colour."""
    import trimesh

    shape = build_shape(program, values)
    scene = trimesh.Scene()
    for name, mesh, pose in zip(shape.part_names, shape.meshes, shape.assembly.poses, strict=True):
        color = np.append(srgb_to_linear(mesh.face_colors[0]), 1.0)
        material = trimesh.visual.material.PBRMaterial(baseColorFactor=color, metallicFactor=0.0, roughnessFactor=0.7)
        visual = trimesh.visual.TextureVisuals(material=material)
        part = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False, visual=visual)
        scene.add_geometry(part, node_name=name, geom_name=name, transform=pose)
    glb: bytes = scene.export(file_type="glb")
    return glb
