from __future__ import annotations

from dataclasses import replace

from stages.programs.conditions import Condition
from stages.programs.description import program_markdown
from tests.stages.programs.stool import PROGRAM


def test_description_has_every_parameter_constraint_and_label() -> None:
    assert (
        program_markdown(PROGRAM)
        == """\
### Program `stool`

A stool of boxes, with or without a rail between its legs. 4 parameters with 24 values in all; 25 classes, with \
one more where a parameter can be hidden.

#### Seat

| parameter | kind | values | base | visible | what it does |
|---|---|---|---|---|---|
| `height` | continuous | 0.3 to 1 (8 values) | 0.6 | always | Height of the seat. |
| `scale x` | continuous | 0.4 to 1.1 (8 values) | 0.5 | always | Width of the seat. |

#### Rail

| parameter | kind | values | base | visible | what it does |
|---|---|---|---|---|---|
| `has_rail` | binary | no or yes | yes | always | Whether a rail joins the legs. |
| `rail_height` | continuous | 0.1 to 0.6 (6 values) | 0.3 | `has_rail` | Height of the rail. |

A shape is valid when

- `height >= rail_height`: A rail above the seat would hang in the air.

Parts that never intersect: `seat` and `rail`.

Part labels: `seat`, `leg`, `rail`.
"""
    )


def test_bar_in_a_description_does_not_end_its_column() -> None:
    barred = replace(PROGRAM.parameters[0], description="Low | high.")
    assert r"| Low \| high. |" in program_markdown(replace(PROGRAM, parameters=(barred, *PROGRAM.parameters[1:])))


def test_description_without_constraints_does_not_mention_them() -> None:
    free = program_markdown(replace(PROGRAM, constraints=(), non_intersecting=()))
    assert "valid when" not in free
    assert "never intersect" not in free
    assert Condition("has_rail").text in free
