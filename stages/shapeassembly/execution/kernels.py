"""The compiled interpreter: lines to cuboids, and assemblies placed within each other (shapeassembly §4, App. B)."""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from stages.shapeassembly.execution.attachment import MOVE, grow_to_target, hinge, hold, local, point, swing
from stages.shapeassembly.execution.tables import ATTACH, DECLARE, REFLECT, SQUEEZE
from stages.shapeassembly.syntax.limits import MAX_BLOCK_ATTACHMENTS, MAX_DEPTH, MAX_PARTS, MAX_REACH

OK, TOO_MANY_PARTS, TOO_DEEP, TOO_MANY_EVENTS, TOO_FAR = range(5)


class ExecutedTables(NamedTuple):
    """All leaf cuboids of all programs, by assembly breadth first.

    status: int64 (p,), OK, or why the program was not executed.
    program_leaves: int64 (p + 1,), where each program's leaves start.
    leaves: float64 (n, 15).
    corners: float64 (n, 8, 3).
    leaf_node: int64 (n,), the assembly, counted within the program.
    leaf_part: int64 (n,), the cuboid within its assembly.
    program_nodes: int64 (p + 1,), where each program's assemblies start.
    node: int64 (m, 3), assembly of the text, parent node, cuboid in the parent's assembly.
    boxes: float64 (parts, 15), every cuboid in the coordinates of its own assembly.
    """

    status: np.ndarray
    program_leaves: np.ndarray
    leaves: np.ndarray
    corners: np.ndarray
    leaf_node: np.ndarray
    leaf_part: np.ndarray
    program_nodes: np.ndarray
    node: np.ndarray
    boxes: np.ndarray


class _Events(NamedTuple):
    """The attachments of one assembly in order.

    who: int64 (e, 2), moved and target.
    where: float64 (e, 2, 3), local points.
    """

    who: np.ndarray
    where: np.ndarray


@numba.njit(cache=True)
def _attach(boxes, aligned, events, count, decision):
    """Execute attachment number `count` of an assembly."""
    moved, target = events.who[count]
    p, q = events.where[count]
    box = boxes[moved]
    goal = np.empty(3)
    point(boxes[target], q, goal)
    priors_count = 0
    for n in range(count):
        priors_count += (events.who[n, 0] == moved) + (events.who[n, 1] == moved)
    if priors_count == 0:
        decision[0] = MOVE
        hold(box, p, goal)
        return
    if aligned[moved]:
        grow_to_target(box, boxes[target], decision)
        return
    priors = np.empty((priors_count, 3))
    priors_count = 0
    for n in range(count):
        for role in range(2):
            if events.who[n, role] == moved:
                priors[priors_count] = events.where[n, role]
                priors_count += 1
    if priors_count == 1:
        hinge(box, priors[0], p, goal, decision)
    else:
        swing(box, priors, p, goal, decision)


@numba.njit(cache=True)
def _count_events(rows, parts):
    """Return the number of attachments of one assembly, copies included; -1 if too many."""
    moves = np.zeros(parts, np.int64)
    declared, total = 0, 0
    for row in rows:
        kind, a = int(row[0]), int(row[1])
        more = 0
        if kind == DECLARE:
            declared += 1
        elif kind in (ATTACH, SQUEEZE):
            more = 1 if kind == ATTACH else 2
            moves[a] += more
        else:
            copies = 1 if kind == REFLECT else int(row[3])
            moves[declared : declared + copies] = moves[a]
            declared += copies
            more = moves[a] * copies
        total += more
        if total > MAX_BLOCK_ATTACHMENTS:
            return -1
    return total


@numba.njit(cache=True)
def _face_point(face, u, v, out):
    """Write the point (u, v) of a face; faces are numbered as in `FACES`."""
    axis = face // 2
    out[axis] = 1.0 - face % 2
    out[(0 if axis else 1)] = u
    out[(2 if axis < 2 else 1)] = v


@numba.njit(cache=True)
def _execute(rows, boxes, child, mirrored, decisions):
    """Execute the lines of one assembly in its own coordinates.

    boxes: (parts, 15).
    child: (parts,), the assembly that expands each cuboid, or -1.
    mirrored: (parts,), a bit for each axis along which the cuboid is mirrored.
    decisions: (events, 8), for each attachment its rule and the axis whose size changed (ADD_ALL, SCALE_ALL: all
        three); then for
        GROW the near points of both cuboids, for HINGE whether it was half a turn, for SWING whether it turned.
    """
    events = _Events(np.empty((len(decisions), 2), np.int64), np.empty((len(decisions), 2, 3)))
    aligned = np.empty(len(boxes), np.bool_)
    # Typed zeros: literal constants have types of their own, for which callees would be compiled again.
    declared, count = np.int64(0), np.int64(0)
    for row in rows:
        kind, a, b, c = int(row[0]), int(row[1]), int(row[2]), int(row[3])
        if kind == DECLARE:
            boxes[declared] = 0.0
            boxes[declared, 3:6] = row[4:7]
            boxes[declared, 6] = boxes[declared, 10] = boxes[declared, 14] = 1.0
            child[declared], aligned[declared], mirrored[declared] = a, b != 0, 0
            declared += 1
        elif kind == ATTACH:
            events.who[count, 0], events.who[count, 1] = a, b
            events.where[count, 0], events.where[count, 1] = row[4:7], row[7:10]
            _attach(boxes, aligned, events, count, decisions[count])
            count += 1
        elif kind == SQUEEZE:
            face = int(row[4])
            for n in range(2):
                # Opposite faces of two cuboids meet; the bounding box is met by its own face from inside.
                own = face if n == 0 else face ^ 1
                target = b if n == 0 else c
                events.who[count, 0], events.who[count, 1] = a, target
                _face_point(own, 0.5, 0.5, events.where[count, 0])
                _face_point(own ^ 1 if target else own, row[5], row[6], events.where[count, 1])
                _attach(boxes, aligned, events, count, decisions[count])
                count += 1
        else:
            copies = 1 if kind == REFLECT else c
            sizes, before = boxes[a, 3:6].copy(), count
            for n in range(1, copies + 1):
                boxes[declared] = 0.0
                boxes[declared, 3:6] = sizes
                boxes[declared, 6] = boxes[declared, 10] = boxes[declared, 14] = 1.0
                child[declared], aligned[declared], mirrored[declared] = child[a], aligned[a], mirrored[a]
                if kind == REFLECT:
                    mirrored[declared] ^= 1 << b
                for k in range(before):
                    if events.who[k, 0] == a:
                        _copy_event(boxes, events, k, declared, count, b, kind == REFLECT, row[4] * n / copies)
                        _attach(boxes, aligned, events, count, decisions[count])
                        count += 1
                declared += 1


@numba.njit(cache=True)
def _copy_event(boxes, events, original, copy, count, axis, mirror, share):
    """Copy attachment `original`: its actual point is mirrored, or shifted by a share of the bounding box."""
    moved, target = events.who[original]
    p, q = events.where[count]
    p[:] = events.where[original, 0]
    actual = np.empty(3)
    point(boxes[moved], p, actual)
    if mirror:
        p[axis] = 1.0 - p[axis]
        actual[axis] = -actual[axis]
    else:
        actual[axis] += share * boxes[0, 3 + axis]
    local(boxes[target], actual, q)
    for k in range(3):
        q[k] = min(max(q[k], 0.0), 1.0)
    events.who[count, 0], events.who[count, 1] = copy, target


@numba.njit(cache=True)
def _count_nodes(child, block_parts):
    """Return the status, and the number of assemblies and leaves, of one expanded program."""
    blocks = len(block_parts) - 1
    inner, outer = np.zeros(blocks, np.int64), np.zeros(blocks, np.int64)
    first = block_parts[0]
    inner[0] = 1
    nodes, leaves = 0, 0
    for _ in range(MAX_DEPTH):
        outer[:] = 0
        for block in range(blocks):
            if inner[block]:
                nodes += inner[block]
                for part in range(block_parts[block] + 1, block_parts[block + 1]):
                    if child[part - first] >= 0:
                        outer[child[part - first]] += inner[block]
                    else:
                        leaves += inner[block]
        if nodes + leaves > MAX_PARTS:
            return TOO_MANY_PARTS, 0, 0
        if outer.max() == 0:
            return OK, nodes, leaves
        inner, outer = outer, inner
    return TOO_DEEP, 0, 0


@numba.njit(cache=True)
def _place(boxes, child, mirrored, block_parts, node, leaves, corners, leaf_node, leaf_part):
    """Place the assemblies of one program within each other, breadth first. Returns OK or TOO_FAR."""
    rotations, translations, scales = np.empty((len(node), 3, 3)), np.zeros((len(node), 3)), np.ones((len(node), 3))
    rotations[0] = np.eye(3)
    first = block_parts[0]
    node[0, 0], node[0, 1], node[0, 2] = 0, -1, 0
    nodes, leaf = 1, 0
    world, rotation = np.empty(15), np.empty((3, 3))
    for current in range(len(node)):
        block = node[current, 0]
        start = block_parts[block] - first
        m = rotations[current]
        handed = np.linalg.det(m) > 0
        for part in range(start + 1, block_parts[block + 1] - first):
            box = boxes[part]
            for k in range(3):
                world[k] = translations[current, k] + m[k, 0] * box[0] + m[k, 1] * box[1] + m[k, 2] * box[2]
                # Sizes scale with the actual size of the assembly, positions do not.
                world[3 + k] = box[3 + k] * scales[current, k]
                for j in range(3):
                    rotation[k, j] = m[k, 0] * box[6 + 3 * j] + m[k, 1] * box[7 + 3 * j] + m[k, 2] * box[8 + 3 * j]
            if child[part] >= 0:
                below = child[part]
                node[nodes, 0], node[nodes, 1], node[nodes, 2] = below, current, part - start
                for j in range(3):
                    sign = -1.0 if (mirrored[part] >> j) & 1 else 1.0
                    rotations[nodes, :, j] = sign * rotation[:, j]
                translations[nodes] = world[:3]
                scales[nodes] = world[3:6] / boxes[block_parts[below] - first, 3:6]
                nodes += 1
                continue
            for j in range(3):
                world[6 + 3 * j : 9 + 3 * j] = rotation[:, j] if handed else -rotation[:, j]
            leaves[leaf] = world
            p = np.empty(3)
            for corner in range(8):
                p[0], p[1], p[2] = 1 - (corner >> 2), 1 - ((corner >> 1) & 1), 1 - (corner & 1)
                point(world, p, corners[leaf, corner])
            leaf_node[leaf], leaf_part[leaf] = current, part - start
            leaf += 1
            if not np.abs(world).max() <= MAX_REACH:
                return TOO_FAR
    return OK


@numba.njit(cache=True)
def run_tables(rows, block_rows, block_parts, program_blocks):
    """Execute all programs of some tables.

    Returns the executed tables, where the decisions of each assembly start, int64 (b + 1,), and the decisions of all
    attachments, float64 (events, 8).
    """
    programs = len(program_blocks) - 1
    boxes = np.empty((block_parts[-1], 15))
    child, mirrored = np.empty(block_parts[-1], np.int64), np.empty(block_parts[-1], np.int64)
    status = np.zeros(programs, np.int64)
    program_nodes, program_leaves = np.zeros(programs + 1, np.int64), np.zeros(programs + 1, np.int64)
    block_events = np.zeros(len(block_rows), np.int64)
    for block in range(len(block_rows) - 1):
        lines = rows[block_rows[block] : block_rows[block + 1]]
        more = _count_events(lines, block_parts[block + 1] - block_parts[block])
        block_events[block + 1] = block_events[block] + max(more, 0)
        if more < 0:
            status[np.searchsorted(program_blocks, block, side="right") - 1] = TOO_MANY_EVENTS
    decisions = np.zeros((block_events[-1], 8))
    for program in range(programs):
        low, high = program_blocks[program], program_blocks[program + 1]
        nodes, cuboids = 0, 0
        if status[program] == OK:
            for block in range(low, high):
                own = slice(block_parts[block], block_parts[block + 1])
                lines = rows[block_rows[block] : block_rows[block + 1]]
                events = decisions[block_events[block] : block_events[block + 1]]
                _execute(lines, boxes[own], child[own], mirrored[own], events)
            own = slice(block_parts[low], block_parts[high])
            status[program], nodes, cuboids = _count_nodes(child[own], block_parts[low : high + 1])
        program_nodes[program + 1] = program_nodes[program] + nodes
        program_leaves[program + 1] = program_leaves[program] + cuboids
    node = np.empty((program_nodes[-1], 3), np.int64)
    leaves, corners = np.empty((program_leaves[-1], 15)), np.empty((program_leaves[-1], 8, 3))
    leaf_node, leaf_part = np.empty(program_leaves[-1], np.int64), np.empty(program_leaves[-1], np.int64)
    for program in range(programs):
        if status[program] != OK:
            continue
        low, high = program_blocks[program], program_blocks[program + 1]
        own = slice(block_parts[low], block_parts[high])
        inner = slice(program_nodes[program], program_nodes[program + 1])
        outer = slice(program_leaves[program], program_leaves[program + 1])
        status[program] = _place(
            boxes[own], child[own], mirrored[own], block_parts[low : high + 1],
            node[inner], leaves[outer], corners[outer], leaf_node[outer], leaf_part[outer],
        )  # fmt: skip
    executed = ExecutedTables(status, program_leaves, leaves, corners, leaf_node, leaf_part, program_nodes, node, boxes)
    return executed, block_events, decisions
