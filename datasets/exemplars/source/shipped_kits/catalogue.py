"""The shipped kits by name, and the files that hold their shapes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from pipeline.paths import write_file
from shipped_kits import castle, facade, playground, rows, space_base, temple
from shipped_kits.kit_shape import KitShape, glb_bytes

KITS: Mapping[str, Callable[[], dict[str, KitShape]]] = {
    "castle": castle.shapes,
    "playground": playground.shapes,
    "space-base": space_base.shapes,
    "temple": temple.shapes,
}


SINGLE_MODELS: Mapping[str, Callable[[], dict[str, KitShape]]] = {"rows": rows.shapes}
"""Models that share no parts: each is a kit by itself."""

MESHES: Mapping[str, Callable[[], dict[str, KitShape]]] = {"facade": facade.shapes}
"""Shapes that are one mesh without parts."""


def write_kits(out: Path) -> list[Path]:
    """Write every shape of every kit, every single model and every mesh as `<out>/<kit>/<shape>.glb`; return the paths.

    The bytes are the same each time.
    """
    written = []
    for kit, shapes in {**KITS, **SINGLE_MODELS, **MESHES}.items():
        for name, shape in shapes().items():
            written.append(write_file(out / kit / f"{name}.glb", glb_bytes(shape)))
    return written
