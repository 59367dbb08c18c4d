"""Programs as models learn them that are to do without a part of the language."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from stages.shapeassembly import parse
from stages.shapeassembly.syntax.program import Attach, Cuboid
from stages.training.program_vae.corpus import ablate_program
from stages.training.program_vae.lines import ALIGNED, CUBOID, assembly_lines
from stages.training.program_vae.settings import Ablation, ProgramVaeConfig
from tests.stages.shapeassembly.editing.test_flattening import BENCH

PROGRAM = parse(BENCH)


@pytest.mark.parametrize("without", get_args(Ablation))
def test_ablated_programs_lack_the_part_of_the_language(without: Ablation) -> None:
    found = ablate_program(PROGRAM, without, np.random.default_rng(0))
    nodes = assembly_lines(found)
    kinds = {type(line) for block in found.blocks for line in block.lines}
    assert (found == PROGRAM) == (without == "nothing") or without == "order"
    assert (len(nodes) == 1) == (without == "hierarchy")
    assert (kinds == {Cuboid, Attach}) == (without == "macros")
    aligned = any(((node.numbers[:, CUBOID] == 1) & (node.numbers[:, ALIGNED][:, 0] == 1)).any() for node in nodes)
    assert aligned == (without != "align")


def test_random_order_depends_on_the_generator_alone() -> None:
    shuffled = [ablate_program(PROGRAM, "order", np.random.default_rng(seed)) for seed in (1, 1, *range(2, 9))]
    assert shuffled[0] == shuffled[1]
    assert any(item != shuffled[0] for item in shuffled)


def test_models_with_equal_ablation_share_prepared_samples() -> None:
    def entry(without: Ablation) -> ProgramVaeConfig:
        return ProgramVaeConfig(name="any", kind="program_vae", ablate=without)

    assert entry("nothing").prepared == {}
    assert entry("macros").prepared == {"ablate": "macros"}
