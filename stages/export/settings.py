"""What an export assumes and how it divides a shape into bodies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

DEFAULT_DENSITY = 600.0
"""Of wood, in kilograms a cubic metre."""
DEFAULT_SHELL_THICKNESS = 0.005


@dataclass(frozen=True)
class ExportSettings:
    """How shapes become bodies of a simulator.

    links: `parts`: each part is a link, held by fixed joints; `bodies`: parts that keep their places are one link
    density: of the material, in kilograms a cubic metre
    shell_thickness: thickness of the walls of open parts, in metres
    scale: length of the unit of the shape, in metres
    fixed_base: whether the shape is fixed to the world
    """

    links: Literal["parts", "bodies"] = "parts"
    density: float = DEFAULT_DENSITY
    shell_thickness: float = DEFAULT_SHELL_THICKNESS
    scale: float = 1.0
    fixed_base: bool = False
