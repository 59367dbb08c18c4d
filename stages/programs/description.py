"""The recipe of a program for people: its parameters, groups and constraints as Markdown, from the schema alone."""

from __future__ import annotations

from collections.abc import Iterator

from stages.programs.parameters import Parameter, Value
from stages.programs.program import Program


def program_markdown(program: Program) -> str:
    """A section of Markdown: what the program makes, a table of parameters for each group, its constraints, its part
    labels. Ends with a newline."""
    return "\n".join(_lines(program)) + "\n"


def parameter_range(parameter: Parameter) -> str:
    """Range and values, such as `0.2 to 1.0 (9 values)`, `3 to 8`, `no or yes`."""
    if parameter.kind == "binary":
        return "no or yes"
    low, high = (value_text(parameter.values[each]) for each in (0, -1))
    return f"{low} to {high}" + (f" ({len(parameter.values)} values)" if parameter.kind == "continuous" else "")


def value_text(value: Value) -> str:
    """A value in as few letters as tell it: `no`, `4`, `0.6667`."""
    return ("no", "yes")[value] if isinstance(value, bool) else f"{float(value):.4g}"


def _lines(program: Program) -> Iterator[str]:
    schema = program.schema
    values = sum(len(each.values) for each in program.parameters)
    classes = sum(each.classes for each in program.parameters)
    yield f"### Program `{program.name}`"
    yield ""
    yield (
        f"{program.description} {len(program.parameters)} parameters with {values} values in all; {classes}"
        " classes where "
        "a hidden parameter counts as one more."
    )
    for group in schema.groups:
        yield ""
        yield f"#### {group[:1].upper()}{group[1:]}"
        yield ""
        yield "| parameter | kind | values | base | visible | what it does |"
        yield "|---|---|---|---|---|---|"
        for each in program.parameters:
            if each.group == group:
                visible = f"`{each.visible_if.text}`" if each.visible_if else "always"
                columns = [
                    f"`{each.name}`",
                    each.kind,
                    parameter_range(each),
                    value_text(each.base),
                    visible,
                    each.description,
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
        yield f"Parts that never meet: {', '.join(f'`{a}` and `{b}`' for a, b in program.non_intersecting)}."
    yield ""
    yield f"Part labels: {', '.join(f'`{label}`' for label in program.labels)}."
