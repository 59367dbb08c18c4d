"""Models and kits of blocks, made in code."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stages.exemplars.build import build_kit
from stages.exemplars.model import Model, RawPart
from stages.exemplars.settings import STRICTEST, KitConfig
from stages.shape.kit import Kit
from tests.stages.shape.geometry.bodies import Body, box, placed

CUBE = box()
SLAB = box(1, 1, 2)


def raw_part(name: str, body: Body, pose: np.ndarray, label: str | None = None) -> RawPart:
    vertices, faces = body
    colors = np.full((len(faces), 3), (190, 120, 70), dtype=np.uint8)
    return RawPart(name, name, label, pose, np.asarray(vertices, dtype=float), faces, colors)


def model(parts: Mapping[str, tuple[Body, Sequence[float]]], name: str = "blocks") -> Model:
    """Return a model with one part a name, each with its body and position."""
    parts_at = tuple(raw_part(key, body, placed(*at)) for key, (body, at) in parts.items())
    return Model(Path(f"{name}.glb"), parts_at, "nodes", f"{len(parts_at)} scene nodes", ())


def ring() -> Model:
    """Return four cubes around a square: neighbours share faces, opposite cubes an edge."""
    return model({f"cube.{k}": (CUBE, (k in (1, 2), k in (2, 3), 0)) for k in range(4)}, "ring")


def block_config(**settings: Any) -> KitConfig:
    """Return a resolved config of a kit whose models are passed in, so that no file is read."""
    return KitConfig.model_construct(
        **{key: field.get_default(call_default_factory=True) for key, field in KitConfig.model_fields.items()}
        | {"name": "blocks", "shapes": ()}
        | settings
    ).resolve(STRICTEST)


def block_kit(*models: Model, **settings: Any) -> Kit:
    return build_kit(block_config(**settings), models)[0]
