"""Programs of one assembly, of the shapes of hierarchical ones."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.errors import Rejected
from stages.shapeassembly import execute, parse
from stages.shapeassembly.editing.flattening import without_hierarchy
from stages.shapeassembly.extraction.validity import box_f_score, execution_boxes
from stages.shapeassembly.syntax.checks import violations
from tests.stages.shapeassembly.editing.test_ablations import same_boxes
from tests.stages.shapeassembly.shared_programs import needs_shared, shared_texts

BENCH = """Assembly P { bbox = Cuboid(2.0, 1.0, 1.0, True)
Under = Cuboid(2.0, 0.9, 1.0, True) seat = Cuboid(2.0, 0.1, 1.0, True)
attach(Under, bbox, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5) attach(seat, Under, 0.5, 0.0, 0.5, 0.5, 1.0, 0.5) }
Assembly Under { bbox = Cuboid(2.0, 0.9, 1.0, True) leg = Cuboid(0.2, 0.9, 1.0, True)
bar = Cuboid(1.6, 0.1, 0.2, True) attach(leg, bbox, 0.5, 0.0, 0.5, 0.05, 0.0, 0.5)
attach(bar, leg, 0.0, 0.5, 0.5, 1.0, 0.5, 0.5) reflect(leg, X) }"""


def test_flattened_program_has_one_assembly_of_the_same_cuboids() -> None:
    program = parse(BENCH)
    flat = without_hierarchy(program)
    assert [len(value.blocks) for value in (program, flat)] == [2, 1]
    assert same_boxes(execute(program), execute(flat), 0.01)


def test_disconnected_shape_is_rejected() -> None:
    with pytest.raises(Rejected):
        without_hierarchy(
            parse(
                BENCH.replace("bar = Cuboid(1.6", "bar = Cuboid(0.4").replace(
                    "0.0, 0.5, 0.5, 1.0", "0.0, 0.5, 0.5, 3.0"
                )
            )
        )


@needs_shared
def test_flattened_real_programs_keep_their_shapes() -> None:
    texts = list(shared_texts("chair").values())[::200]
    kept = 0
    for program in map(parse, texts):
        try:
            flat = without_hierarchy(program)
        except Rejected:
            continue
        kept += 1
        assert len(flat.blocks) == 1
        assert not [violation for violation in violations(flat) if violation.rule != "size"]
        diagonal = float(np.linalg.norm(program.root.bbox.dims))
        assert box_f_score(execution_boxes(execute(flat)), execution_boxes(execute(program)), 0.03 * diagonal, 512) > 70
    assert kept >= 0.7 * len(texts)
