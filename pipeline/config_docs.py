"""The keys of a config as Markdown pages, one per section, written from the models that validate them."""

from __future__ import annotations

import types
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import annotated_types
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from pipeline.config import DatasetFacts, StrictModel
from pipeline.paths import write_file
from pipeline.stage import Stage

HEADING = "\n## Keys\n"
"""Separates the hand-written part of a page from the generated part."""


def write_config_pages(folder: Path, stages: Mapping[str, Stage]) -> list[Path]:
    """Write the keys of every section into its page in `folder`; the text above them is kept.

    Returns the pages. Pages that are missing begin with their title alone.
    """
    pages = []
    for name, model in _sections(stages).items():
        page = folder / f"{name}.md"
        head = page.read_text(encoding="utf-8").partition(HEADING)[0] if page.exists() else f"# Section `{name}`\n"
        pages.append(write_file(page, f"{head}{HEADING}\n{section_table(name, model)}".encode()))
    return pages


def outdated_pages(folder: Path, stages: Mapping[str, Stage]) -> list[str]:
    """Return the names of sections whose page is missing or lists other keys than the models do."""
    names = []
    for name, model in _sections(stages).items():
        page = folder / f"{name}.md"
        keys = page.read_text(encoding="utf-8").partition(HEADING)[2] if page.exists() else ""
        if keys.lstrip("\n") != section_table(name, model):
            names.append(name)
    return names


def section_table(name: str, model: type[StrictModel]) -> str:
    """Return the keys of one section as a Markdown table; those of `dataset` have no prefix."""
    prefix = "" if model is DatasetFacts else f"{name}."
    rows = [f"| `{key}` | {kind} | {default} | {text} |" for key, kind, default, text in _rows(prefix, model)]
    return "\n".join(["| key | value | default | description |", "|---|---|---|---|", *rows]) + "\n"


def _sections(stages: Mapping[str, Stage]) -> dict[str, type[StrictModel]]:
    return {"dataset": DatasetFacts, **{name: stage.config for name, stage in stages.items()}}


def _rows(prefix: str, model: type[StrictModel]) -> Iterator[tuple[str, str, str, str]]:
    for name, field in model.model_fields.items():
        inner, many = _inner_models(field.annotation)
        key = f"{prefix}{name}{'[]' if many else ''}"
        text = (field.description or "").strip()
        yield key, _kind(field), "" if inner else _default(field), text[:1].upper() + text[1:]
        yield from _rows_of_any(f"{key}.", inner)


def _rows_of_any(prefix: str, models: Mapping[str, type[StrictModel]]) -> Iterator[tuple[str, str, str, str]]:
    """Yield the rows of alternative models, by the value of their discriminator: shared keys first."""
    rows = {kind: list(_rows(prefix, model)) for kind, model in models.items()}
    shared = [row for row in next(iter(rows.values()), []) if all(row in of_kind for of_kind in rows.values())]
    yield from shared
    for kind, of_kind in rows.items():
        for key, value, default, text in (row for row in of_kind if row not in shared):
            yield key, value, default, f"For `{kind}`: {text[:1].lower()}{text[1:]}"


def _inner_models(annotation: Any) -> tuple[dict[str, type[StrictModel]], bool]:
    """Return the section models that a key may hold, by the value of their discriminator, and whether in a list."""
    many = get_origin(annotation) in (tuple, list)
    inner = get_args(annotation)[0] if many else annotation
    metadata: Sequence[Any] = ()
    if get_origin(inner) is Annotated:
        inner, *metadata = get_args(inner)
    models = [kind for kind in (inner, *get_args(inner)) if isinstance(kind, type) and issubclass(kind, StrictModel)]
    discriminator = next((field.discriminator for field in metadata if isinstance(field, FieldInfo)), None)
    if not isinstance(discriminator, str):
        return ({"": models[0]}, many) if models else ({}, False)
    return {str(get_args(model.model_fields[discriminator].annotation)[0]): model for model in models}, many


def _kind(field: FieldInfo) -> str:
    """Return the type of a key and its range, in words."""
    return f"{_words(field.annotation)}{_bounds(field.metadata)}"


def _bounds(metadata: Sequence[Any]) -> str:
    """Return a range in words, after a comma; empty without one."""
    limits = {type(limit): limit for limit in metadata}
    low, high = "", ""
    for kind, sign in ((annotated_types.Ge, ">= "), (annotated_types.Gt, "> ")):
        if kind in limits:
            low = f"{sign}{getattr(limits[kind], kind.__name__.lower())}"
    for limit, sign in ((annotated_types.Le, "<= "), (annotated_types.Lt, "< ")):
        if limit in limits:
            high = f"{sign}{getattr(limits[limit], limit.__name__.lower())}"
    return "".join(f", {limit}" for limit in (low, high) if limit)


def _words(annotation: Any) -> str:
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _words(arguments[0]) + "".join(
            _bounds(field.metadata) for field in arguments if isinstance(field, FieldInfo)
        )
    if origin is Literal:
        return " or ".join(f"`{value}`" for value in arguments)
    if origin in (tuple, list):
        return f"list of {_words(arguments[0])}"
    if origin is dict:
        return f"names, each with {_words(arguments[1])}"
    if origin in (Union, types.UnionType):
        return " or ".join(dict.fromkeys(map(_words, arguments)))
    if annotation is type(None):
        return "nothing"
    if isinstance(annotation, type) and issubclass(annotation, StrictModel):
        return "keys below"
    plain = {int: "whole number", float: "number", str: "text", bool: "true or false", Path: "path"}
    return plain.get(annotation, str(annotation))


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True)
    if value is PydanticUndefined:
        return ""
    if isinstance(value, tuple):
        return ", ".join(f"`{_shown(item)}`" for item in value) or "none"
    return f"`{_shown(value)}`" if value != "" else "empty"


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return value.model_dump_json() if isinstance(value, StrictModel) else str(value)
