"""Do engines agree on what falls? The record's `falls` and `stable` against MuJoCo, on shapes of several producers.

    python -m tests.bench.engine_falls --generated --programs ../shared/shapeassembly --count 300 datasets/mixed

A shape is dropped: its connected pieces are rigid bodies of convex parts. It rests for a second. Then gravity is
tilted by a push of FALL_PUSH in each of eight directions for a second, and upright again until it rests. It falls if
the centre of mass of a piece has risen or sunk by FALL_SHARE. The table says how often the verdicts agree, and how many
of the falling ones are caught. `--disagreements FOLDER` draws the shapes on which they differ.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stages.export.mjcf import mjcf_files
from stages.export.model import simulation_model
from stages.export.settings import ExportSettings
from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.bounds import shape_bounds
from stages.shape.physics.judge import Judge
from stages.shape.physics.settings import PhysicsConfig
from stages.shape.physics.settling import FALL_PUSH, FALL_SHARE, Fall
from stages.shape.shape import Shape, upright

DIRECTION_COUNT = 8
REST_SECONDS, PUSH_SECONDS, RETURN_SECONDS = 1.0, 1.0, 2.0
STEP_SECONDS = 0.004
METRES_PER_SQUARE_SECOND = 9.81
PHYSICS = """<option timestep="{step}" integrator="implicitfast" cone="elliptic"/>
  <default><geom friction="1 0.005 0.0001"/></default>"""
GROUND = '<worldbody><geom name="ground" type="plane" size="0 0 1"/>'


@dataclass(frozen=True)
class Verdicts:
    """What is said of one shape.

    stable, falls: as in its record
    fall: the tilt that it bears, and the piece
    engine: whether it falls in MuJoCo
    """

    name: str
    shape: Shape
    stable: bool
    fall: Fall
    engine: bool


def falls_in_mujoco(shape: Shape, connected: IntArray) -> bool:
    """Return whether an upright shape, dropped and pushed, comes to rest at another height in MuJoCo.

    connected: pairs of parts that hold together, int32 (m, 2)
    """
    import mujoco

    low, high = shape_bounds(shape)
    settings = ExportSettings(links="bodies", scale=1.0 / float(np.linalg.norm(high - low)))
    files = mjcf_files(simulation_model("shape", shape, connected, settings))
    text = files["shape.xml"].decode()
    text = text.replace("<worldbody>", PHYSICS.format(step=STEP_SECONDS) + GROUND, 1)
    text = re.sub(r' meshdir="[^"]*"', "", text)
    meshes = {Path(name).name: content for name, content in files.items() if name.endswith(".obj")}
    model = mujoco.MjModel.from_xml_string(text, meshes)
    state = mujoco.MjData(model)
    mujoco.mj_forward(model, state)
    start = _heights(model, state)
    _run(model, state, 0.0, 0.0, REST_SECONDS)
    if _moved(start, _heights(model, state)):
        return True
    rest = state.qpos.copy()
    for azimuth in 2 * np.pi * np.arange(DIRECTION_COUNT) / DIRECTION_COUNT:
        mujoco.mj_resetData(model, state)
        state.qpos[:] = rest
        _run(model, state, FALL_PUSH, azimuth, PUSH_SECONDS)
        _run(model, state, 0.0, 0.0, RETURN_SECONDS)
        if _moved(start, _heights(model, state)):
            return True
    return False


def _run(model, state, push: float, azimuth: float, seconds: float) -> None:  # type: ignore[no-untyped-def]
    import mujoco

    model.opt.gravity[:] = METRES_PER_SQUARE_SECOND * np.array([push * np.cos(azimuth), push * np.sin(azimuth), -1.0])
    mujoco.mj_step(model, state, round(seconds / STEP_SECONDS))


def _heights(model, state) -> FloatArray:  # type: ignore[no-untyped-def]
    """Return the height of the centre of mass of each piece: each is one body, without joints between parts."""
    import mujoco

    mujoco.mj_kinematics(model, state)
    mujoco.mj_comPos(model, state)
    roots = np.flatnonzero(model.body_parentid[1:] == 0) + 1
    heights: FloatArray = state.subtree_com[roots, 2].copy()
    return heights


def _moved(start: FloatArray, now: FloatArray) -> bool:
    return bool((np.abs(now - start) > FALL_SHARE * start).any())


def verdicts(name: str, shape: Shape, config: PhysicsConfig) -> Verdicts:
    """Return what the record and MuJoCo say of a shape."""
    shape = upright(shape)
    judge = Judge(shape.meshes, shape.up, config)
    validity = judge.validity(shape.assembly)
    fall = judge.fall(shape.assembly, validity.joints)
    return Verdicts(name, shape, validity.stable, fall, falls_in_mujoco(shape, validity.joints))


def program_shapes(folder: Path, count: int) -> Iterator[tuple[str, Shape]]:
    """Yield `count` published ShapeAssembly programs, a third of each category, with their category and number."""
    from stages.shapeassembly.shape import shape_of_text
    from stages.shapeassembly.sources import program_texts

    for category in ("chair", "table", "storage"):
        texts = sorted(program_texts(folder / "programs.tar.xz", f"data/{category}"))
        for place in np.random.default_rng(49).permutation(len(texts))[: count // 3].tolist():
            name, text = texts[place]
            yield f"{category} {Path(name).stem}", shape_of_text(text)


def generated_shapes(count: int) -> Iterator[tuple[str, Iterator[tuple[str, Shape]]]]:
    """Yield the shapes of producers that need no search, `count` of each, under the producer's name."""
    yield "curve programs", _curve_shapes(count)
    yield "compositions of solids", _solid_shapes(count)
    yield "random ShapeAssembly programs", _random_program_shapes(count)
    yield "variants of kits", _kit_shapes(count)


def _curve_shapes(count: int) -> Iterator[tuple[str, Shape]]:
    from stages.programs.files import random_shapes
    from stages.programs.program import build_shape, find_program

    for name in ("chair", "table", "cabinet", "vase"):
        program = find_program(name)
        for index, values in enumerate(random_shapes(program, count // 4, seed=49)):
            yield f"{name} {index}", build_shape(program, values)


def _solid_shapes(count: int) -> Iterator[tuple[str, Shape]]:
    from stages.primitives.compose import compose
    from stages.primitives.settings import PrimitivesConfig
    from stages.primitives.text import shape_of_solids

    config = PrimitivesConfig()
    for index in range(count):
        composition = config.compositions[index % len(config.compositions)]
        yield f"{composition} {index}", shape_of_solids(compose(composition, config, np.random.default_rng(index)))


def _random_program_shapes(count: int) -> Iterator[tuple[str, Shape]]:
    from stages.shapeassembly.random_programs import random_program
    from stages.shapeassembly.settings import RandomPrograms
    from stages.shapeassembly.shape import shape_of_text
    from stages.shapeassembly.syntax.printer import print_program

    for index in range(count):
        program = random_program(RandomPrograms(name="random", samples=1), np.random.default_rng(index))
        yield f"random program {index}", shape_of_text(print_program(program))


def _kit_shapes(count: int) -> Iterator[tuple[str, Shape]]:
    from stages import api

    for name in ("castle", "playground"):
        kit = api.read_kit(f"datasets/exemplars/{name}/*.glb")
        for index, shape in enumerate(api.vary(kit, count // 2, seed=49)):
            yield f"{name} {index}", shape


def dataset_shapes(folder: Path, count: int) -> Iterator[tuple[str, Shape]]:
    """Yield at most `count` samples of a finished dataset, evenly spread."""
    from stages.package.reader import Dataset

    dataset = Dataset.open(folder)
    step = max(1, len(dataset) // count)
    for index, sample in enumerate(dataset):
        if index % step == 0:
            yield f"{folder.name} {sample.key}", sample.shape


def table_row(name: str, found: Sequence[Verdicts]) -> str:
    """Return a row: shapes, falling ones, agreement and falling ones caught, by `falls` and by `stable`."""
    falling = [one for one in found if one.engine]
    cells = [name, str(len(found)), str(len(falling))]
    for said in ([one.fall.falls for one in found], [not one.stable for one in found]):
        agreed = sum(verdict == one.engine for verdict, one in zip(said, found, strict=True))
        caught = sum(verdict for verdict, one in zip(said, found, strict=True) if one.engine)
        cells += [f"{agreed / len(found):.1%}", f"{caught} of {len(falling)}"]
    return "| " + " | ".join(cells) + " |"


def main(arguments: Sequence[str]) -> None:
    """Print the table, and the shapes on which verdicts differ."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("datasets", nargs="*", type=Path)
    parser.add_argument("--programs", type=Path)
    parser.add_argument("--generated", action="store_true")
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--disagreements", type=Path)
    asked = parser.parse_args(arguments)
    sources = {folder.name: dataset_shapes(folder, asked.count) for folder in asked.datasets}
    if asked.generated:
        sources = {**dict(generated_shapes(asked.count)), **sources}
    if asked.programs is not None:
        sources = {"published programs": program_shapes(asked.programs, asked.count), **sources}
    print("| shapes | number | fall in MuJoCo | `falls` agrees | caught | not `stable` agrees | caught |")
    print("|---|---:|---:|---:|---:|---:|---:|")
    everything: list[Verdicts] = []
    for name, shapes in sources.items():
        found = [verdicts(shape_name, shape, PhysicsConfig()) for shape_name, shape in shapes]
        print(table_row(name, found), flush=True)
        everything += found
    print(table_row("all", everything))
    for one in everything:
        if one.fall.falls != one.engine:
            print(f"{one.name}: MuJoCo {one.engine}, falls {one.fall.falls} at {one.fall.tilt_degrees:.2f}°")
            if asked.disagreements is not None:
                _draw(one, asked.disagreements)


def _draw(one: Verdicts, folder: Path) -> None:
    from stages import api

    folder.mkdir(parents=True, exist_ok=True)
    api.render(one.shape, folder / f"{one.name.replace(' ', '-')}.png")


if __name__ == "__main__":
    main(sys.argv[1:])
