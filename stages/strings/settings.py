"""The config of stage `strings`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pipeline.config import StrictModel

Edges = Literal["all", "faces", "tree"]

EDGE_DESCRIPTIONS: dict[Edges, str] = {
    "all": "A string is a shape graph: every contact is an edge.",
    "faces": "A string is a shape graph of face contacts, and of as many lines and points besides as hold the shape in "
    "one piece; the other contacts are not in it.",
    "tree": "A string is a spanning tree of a shape graph: parts stand as they did, and every edge is a contact, but "
    "contacts that close cycles are not in it. Random strings of a shape are of random spanning trees.",
}
"""What a string of each kind stands for once it is decoded."""


class StringsConfig(StrictModel):
    """Which strings each shape gets, and how many."""

    edges: Edges = Field(
        "all",
        description="which contacts a string tells of: all; faces, with as many lines and points besides as hold the "
        "shape in one piece; or tree, a spanning tree alone, without the contacts that close cycles. Strings of large "
        "shapes with many cycles are hard to learn, and faces and trees are shorter",
    )

    strings_per_shape: int = Field(
        8,
        ge=0,
        le=10_000,
        description="distinct random strings of each shape, besides its canonical string; a small shape may have "
        "fewer; unit: strings",
    )
