"""Do engines agree on what falls? The record's `falls` and `stable` against MuJoCo and PyBullet, on several producers.

    python -m tests.bench.engine_falls --generated --programs ../shared/shapeassembly --count 300 datasets/mixed

A shape is dropped: its connected pieces are rigid bodies of convex parts. It rests for a second. Then gravity is
tilted by a push of FALL_PUSH in each of eight directions for a second, and upright again until it rests. It falls if
the centre of mass of a piece has risen or sunk by FALL_SHARE. A table for each engine says how often the verdicts
agree, and how many of the falling ones are caught. Then the shapes on which they differ are listed by class, and
`--disagreements FOLDER` draws them. PyBullet has no wheel for Pythons after 3.11, and is left out there.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import trimesh

from pipeline.paths import write_file
from stages.export.hulls import convex_piece
from stages.export.mjcf import mjcf_files
from stages.export.model import simulation_model
from stages.export.settings import ExportSettings
from stages.export.urdf import urdf_files
from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.bounds import shape_bounds
from stages.shape.kit import PartMesh
from stages.shape.physics.judge import Judge
from stages.shape.physics.settings import PhysicsConfig
from stages.shape.physics.settling import FALL_PUSH, FALL_SHARE, Fall
from stages.shape.shape import Shape, upright

DIRECTION_COUNT = 8
REST_SECONDS, PUSH_SECONDS, RETURN_SECONDS = 1.0, 1.0, 2.0
STEP_SECONDS = 0.004
PUSH_DEGREES = float(np.degrees(np.arctan(FALL_PUSH)))
NEAR_PUSH_DEGREES = 1.5
"""An engine's sudden push rocks a body, and its contacts are soft."""
MIN_FILLING = 1.2
"""Volume of the convex piece of a part, over its own, from which on filling it may matter."""
METRES_PER_SQUARE_SECOND = 9.81
PHYSICS = """<option timestep="{step}" integrator="implicitfast" cone="elliptic"/>
  <default><geom friction="1 0.005 0.0001"/></default>"""
GROUND = '<worldbody><geom name="ground" type="plane" size="0 0 1"/>'


@dataclass(frozen=True)
class Verdicts:
    """What is said of one shape.

    stable: as in its record
    fall: the tilt that it bears, and the piece
    pieces: number of pieces that its joints make
    engines: whether it falls in each engine
    """

    name: str
    shape: Shape
    stable: bool
    fall: Fall
    pieces: int
    engines: Mapping[str, bool]

    def differs(self, engine: str) -> bool:
        """Return whether an engine has another verdict than the record."""
        return self.engines[engine] != self.fall.falls

    @property
    def case(self) -> str:
        """Why an engine may have another verdict."""
        if abs(self.fall.tilt_degrees - PUSH_DEGREES) < NEAR_PUSH_DEGREES:
            return f"it tips at {PUSH_DEGREES:.1f} ± {NEAR_PUSH_DEGREES:g}°, near the push"
        if self.pieces > 1:
            return "its pieces meet in the engine"
        filled = {mesh: convex_piece(self.shape.meshes[mesh]) for mesh in set(self.shape.assembly.types.tolist())}
        if any(_volume(hull) > MIN_FILLING * _volume(self.shape.meshes[mesh]) for mesh, hull in filled.items()):
            return "the engine fills hollow parts"
        return "other"


def falls_in_mujoco(shape: Shape, connected: IntArray) -> bool:
    """Return whether an upright shape, dropped and pushed, comes to rest at another height in MuJoCo.

    connected: pairs of parts that hold together, int32 (m, 2)
    """
    import mujoco

    files = mjcf_files(simulation_model("shape", shape, connected, _settings(shape)))
    text = files["shape.xml"].decode()
    text = text.replace("<worldbody>", PHYSICS.format(step=STEP_SECONDS) + GROUND, 1)
    text = re.sub(r' meshdir="[^"]*"', "", text)
    meshes = {Path(name).name: content for name, content in files.items() if name.endswith(".obj")}
    model = mujoco.MjModel.from_xml_string(text, meshes)
    state = mujoco.MjData(model)
    mujoco.mj_forward(model, state)
    rest: list[FloatArray] = []

    def run(push: float, azimuth: float, seconds: float) -> None:
        _run(model, state, push, azimuth, seconds)

    def return_to_rest() -> None:
        rest[:] = rest or [state.qpos.copy()]
        mujoco.mj_resetData(model, state)
        state.qpos[:] = rest[0]

    return _falls(run, return_to_rest, lambda: _heights(model, state))


def falls_in_pybullet(shape: Shape, connected: IntArray) -> bool:
    """Return the same in PyBullet."""
    import pybullet as bullet

    files = urdf_files(simulation_model("shape", shape, connected, _settings(shape)))
    client = bullet.connect(bullet.DIRECT)
    try:
        with tempfile.TemporaryDirectory() as folder:
            for name, content in files.items():
                write_file(Path(folder) / name, content)
            names = [name for name in files if name.endswith(".urdf")]
            flags = bullet.URDF_USE_INERTIA_FROM_FILE
            bodies = [bullet.loadURDF(str(Path(folder) / name), flags=flags) for name in names]
        ground = bullet.createMultiBody(0, bullet.createCollisionShape(bullet.GEOM_PLANE))
        for body in [ground, *bodies]:
            bullet.changeDynamics(body, -1, lateralFriction=1.0)
        bullet.setPhysicsEngineParameter(fixedTimeStep=STEP_SECONDS)
        rest: list[int] = []

        def run(push: float, azimuth: float, seconds: float) -> None:
            level = [METRES_PER_SQUARE_SECOND * push * part for part in (np.cos(azimuth), np.sin(azimuth))]
            bullet.setGravity(*level, -METRES_PER_SQUARE_SECOND)
            for _ in range(round(seconds / STEP_SECONDS)):
                bullet.stepSimulation()

        def return_to_rest() -> None:
            rest[:] = rest or [bullet.saveState()]
            bullet.restoreState(rest[0])

        def heights() -> FloatArray:
            return np.array([bullet.getBasePositionAndOrientation(body)[0][2] for body in bodies])

        return _falls(run, return_to_rest, heights)
    finally:
        bullet.disconnect(client)


def _volume(mesh: PartMesh) -> float:
    return abs(float(trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).volume))


def _settings(shape: Shape) -> ExportSettings:
    """Return how a shape becomes bodies, with a diagonal of one metre."""
    low, high = shape_bounds(shape)
    return ExportSettings(links="bodies", scale=1.0 / float(np.linalg.norm(high - low)))


def _falls(
    run: Callable[[float, float, float], None], return_to_rest: Callable[[], None], heights: Callable[[], FloatArray]
) -> bool:
    """Return whether a body comes to rest at another height, dropped or pushed.

    run: function of push, azimuth and seconds
    return_to_rest: function that goes back to where the first call found the bodies
    heights: function that returns the height of the centre of mass of each body
    """
    start = heights()
    run(0.0, 0.0, REST_SECONDS)
    if _moved(start, heights()):
        return True
    for azimuth in 2 * np.pi * np.arange(DIRECTION_COUNT) / DIRECTION_COUNT:
        return_to_rest()
        run(FALL_PUSH, azimuth, PUSH_SECONDS)
        run(0.0, 0.0, RETURN_SECONDS)
        if _moved(start, heights()):
            return True
    return False


ENGINES: dict[str, Callable[[Shape, IntArray], bool]] = {
    name: falls
    for name, module, falls in (("MuJoCo", "mujoco", falls_in_mujoco), ("PyBullet", "pybullet", falls_in_pybullet))
    if find_spec(module)
}


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
    """Return what the record and the engines say of a shape. Drawers and doors do not move."""
    shape = replace(upright(shape), part_joints=())
    judge = Judge(shape.meshes, shape.up, config)
    validity = judge.validity(shape.assembly)
    fall = judge.fall(shape.assembly, validity.joints)
    engines = {engine: falls(shape, validity.joints) for engine, falls in ENGINES.items()}
    return Verdicts(name, shape, validity.stable, fall, validity.components, engines)


def program_shapes(folder: Path, count: int) -> Iterator[tuple[str, Shape]]:
    """Yield `count` published ShapeAssembly programs, a third of each category, with their category and number."""
    from stages.shapeassembly.shape import shape_of_program_text
    from stages.shapeassembly.sources import program_texts

    for category in ("chair", "table", "storage"):
        texts = sorted(program_texts(folder / "programs.tar.xz", f"data/{category}"))
        for place in np.random.default_rng(49).permutation(len(texts))[: count // 3].tolist():
            name, text = texts[place]
            yield f"{category} {Path(name).stem}", shape_of_program_text(text)


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
    from stages.primitives.compose import random_composition
    from stages.primitives.settings import PrimitivesConfig
    from stages.primitives.text import shape_of_solids

    config = PrimitivesConfig()
    for index in range(count):
        composition = config.compositions[index % len(config.compositions)]
        yield (
            f"{composition} {index}",
            shape_of_solids(random_composition(composition, config, np.random.default_rng(index))),
        )


def _random_program_shapes(count: int) -> Iterator[tuple[str, Shape]]:
    from stages.shapeassembly.random_programs import random_program
    from stages.shapeassembly.settings import RandomPrograms
    from stages.shapeassembly.shape import shape_of_program_text
    from stages.shapeassembly.syntax.printer import print_program

    for index in range(count):
        program = random_program(RandomPrograms(name="random", samples=1), np.random.default_rng(index))
        yield f"random program {index}", shape_of_program_text(print_program(program))


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


def table_row(name: str, found: Sequence[Verdicts], engine: str) -> str:
    """Return a row: shapes, falling ones, agreement and falling ones caught, by `falls` and by `stable`."""
    falling = [one for one in found if one.engines[engine]]
    cells = [name, str(len(found)), str(len(falling))]
    for said in ([one.fall.falls for one in found], [not one.stable for one in found]):
        agreed = sum(verdict == one.engines[engine] for verdict, one in zip(said, found, strict=True))
        caught = sum(verdict for verdict, one in zip(said, found, strict=True) if one.engines[engine])
        cells += [f"{agreed / len(found):.1%}", f"{caught} of {len(falling)}"]
    return "| " + " | ".join(cells) + " |"


def main(arguments: Sequence[str]) -> None:
    """Print a table for each engine, and the shapes on which verdicts differ, by class."""
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
    found: dict[str, list[Verdicts]] = {}
    for name, shapes in sources.items():
        found[name] = [verdicts(shape_name, shape, PhysicsConfig()) for shape_name, shape in shapes]
        print(f"{name}: {len(found[name])} shapes", file=sys.stderr, flush=True)
    everything = [one for of_source in found.values() for one in of_source]
    for engine in ENGINES:
        print(f"\n| shapes | number | fall in {engine} | `falls` agrees | caught | not `stable` agrees | caught |")
        print("|---|---:|---:|---:|---:|---:|---:|")
        for name, of_source in {**found, "all": everything}.items():
            print(table_row(name, of_source, engine))
    _print_differences(everything)
    if asked.disagreements is not None:
        for one in everything:
            if any(one.differs(engine) for engine in ENGINES):
                _draw(one, asked.disagreements)


def _print_differences(found: Sequence[Verdicts]) -> None:
    """Print how often the engines agree with each other, and the shapes on which one differs from the record."""
    agreed = sum(len(set(one.engines.values())) == 1 for one in found)
    print(f"\n{' and '.join(ENGINES)} agree on {agreed} of {len(found)} shapes ({agreed / len(found):.1%})")
    for engine in ENGINES:
        by_case: dict[str, list[Verdicts]] = {}
        for one in found:
            if one.differs(engine):
                by_case.setdefault(one.case, []).append(one)
        print(f"\n{engine} differs on {sum(map(len, by_case.values()))}:")
        for case, of_case in sorted(by_case.items(), key=lambda pair: -len(pair[1])):
            print(f"  {len(of_case)}: {case}")
            for one in of_case:
                verdict = "falls" if one.engines[engine] else "stands"
                print(f"    {one.name}: {verdict} in {engine}; record: tips at {one.fall.tilt_degrees:.2f}°")


def _draw(one: Verdicts, folder: Path) -> None:
    from stages import api

    folder.mkdir(parents=True, exist_ok=True)
    api.render(one.shape, folder / f"{one.name.replace(' ', '-')}.png")


if __name__ == "__main__":
    main(sys.argv[1:])
