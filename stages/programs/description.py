"""The description of a program for people: parameters, groups and constraints as Markdown."""

from __future__ import annotations

from collections.abc import Iterator

from stages.programs.parameters import Parameter, Value
from stages.programs.program import Program


def program_markdown(program: Program) -> str:
    """A section of Markdown: purpose, a table of parameters for each group, constraints, part labels."""
    return "\n".join(_lines(program)) + "\n"


def parameter_range(parameter: Parameter) -> str:
    """Range and number of values, such as `0.2 to 1.0 (9 values)`, `3 to 8`, `no or yes`."""
    if parameter.kind == "binary":
        return "no or yes"
    low, high = value_text(parameter.values[0]), value_text(parameter.values[-1])
    return f"{low} to {high}" + (f" ({len(parameter.values)} values)" if parameter.kind == "continuous" else "")


def value_text(value: Value) -> str:
    """A short text of a value: `no`, `4`, `0.6667`."""
    return ("no", "yes")[value] if isinstance(value, bool) else f"{float(value):.4g}"


def _lines(program: Program) -> Iterator[str]:
    schema = program.schema
    values = sum(len(parameter.values) for parameter in program.parameters)
    classes = sum(parameter.classes for parameter in program.parameters)
    yield f"### Program `{program.name}`"
    yield ""
    yield (
        f"{program.description} {len(program.parameters)} parameters with {values} values in all; {classes} "
        "classes, with one more where a parameter can be hidden."
    )
    for group in schema.groups:
        yield ""
        yield f"#### {group[:1].upper()}{group[1:]}"
        yield ""
        yield "| parameter | kind | values | base | visible | what it does |"
        yield "|---|---|---|---|---|---|"
        for parameter in program.parameters:
            if parameter.group == group:
                columns = [
                    f"`{parameter.name}`",
                    parameter.kind,
                    parameter_range(parameter),
                    value_text(parameter.base),
                    f"`{parameter.visible_if.text}`" if parameter.visible_if else "always",
                    parameter.description,
                ]
                yield "| " + " | ".join(column.replace("|", "\\|") for column in columns) + " |"
    if program.constraints:
        yield ""
        yield "A shape is valid when"
        yield ""
        for constraint in program.constraints:
            yield f"- `{constraint.condition.text}`: {constraint.description}"
    if program.non_intersecting:
        yield ""
        yield f"Parts that never intersect: {', '.join(f'`{a}` and `{b}`' for a, b in program.non_intersecting)}."
    yield ""
    yield f"Part labels: {', '.join(f'`{label}`' for label in program.labels)}."
