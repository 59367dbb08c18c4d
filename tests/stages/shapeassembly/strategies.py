"""Random programs that keep every rule, from the grammar (shapeassembly table 1)."""

from __future__ import annotations

from hypothesis import strategies as st

from stages.shapeassembly.syntax.program import (
    AXES,
    BBOX,
    FACES,
    AssemblyProgram,
    Attach,
    Block,
    Cuboid,
    Line,
    Reflect,
    Squeeze,
    Translate,
)

SHARES = st.integers(0, 1000).map(lambda number: number / 1000)
SIZES = st.integers(20, 100).map(lambda number: number / 100)


@st.composite
def programs(draw: st.DrawFn, depth: int = 2, aligned: bool = False) -> AssemblyProgram:
    """Programs of at most `depth` levels; aligned: without cuboids that turn."""
    blocks: list[Block] = []
    size = (draw(SIZES) * 2, draw(SIZES) * 2, draw(SIZES) * 2)
    _draw_block(draw, blocks, size, depth, aligned)
    return AssemblyProgram(tuple(sorted(blocks, key=lambda block: int(block.name.partition("_")[2]))))


def _draw_block(
    draw: st.DrawFn, blocks: list[Block], size: tuple[float, float, float], depth: int, aligned: bool
) -> str:
    """Draw an assembly and those below it; its name."""
    name = f"Program_{len(blocks)}"
    place = len(blocks)
    bbox = Cuboid(BBOX, size, True)
    blocks.append(Block(name, bbox, ()))
    cuboids: list[Line] = []
    joints: list[Line] = []
    copies: list[Line] = []
    grounded = [BBOX]
    for number in range(draw(st.integers(1, 4))):
        dims = (draw(SIZES) * size[0], draw(SIZES) * size[1], draw(SIZES) * size[2])
        expanded = depth > 1 and draw(st.integers(0, 3)) == 0
        own = _draw_block(draw, blocks, dims, depth - 1, aligned) if expanded else f"cube{number}"
        cuboids.append(Cuboid(own, dims, aligned or draw(st.booleans())))
        joints += _draw_joints(draw, own, grounded)
        grounded.append(own)
    for own in draw(st.lists(st.sampled_from(grounded[1:]), max_size=2)):
        axis = draw(st.sampled_from(AXES))
        copies.append(Reflect(own, axis) if draw(st.booleans()) else Translate(own, axis, draw(COUNTS), draw(SHARES)))
    blocks[place] = Block(name, bbox, (*cuboids, *joints, *copies))
    return name


COUNTS = st.integers(1, 3)


def _draw_joints(draw: st.DrawFn, own: str, grounded: list[str]) -> list[Line]:
    if draw(st.integers(0, 3)) == 0:
        first, second = draw(st.sampled_from(grounded)), draw(st.sampled_from(grounded))
        free = BBOX not in (first, second) and first != second
        face = draw(st.sampled_from(FACES if free else FACES[2:4]))
        if first != second or first == BBOX:
            return [Squeeze(own, first, second, face, draw(SHARES), draw(SHARES))]
    targets = draw(st.lists(st.sampled_from(grounded), min_size=1, max_size=3, unique=True))
    return [_draw_attach(draw, own, target) for target in targets]


def _draw_attach(draw: st.DrawFn, own: str, target: str) -> Attach:
    source = (draw(SHARES), draw(SHARES), draw(SHARES))
    height = draw(st.sampled_from([0.0, 1.0])) if target == BBOX else draw(SHARES)
    return Attach(own, target, source, (draw(SHARES), height, draw(SHARES)))
