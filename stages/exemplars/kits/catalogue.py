"""The shipped kits by name, and the files that hold their shapes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from pipeline.places import write_file
from stages.exemplars.kits import castle, facade, playground, space_base, temple
from stages.exemplars.kits.layout import Layout, glb_bytes

__all__ = ["KITS", "write_kits"]

KITS: Mapping[str, Callable[[], dict[str, Layout]]] = {
    "castle": castle.shapes,
    "facade": facade.shapes,
    "playground": playground.shapes,
    "space-base": space_base.shapes,
    "temple": temple.shapes,
}


def write_kits(out: Path) -> list[Path]:
    """Every shape of every kit as `<out>/<kit>/<shape>.glb`, the same bytes each time; the paths written."""
    written = []
    for kit, shapes in KITS.items():
        for shape, layout in shapes().items():
            written.append(write_file(out / kit / f"{shape}.glb", glb_bytes(layout)))
    return written
