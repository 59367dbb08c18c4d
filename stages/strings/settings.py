"""The `strings` section of a config."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from stages.shape.collection.optional_section import OptionalSection

Edges = Literal["all", "faces", "tree"]

EDGE_DESCRIPTIONS: dict[Edges, str] = {
    "all": "A string is a shape graph: every contact is an edge.",
    "faces": "A string is a shape graph of face contacts, with the line and point contacts that connect it; the other "
    "contacts are left out.",
    "tree": "A string is a spanning tree of a shape graph: every edge is a contact, but contacts that close cycles are "
    "left out. Random strings of a shape have random spanning trees.",
}
"""What a string of each kind encodes."""


class StringsConfig(OptionalSection):
    """Which strings each shape gets, and how many."""

    edges: Edges = Field(
        "all",
        description="contacts in a string: all; faces, with the line and point contacts that connect the shape; or "
        "tree, a spanning tree without contacts that close cycles. Strings of large shapes with many cycles are hard "
        "to learn; those of faces and trees are shorter",
    )

    strings_per_shape: int = Field(
        8,
        ge=0,
        le=10_000,
        description="distinct random strings of each shape, besides its canonical string; a small shape may have "
        "fewer; unit: strings",
    )
