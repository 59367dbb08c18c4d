"""Shapes with rows of known lengths, built part by part, each once."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import trimesh

from stages.rows.layout import Layout, layout_of
from stages.shape.arrays import FloatArray
from stages.shape.kit import Kit
from tests.toy_kits.chains_and_rings import Placed, box, kit_of, pose

SHELF_BOARDS, BOARD_STEP = 5, 0.4
MESHES = {
    "side": box(0.05, 2.0, 0.4),
    "board": box(0.9, 0.04, 0.4),
    "crate": box(0.5, 0.2, 0.3),
    "can": box(0.1, 0.1, 0.1),
    "post": box(0.1, 1.0, 0.1),
    "pin": box(0.06, 1.0, 0.06),
}


def layout(meshes: dict[str, trimesh.Trimesh], parts: Sequence[Placed]) -> tuple[Kit, Layout]:
    """Return the kit of one shape and the layout of its exemplar."""
    kit = kit_of(meshes, [parts], ("point", "line", "face"))
    return kit, layout_of(kit, kit.exemplars[0])


@cache
def shelf(boards: int = SHELF_BOARDS, crates: tuple[int, ...] = (), cans: tuple[int, ...] = ()) -> tuple[Kit, Layout]:
    """Two sides that hold boards; a crate or a can stands on the boards in `crates` and `cans`."""
    sides = [("side", pose(x, 1.0, 0.0)) for x in (-0.475, 0.475)]
    held = [("board", pose(0.0, 0.2 + BOARD_STEP * number, 0.0)) for number in range(boards)]
    lying = [("crate", pose(0.0, 0.32 + BOARD_STEP * number, 0.0)) for number in crates]
    lying += [("can", pose(0.0, 0.27 + BOARD_STEP * number, 0.0)) for number in cans]
    return layout(MESHES, [*sides, *held, *lying])


@cache
def cabinet(stands_out: float = 0.0) -> tuple[Kit, Layout]:
    """Two sides under a top, with a shelf and a framed door between them.

    stands_out: how far the door reaches over the side at its right
    """
    xs = [0.0, 0.1, 0.75 + stands_out, 0.85 + stands_out]
    solid = np.ones((3, 3), dtype=bool)
    solid[1, 1] = False
    door = plate(xs, [0.0, 0.1, 0.8, 0.9], 0.04, solid)
    door.apply_translation([-xs[-1] / 2, -0.45, 0.0])
    meshes = {"side": box(0.05, 1.0, 0.4), "top": box(1.1, 0.05, 0.44), "shelf": box(0.9, 0.04, 0.4), "door": door}
    sides = [("side", pose(x, 0.5, 0.0)) for x in (-0.475, 0.475)]
    inside = [("shelf", pose(0.0, 0.6, 0.0)), ("door", pose(-0.4 + xs[-1] / 2, 0.5, 0.22))]
    return layout(meshes, [*sides, ("top", pose(0.0, 1.025, 0.0)), *inside])


CHEST = {"body": box(1.0, 1.0, 0.4), "door": box(0.9, 0.9, 0.04), "knob": box(0.04, 0.04, 0.05)}


@cache
def chest_with_door(doors: int = 1) -> tuple[Kit, Layout]:
    """A body with doors next to each other at its front, each with a knob near its right edge."""
    width = 0.9 / doors - 0.02 * (doors - 1)
    meshes = CHEST | {"door": box(width, 0.9, 0.04)}
    places = [(number + 0.5) * 0.9 / doors - 0.45 for number in range(doors)]
    fronts = [("door", pose(x, 0.5, 0.22)) for x in places]
    knobs = [("knob", pose(x + width / 2 - 0.06, 0.5, 0.265)) for x in places]
    return layout(meshes, [("body", pose(0.0, 0.5, 0.0)), *fronts, *knobs])


@cache
def chest_with_glass_door() -> tuple[Kit, Layout]:
    """A body with a framed pane at its front; the pane touches the frame alone."""
    solid = np.ones((3, 3), dtype=bool)
    solid[1, 1] = False
    frame = plate([0.0, 0.1, 0.8, 0.9], [0.0, 0.1, 0.8, 0.9], 0.04, solid)
    frame.apply_translation([-0.45, -0.45, 0.0])
    meshes = CHEST | {"frame": frame, "pane": box(0.7, 0.7, 0.02)}
    parts = [("body", pose(0.0, 0.5, 0.0)), ("frame", pose(0.0, 0.5, 0.22)), ("pane", pose(0.0, 0.5, 0.23))]
    return layout(meshes, parts)


@cache
def table_of_boxes() -> tuple[Kit, Layout]:
    """A table with two boxes on it, each as long as half of it."""
    meshes = {"leg": box(0.1, 1.0, 0.1), "top": box(2.0, 0.05, 0.8), "box": box(0.9, 0.2, 0.6)}
    legs = [("leg", pose(x, 0.5, z)) for x in (-0.9, 0.9) for z in (-0.3, 0.3)]
    boxes = [("box", pose(x, 1.15, 0.0)) for x in (-0.5, 0.5)]
    return layout(meshes, [*legs, ("top", pose(0.0, 1.025, 0.0)), *boxes])


@cache
def rail(posts: int = 8) -> tuple[Kit, Layout]:
    """A bar on posts and pins that alternate."""
    meshes = MESHES | {"bar": box(posts * 0.5, 0.1, 0.1)}
    feet = [("pin" if number % 2 else "post", pose(0.25 + 0.5 * number, 0.5, 0.0)) for number in range(posts)]
    return layout(meshes, [("bar", pose(posts * 0.25, 1.05, 0.0)), *feet])


@cache
def arched_rail(bars: int = 6, more: tuple[float, ...] = ()) -> tuple[Kit, Layout]:
    """Bars between a sill and a rail whose underside is flat and whose upper side is an arch.

    more: places of further bars, along x
    """
    length = 0.5 * bars
    along = np.linspace(-length / 2, length / 2, 16)
    arch = 0.1 + 0.3 * np.cos(np.pi * along / length)
    corners = [(x, y, z) for z in (-0.1, 0.1) for x, top in zip(along, arch, strict=True) for y in (0.0, top)]
    meshes = {
        "rail": trimesh.Trimesh(corners).convex_hull,
        "sill": box(length, 0.1, 0.2),
        "bar": box(0.1, 1.0, 0.1),
    }
    places = [*(0.25 + 0.5 * number - length / 2 for number in range(bars)), *more]
    held = [("bar", pose(x, 0.5, 0.0)) for x in places]
    centre = np.eye(4)
    centre[:3, 3] = [0.0, 1.0, 0.0]
    return layout(meshes, [("sill", pose(0.0, -0.05, 0.0)), ("rail", centre), *held])


@cache
def battlement() -> tuple[Kit, Layout]:
    """Pegs on three equal teeth of a wall with other notches between them."""
    xs = [0.0, 0.35, 0.65, 1.0, 1.35, 1.65, 1.8, 2.35, 2.65, 3.0]
    solid = np.ones((9, 3), dtype=bool)
    solid[[0, 2, 3, 5, 6, 8], 2] = False
    solid[[3, 5], 1] = False
    wall = plate(xs, [0.0, 0.4, 0.8, 1.0], 0.2, solid)
    pegs = [("peg", pose(0.5 + number, 1.25, 0.0)) for number in range(3)]
    return layout({"wall": wall, "peg": box(0.1, 0.5, 0.1)}, [("wall", pose(0.0, 0.0, 0.0)), *pegs])


@cache
def leaning_frame(bars: int = 6) -> tuple[Kit, Layout]:
    """Two slanted posts with bars between them; everything is turned about x."""
    turn = trimesh.transformations.rotation_matrix(0.6, [1, 0, 0])
    posts = [("post", turn @ pose(x, 1.5, 0.0)) for x in (-0.3, 0.3)]
    held = [("bar", turn @ pose(0.0, 0.25 + 0.5 * number, 0.0)) for number in range(bars)]
    return layout({"post": box(0.1, 3.0, 0.1), "bar": box(0.5, 0.06, 0.06)}, [*posts, *held])


@cache
def frame_with_knobs(knobs: tuple[float, ...]) -> tuple[Kit, Layout]:
    """Two posts filled with bars half a unit apart, and knobs at other heights outside of one post."""
    posts = [("post", pose(x, 1.5, 0.0)) for x in (-0.3, 0.3)]
    bars = [("bar", pose(0.0, 0.25 + 0.5 * number, 0.0)) for number in range(6)]
    held = [("knob", pose(0.4, height, 0.0)) for height in knobs]
    meshes = {"post": box(0.1, 3.0, 0.1), "bar": box(0.5, 0.06, 0.06), "knob": box(0.1, 0.05, 0.05)}
    return layout(meshes, [*posts, *bars, *held])


def plate(xs: Sequence[float], ys: Sequence[float], depth: float, solid: np.ndarray) -> trimesh.Trimesh:
    """Return a plate in one piece, extruded along z, of the solid cells (x, y) of a grid."""
    padded = np.pad(solid, 1)
    triangles: list[list[list[float]]] = []

    def quad(*corners: tuple[float, float, float]) -> None:
        a, b, c, d = (list(corner) for corner in corners)
        triangles.extend([[a, b, c], [a, c, d]])

    for i, j in np.argwhere(solid).tolist():
        x, nx, y, ny = xs[i], xs[i + 1], ys[j], ys[j + 1]
        low, high = -depth / 2, depth / 2
        quad((x, y, high), (nx, y, high), (nx, ny, high), (x, ny, high))
        quad((x, y, low), (x, ny, low), (nx, ny, low), (nx, y, low))
        if not padded[i, j + 1]:
            quad((x, y, low), (x, y, high), (x, ny, high), (x, ny, low))
        if not padded[i + 2, j + 1]:
            quad((nx, y, low), (nx, ny, low), (nx, ny, high), (nx, y, high))
        if not padded[i + 1, j]:
            quad((x, y, low), (nx, y, low), (nx, y, high), (x, y, high))
        if not padded[i + 1, j + 2]:
            quad((x, ny, low), (x, ny, high), (nx, ny, high), (nx, ny, low))
    return trimesh.Trimesh(**trimesh.triangles.to_kwargs(np.array(triangles)))


@cache
def wall(columns: int = 3, storeys: int = 3) -> tuple[Kit, Layout]:
    """A wall in one piece with a hole for each window of a grid."""
    xs = [0.0, *(edge + 1.5 * number for number in range(columns) for edge in (0.7, 1.3)), 1.5 * columns + 0.5]
    ys = [0.0, *(edge + 1.6 * number for number in range(storeys) for edge in (0.6, 1.4)), 1.6 * storeys + 0.4]
    solid = np.ones((len(xs) - 1, len(ys) - 1), dtype=bool)
    solid[1::2, 1::2] = False
    windows = [("window", pose(1.0 + 1.5 * i, 1.0 + 1.6 * j, 0.0)) for i in range(columns) for j in range(storeys)]
    wall_pose = pose((xs[0] + xs[-1]) / 2, (ys[0] + ys[-1]) / 2, 0.0)
    middle = np.array([(xs[0] + xs[-1]) / 2, (ys[0] + ys[-1]) / 2, 0.0])
    pierced = plate(xs, ys, 0.2, solid).apply_translation(-middle)
    return layout({"wall": pierced, "window": box(0.6, 0.8, 0.1)}, [("wall", wall_pose), *windows])


@cache
def truss(bays: int = 5) -> tuple[Kit, Layout]:
    """Two chords, each with a knot at every joint and in one piece, with a bar at each joint."""
    xs = [edge + number for number in range(bays + 1) for edge in (-0.05, 0.05)]
    solid = np.ones((len(xs) - 1, 3), dtype=bool)
    solid[1::2, [0, 2]] = False
    chord = plate(xs, [-0.05, -0.02, 0.02, 0.05], 0.04, solid)
    bars = [("bar", pose(float(number), 0.5, 0.0)) for number in range(bays + 1)]
    chords = [("chord", pose(0.0, y, 0.0)) for y in (0.0, 1.0)]
    return layout({"chord": chord, "bar": box(0.05, 0.9, 0.05)}, [*chords, *bars])


@cache
def stair(steps: int = 6) -> tuple[Kit, Layout]:
    """Two slanted beams, prisms along the slope, that carry steps."""
    rise, run, length = 0.2, 0.3, 0.3 * (steps + 1)
    low = np.array([[0.0, -0.15], [length, -0.15 + length * rise / run], [length, length * rise / run], [0.0, 0.0]])
    vertices = np.array([[x, y, z] for z in (0.0, 0.05) for x, y in low])
    faces = [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4], [1, 2, 6], [1, 6, 5], [2, 3, 7],
             [2, 7, 6], [3, 0, 4], [3, 4, 7]]  # fmt: skip
    beam = trimesh.Trimesh(vertices, faces, process=False)
    treads = [("tread", pose(run * (number + 0.8), rise * (number + 0.8) - 0.05, 0.525)) for number in range(steps)]
    beams = [("beam", pose(0.0, 0.0, z)) for z in (0.0, 1.0)]
    return layout({"beam": beam, "tread": box(0.2, 0.04, 0.95)}, [*beams, *treads])


@cache
def mirrored_row(pairs: int = 3) -> tuple[Kit, Layout]:
    """A bar with left and right brackets in turn, which are mirror images."""
    bracket = trimesh.Trimesh(
        [[0, 0, 0], [0.2, 0, 0], [0, 0.5, 0], [0, 0, 0.1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], process=False
    )
    other = bracket.copy()
    other.vertices[:, 0] *= -1
    other.invert()
    meshes = {"bar": box(2.0 * pairs, 0.1, 0.4), "left": bracket, "right": other}
    brackets = [(name, pose(0.4 + 2.0 * number + 0.9 * (name == "right"), 0.0, 0.0)) for number in range(pairs)
                for name in ("left", "right")]  # fmt: skip
    return layout(meshes, [("bar", pose(pairs * 1.0, -0.05, 0.0)), *brackets])


def turns_about_y(count: int) -> list[FloatArray]:
    """Rotations (4, 4) by equal angles."""
    return [trimesh.transformations.rotation_matrix(2 * np.pi * number / count, [0, 1, 0]) for number in range(count)]


def round_plate(radius: float) -> trimesh.Trimesh:
    """A plate of height 0.1 that lies level."""
    upright = trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0])
    return trimesh.creation.cylinder(radius, 0.1, sections=64).apply_transform(upright)


@cache
def round_temple(columns: int = 8) -> tuple[Kit, Layout]:
    """Columns, each with a base, between two round plates."""
    standing = [
        (name, turn @ pose(1.0, y, 0.0))
        for turn in turns_about_y(columns)
        for name, y in (("base", 0.1), ("column", 0.65))
    ]
    meshes = {"plate": round_plate(1.2), "base": box(0.3, 0.1, 0.2), "column": box(0.2, 1.0, 0.1)}
    return layout(meshes, [("plate", pose(0.0, 0.0, 0.0)), ("plate", pose(0.0, 1.2, 0.0)), *standing])


@cache
def fan(blades: int = 3) -> tuple[Kit, Layout]:
    """Blades on a round plate, each with two screws."""
    meshes = {"plate": round_plate(0.5), "blade": box(1.0, 0.05, 0.2), "screw": box(0.04, 0.02, 0.03)}
    of_blade = (("blade", 0.9, 0.075, 0.0), ("screw", 0.6, 0.11, 0.05), ("screw", 0.6, 0.11, -0.05))
    held = [(name, turn @ pose(x, y, z)) for turn in turns_about_y(blades) for name, x, y, z in of_blade]
    return layout(meshes, [("plate", pose(0.0, 0.0, 0.0)), *held])


@cache
def chandelier(widths: tuple[float, ...] = (0.2, 0.21, 0.19, 0.205, 0.195), aside: float = 0.0) -> tuple[Kit, Layout]:
    """Arms on a round plate, each with a shade of another width on a socket.

    aside: how far the last shade is moved along its arm
    """
    meshes = {"plate": round_plate(0.3), "arm": box(1.0, 0.05, 0.1), "socket": box(0.1, 0.05, 0.06)}
    held: list[Placed] = []
    for number, (turn, width) in enumerate(zip(turns_about_y(len(widths)), widths, strict=True)):
        meshes[f"shade{number}"] = box(width, 0.3, 0.8 * width)
        held += [(name, turn @ pose(x, y, 0.0)) for name, x, y in (("arm", 0.75, 0.0), ("socket", 1.1, 0.05))]
        held.append((f"shade{number}", turn @ pose(1.1 + aside * (number == len(widths) - 1), 0.225, 0.0)))
    return layout(meshes, [("plate", pose(0.0, 0.0, 0.0)), *held])


@cache
def framed_windows(count: int = 3) -> tuple[Kit, Layout]:
    """A wall with windows, each of two sides and a pane between them."""
    sides = [("side", pose(1.8 * number + x, 1.0, 0.0)) for number in range(count) for x in (0.0, 1.0)]
    panes = [("pane", pose(1.8 * number + 0.5, 1.0, 0.0)) for number in range(count)]
    wall = ("wall", pose(0.9 * count - 0.4, 1.0, -0.1))
    meshes = {"wall": box(1.8 * count + 0.4, 2.4, 0.1), "side": box(0.1, 1.0, 0.1), "pane": box(0.9, 1.0, 0.1)}
    return layout(meshes, [wall, *sides, *panes])


@cache
def two_pitches(ratio: float, pegs: int) -> tuple[Kit, Layout]:
    """Two sides that hold boards, and one of them pegs at another step, `ratio` times as far apart."""
    sides = [("side", pose(x, 1.0, 0.0)) for x in (-0.475, 0.475)]
    held = [("board", pose(0.0, 0.2 + BOARD_STEP * number, 0.0)) for number in range(SHELF_BOARDS)]
    hung = [("peg", pose(0.55, 0.2 + ratio * BOARD_STEP * number, 0.0)) for number in range(pegs)]
    return layout(MESHES | {"peg": box(0.1, 0.04, 0.04)}, [*sides, *held, *hung])


@cache
def fronts(tall: float = 0.7) -> tuple[Kit, Layout]:
    """A back with a tall front and two lower ones above it; each has a handle, and the handles are at equal steps."""
    heights = [tall, 0.38, 0.38]
    lows = [0.0, tall + 0.02, tall + 0.42]
    names = ["tall", "front", "front"]
    meshes = {"back": box(1.0, 2.0, 0.1), "tall": box(0.9, tall, 0.05), "front": box(0.9, 0.38, 0.05)}
    closed = [(name, pose(0.0, low + height / 2 + 0.2, 0.075))
              for name, low, height in zip(names, lows, heights, strict=True)]  # fmt: skip
    tops = [low + height + 0.1 for low, height in zip(lows, heights, strict=True)]
    handles = [("handle", pose(0.0, top, 0.12)) for top in tops]
    meshes |= {"handle": box(0.3, 0.04, 0.04)}
    return layout(meshes, [("back", pose(0.0, 1.0, 0.0)), *closed, *handles])


def slanted(width: float, height: float, depth: float, slant: float) -> trimesh.Trimesh:
    """A prism along z whose underside is moved by `slant` along x; no turn about y leaves it as it is."""
    x, y, z = width / 2, height / 2, depth / 2
    ends = [(-x + slant, -y), (x + slant, -y), (x, y), (-x, y)]
    return trimesh.Trimesh([(a, b, c) for c in (-z, z) for a, b in ends]).convex_hull


def mirrored(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The mirror image of a mesh along x."""
    other = mesh.copy()
    other.vertices[:, 0] *= -1
    other.invert()
    return other


@cache
def table_on_frames(length: float = 2.0, step: float = 0.0) -> tuple[Kit, Layout]:
    """A top and a bar between two frames that lean outwards: one is the other turned by 180 degrees.

    step: how far the middle of the top is raised; such a top is no prism
    """
    solid = np.ones((3, 2), dtype=bool)
    solid[[0, 2], 1] = False
    top = box(length, 0.05, 0.9)
    if step:
        top = plate([-length / 2, -0.2, 0.2, length / 2], [-0.025, 0.025, 0.025 + step], 0.9, solid)
    place = length / 2 - 0.4
    meshes = {"top": top, "frame": slanted(0.1, 1.0, 0.8, -0.2), "bar": box(2 * place - 0.1, 0.05, 0.1)}
    frames = [("frame", pose(-place, 0.5, 0.0)), ("frame", pose(place, 0.5, 0.0, quarter_turns=2))]
    return layout(meshes, [*frames, ("top", pose(0.0, 1.025, 0.0)), ("bar", pose(0.0, 0.975, 0.0))])


@cache
def casement() -> tuple[Kit, Layout]:
    """Two leaves with hinges at their outer sides, which are mirror images, between a sill and a lintel."""
    hinge = trimesh.Trimesh(
        [[0, 0, 0], [0.2, 0, 0], [0, 0.3, 0], [0, 0, 0.1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], process=False
    )
    meshes = {"rail": box(2.4, 0.1, 0.2), "leaf": box(0.9, 1.0, 0.1), "hinge": hinge, "other hinge": mirrored(hinge)}
    rails = [("rail", pose(0.0, y, 0.0)) for y in (-0.05, 1.05)]
    leaves = [("leaf", pose(x, 0.5, 0.0)) for x in (-0.45, 0.45)]
    hinges = [("hinge", pose(-0.9, 0.4, 0.05)), ("other hinge", pose(0.9, 0.4, 0.05))]
    return layout(meshes, [*rails, *leaves, *hinges])


@cache
def tower(storeys: int = 4, has_door: bool = False) -> tuple[Kit, Layout]:
    """Storeys of four tiles and four walls under a roof. No wall stands above one with an equal opening."""
    return layout(*tower_parts(storeys, has_door))


def tower_parts(storeys: int = 4, has_door: bool = False) -> tuple[dict[str, trimesh.Trimesh], list[Placed]]:
    """Return the meshes of `tower` by name, and its parts."""
    xs, ys = [-0.4, -0.2, 0.2, 0.4], [-0.45, -0.2, 0.2, 0.45]
    openings: dict[str, list[int]] = {"wall": [], "window": [1], "vent": [2], "hatch": [0], "door": [0, 1]}
    meshes = {}
    for name, opened in openings.items():
        solid = np.ones((3, 3), dtype=bool)
        solid[1, opened] = False
        meshes[name] = plate(xs, ys, 0.1, solid)
    meshes |= {"tile": box(0.45, 0.1, 0.45), "roof": box(1.3, 0.2, 1.3)}
    placed: list[Placed] = [("roof", pose(0.0, storeys + 0.1, 0.0))]
    for storey in range(storeys):
        placed += [("tile", pose(x, storey + 0.05, z)) for x in (-0.225, 0.225) for z in (-0.225, 0.225)]
        for number, (x, z) in enumerate([(0.0, -0.4), (0.4, 0.0), (0.0, 0.4), (-0.4, 0.0)]):
            name = ("wall", "window", "vent", "hatch")[(number + storey) % 4]
            is_door = has_door and storey == number == 0
            placed.append(("door" if is_door else name, pose(x, storey + 0.55, z, quarter_turns=number)))
    return meshes, placed


@cache
def zigzag_roof() -> tuple[Kit, Layout]:
    """Four boxes in a row under wedges that rise and fall in turn."""
    rising = trimesh.Trimesh([(x, y, z) for z in (-0.5, 0.5) for x, y in ((0, 0), (1, 0), (1, 1))]).convex_hull
    falling = trimesh.Trimesh([(x, y, z) for z in (-0.5, 0.5) for x, y in ((0, 0), (1, 0), (0, 1))]).convex_hull
    boxes = [("base", pose(number + 0.5, -0.5, 0.0)) for number in range(4)]
    roofs = [("falling" if number % 2 else "rising", pose(float(number), 0.0, 0.0)) for number in range(4)]
    return layout({"base": box(1.0, 1.0, 1.0), "rising": rising, "falling": falling}, [*boxes, *roofs])
