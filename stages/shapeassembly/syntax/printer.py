"""Print a program as canonical text, and round its numbers."""

from __future__ import annotations

from dataclasses import replace

from stages.shapeassembly.syntax.program import AssemblyProgram, Attach, Block, Cuboid, Line, Point, Reflect, Squeeze

PRINTED_DECIMALS = 3


def print_program(program: AssemblyProgram) -> str:
    """Return the canonical text: one line a line, one tab of indent, the shortest digits that read back exactly.

    `parse(print_program(p)) == p` for every program.
    """
    return "".join(_print_block(block) for block in program.blocks)


def _print_block(block: Block) -> str:
    lines = "".join(f"\t{print_line(line)}\n" for line in (block.bbox, *block.lines))
    return f"Assembly {block.name} {{\n{lines}}}\n"


def print_line(line: Line) -> str:
    """Return one line of a program, without indent."""
    if isinstance(line, Cuboid):
        return f"{line.name} = Cuboid({_numbers(line.dims)}, {line.aligned})"
    if isinstance(line, Attach):
        return f"attach({line.moved}, {line.target}, {_numbers(line.source)}, {_numbers(line.goal)})"
    if isinstance(line, Squeeze):
        return f"squeeze({line.moved}, {line.first}, {line.second}, {line.face}, {line.u!r}, {line.v!r})"
    if isinstance(line, Reflect):
        return f"reflect({line.moved}, {line.axis})"
    return f"translate({line.moved}, {line.axis}, {line.copies}, {line.distance!r})"


def rounded_program(program: AssemblyProgram) -> AssemblyProgram:
    """Round every number to three decimals, as in the published programs."""
    return program.with_lines(_rounded)


def _rounded(line: Line) -> Line:
    if isinstance(line, Cuboid):
        return replace(line, dims=_round(line.dims))
    if isinstance(line, Attach):
        return replace(line, source=_round(line.source), goal=_round(line.goal))
    if isinstance(line, Squeeze):
        return replace(line, u=round(line.u, PRINTED_DECIMALS), v=round(line.v, PRINTED_DECIMALS))
    if isinstance(line, Reflect):
        return line
    return replace(line, distance=round(line.distance, PRINTED_DECIMALS))


def _numbers(point: Point) -> str:
    return f"{point[0]!r}, {point[1]!r}, {point[2]!r}"


def _round(point: Point) -> Point:
    x, y, z = point
    return (round(x, PRINTED_DECIMALS), round(y, PRINTED_DECIMALS), round(z, PRINTED_DECIMALS))
