"""The differentiable interpreter: corners as functions of continuous parameters, in torch (shapeassembly §4).

The decisions of an attachment, such as grow or stay, the axis to scale and the nearest grid points, are discontinuous.
The fast interpreter takes them at the given parameters, and this one repeats the arithmetic. So both have one meaning,
and gradients are those of the branch taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.attachment import ADD_ALL, GROW, HINGE, MOVE, SCALE_ALL, STAY, across
from stages.shapeassembly.execution.interpreter import check_executed
from stages.shapeassembly.execution.kernels import ExecutedTables, run_tables
from stages.shapeassembly.execution.parameters import parameter_places
from stages.shapeassembly.execution.tables import ATTACH, DECLARE, REFLECT, SQUEEZE, program_tables
from stages.shapeassembly.syntax.program import AssemblyProgram

_CORNERS = torch.tensor([[x, y, z] for x in (0.5, -0.5) for y in (0.5, -0.5) for z in (0.5, -0.5)], dtype=torch.float64)
_UPRIGHT = torch.eye(3, dtype=torch.float64)


@dataclass(slots=True)
class _Box:
    """A cuboid of an assembly.

    centre, sizes: (3,).
    frame: (3, 3), axes as columns; None while upright.
    """

    centre: Tensor
    sizes: Tensor
    frame: Tensor | None
    aligned: bool
    child: int
    mirror: Tensor | None

    def arm(self, p: Tensor) -> Tensor:
        """Return the vector from the centre to local point `p`."""
        arm = (p - 0.5) * self.sizes
        return arm if self.frame is None else self.frame @ arm

    def point(self, p: Tensor) -> Tensor:
        return self.centre + self.arm(p)

    def local(self, point: Tensor) -> Tensor:
        way = point - self.centre
        return (way if self.frame is None else way @ self.frame) / self.sizes + 0.5


class DifferentiableProgram:
    """A program whose corners can be differentiated at any parameters."""

    def __init__(self, program: AssemblyProgram) -> None:
        self._flat = program_tables([program])
        self._places = parameter_places(self._flat.rows)
        self._rows: list[list[int]] = np.nan_to_num(self._flat.rows[:, :5]).astype(int).tolist()

    def corners(self, values: Tensor) -> Tensor:
        """Return the corners, float64 (n, 8, 3), as `execute` orders them.

        values: float64 (k,), as `parameters` orders them.
        Raises ProgramError where the program cannot be executed with these parameters.
        """
        rows, flat = self._flat.rows.copy(), self._flat
        rows[self._places[:, 0], self._places[:, 1]] = values.detach().numpy()
        executed: ExecutedTables
        executed, starts, decisions = run_tables(rows, flat.block_rows, flat.block_parts, flat.program_blocks)
        check_executed(executed)
        table = torch.zeros(len(rows), 6, dtype=torch.float64)
        triples = table.index_put(
            (torch.from_numpy(self._places[:, 0]), torch.from_numpy(self._places[:, 1] - 4)), values
        )
        points = triples.reshape(-1, 3).unbind(0)
        blocks = [
            self._execute(int(low), int(high), points, decisions[starts[index] : starts[index + 1]])
            for index, (low, high) in enumerate(zip(flat.block_rows[:-1], flat.block_rows[1:], strict=True))
        ]
        return _placed(blocks, executed.node)

    def _execute(self, low: int, high: int, points: tuple[Tensor, ...], decisions: FloatArray) -> list[_Box]:
        """Return the cuboids of one assembly in its own coordinates."""
        boxes: list[_Box] = []
        events: list[tuple[int, int, Tensor, Tensor]] = []

        def attach(moved: int, target: int, p: Tensor, q: Tensor) -> None:
            priors = [event[2] if event[0] == moved else event[3] for event in events if moved in event[:2]]
            _attach(boxes[moved], boxes[target], p, q, priors, decisions[len(events)])
            events.append((moved, target, p, q))

        for row in range(low, high):
            kind, a, b, c, face = self._rows[row]
            first, second = points[2 * row], points[2 * row + 1]
            if kind == DECLARE:
                boxes.append(_Box(torch.zeros_like(first), first, None, bool(b), a, None))
            elif kind == ATTACH:
                attach(a, b, first, second)
            elif kind == SQUEEZE:
                for own, target in ((face, b), (face ^ 1, c)):
                    attach(a, target, _face_centre(own), _on_face(own ^ 1 if target else own, first))
            else:
                copies = 1 if kind == REFLECT else c
                moves = [event for event in events if event[0] == a]
                sign = torch.ones(3, dtype=torch.float64)
                sign[b] = -1
                for number in range(1, copies + 1):
                    box = boxes[a]
                    mirror = box.mirror
                    if kind == REFLECT:
                        mirror = sign if mirror is None else mirror * sign
                    boxes.append(_Box(torch.zeros_like(box.sizes), box.sizes, None, box.aligned, box.child, mirror))
                    for _, target, p, _ in moves:
                        actual = box.point(p)
                        if kind == REFLECT:
                            p = torch.where(sign < 0, 1 - p, p)
                            actual = actual * sign
                        else:
                            actual = actual + boxes[0].sizes * (sign < 0) * (first[0] * (number / copies))
                        attach(len(boxes) - 1, target, p, boxes[target].local(actual).clamp(0, 1))
        return boxes


def _face_centre(face: int) -> Tensor:
    p = torch.full((3,), 0.5, dtype=torch.float64)
    p[face // 2] = 1 - face % 2
    return p


def _on_face(face: int, uv: Tensor) -> Tensor:
    """Return the point (u, v) of a face; `uv` holds u and v behind a placeholder for the face."""
    side = uv.new_tensor(1 - face % 2)
    point = [uv[1], uv[2]]
    point.insert(face // 2, side)
    return torch.stack(point)


def _attach(box: _Box, target: _Box, p: Tensor, q: Tensor, priors: list[Tensor], decision: FloatArray) -> None:
    rule, axis = int(decision[0]), int(decision[1])
    if rule == STAY:
        return
    goal = target.point(q)
    if rule == MOVE:
        box.centre = goal - box.arm(p)
    elif rule == GROW:
        near, far = torch.from_numpy(decision[2:5]), torch.from_numpy(decision[5:8])
        more = ((target.point(far) - box.point(near)) / (2 * near - 1)).clamp(min=0)
        box.sizes = box.sizes + more
        box.centre = box.centre + more * (near - 0.5)
    elif rule == HINGE:
        if axis >= 0:
            _hinge(box, priors[0], p, goal, axis, bool(decision[2]))
    else:
        _swing(box, priors, p, goal, axis, bool(decision[2]))


def _scale(box: _Box, axis: int, sizes: Tensor) -> None:
    """Take the size along `axis` from `sizes`."""
    box.sizes = torch.where(torch.arange(3) == axis, sizes, box.sizes)


def _hinge(box: _Box, prior: Tensor, p: Tensor, goal: Tensor, axis: int, half_turn: bool) -> None:
    pivot = box.point(prior)
    way, arm = goal - pivot, (p - prior) * box.sizes
    wanted, has = way @ way, arm @ arm
    if axis == ADD_ALL:
        square, linear = (p - prior) @ (p - prior), (p - prior) @ arm
        box.sizes = box.sizes + ((linear**2 - square * (has - wanted)).sqrt() - linear) / square
    elif axis == SCALE_ALL:
        box.sizes = box.sizes * (wanted / has).sqrt()
    else:
        _scale(box, axis, box.sizes * (1 + (wanted - has) / arm[axis] ** 2).sqrt())
    box.centre = pivot - box.arm(prior)
    a = box.point(p) - pivot
    if half_turn:
        axis_across = np.empty(3)
        across(a.detach().numpy(), axis_across)
        u = torch.from_numpy(axis_across)
        _rotate(box, pivot, 2 * torch.outer(u, u) - _UPRIGHT)
        return
    length = (a @ a).sqrt() * wanted.sqrt()
    cross = _skew(torch.linalg.cross(a, way) / length)
    _rotate(box, pivot, _UPRIGHT + cross + cross @ cross / (1 + a @ way / length))


def _swing(box: _Box, priors: list[Tensor], p: Tensor, goal: Tensor, axis: int, turned: bool) -> None:
    pivot = box.point(priors[0])
    if turned:
        u = box.point(priors[1]) - pivot
        u = u / (u @ u).sqrt()
        s, t = box.point(p) - pivot, goal - pivot
        s, t = s - u * (u @ s), t - u * (u @ t)
        lengths = ((s @ s) * (t @ t)).sqrt()
        cosine, sine = s @ t / lengths, u @ torch.linalg.cross(s, t) / lengths
        _rotate(box, pivot, cosine * _UPRIGHT + sine * _skew(u) + (1 - cosine) * torch.outer(u, u))
    if axis >= 0:
        face = _UPRIGHT[axis] if box.frame is None else box.frame[:, axis]
        # Both signs cancel for either side.
        more = (goal - box.point(p)) @ face / (p[axis] - priors[0][axis])
        position = box.point(priors[0])
        _scale(box, axis, box.sizes + more)
        box.centre = position - box.arm(priors[0])


def _skew(u: Tensor) -> Tensor:
    """Return the matrix of the cross product with `u`."""
    matrix: Tensor = torch.linalg.cross(u.expand(3, 3), _UPRIGHT).T
    return matrix


def _rotate(box: _Box, pivot: Tensor, rotation: Tensor) -> None:
    box.centre = pivot + rotation @ (box.centre - pivot)
    box.frame = rotation if box.frame is None else rotation @ box.frame


def _placed(blocks: list[list[_Box]], node: np.ndarray) -> Tensor:
    """Return the corners of all leaves, with assemblies placed within each other breadth first."""
    placed: list[tuple[Tensor, Tensor, Tensor, float]] = []
    corners = []
    for index, (block, parent, part) in enumerate(node.tolist()):
        if index == 0:
            rotation, translation = _UPRIGHT, torch.zeros(3, dtype=torch.float64)
            scale, hand = torch.ones_like(_UPRIGHT[0]), 1.0
        else:
            box = blocks[node[parent, 0]][part]
            above, translation_above, scale_above, hand = placed[parent]
            rotation = above if box.frame is None else above @ box.frame
            if box.mirror is not None:
                rotation = rotation * box.mirror
                hand *= float(box.mirror.prod())
            translation = translation_above + above @ box.centre
            scale = box.sizes * scale_above / blocks[block][0].sizes
        placed.append((rotation, translation, scale, hand))
        leaves = [box for box in blocks[block][1:] if box.child < 0]
        if leaves:
            centres, sizes = torch.stack([box.centre for box in leaves]), torch.stack([box.sizes for box in leaves])
            frames = torch.stack([_UPRIGHT if box.frame is None else box.frame for box in leaves])
            arms = (_CORNERS * (sizes * (scale * hand))[:, None]) @ frames.transpose(1, 2)
            corners.append((centres[:, None] + arms) @ rotation.T + translation)
    return torch.cat(corners) if corners else torch.zeros(0, 8, 3, dtype=torch.float64)
