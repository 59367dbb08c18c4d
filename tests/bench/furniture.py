"""Models of furniture and a shop, by six makers, as one family with types by meaning.

They are turned upright, the front towards -y, placed on the ground and scaled to height 1. Their parts have numbers
and no names, so their meanings are listed here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stages.exemplars.model import Model

FURNITURE = {
    "h01_wooden_cabinet": 0,
    "h03_kitchen_cabinet": -90,
    "h04_bookcase_expedit_0376": 0,
    "h06_table_hemnes_0541": 0,
    "h09_chair_ivar_0668": 0,
    "h10_shop_building": -90,
}
"""Rotation about the vertical, in degrees, by model."""
Y_UP_MODELS = ("h10_shop_building",)
"""Models whose files have y up, not z."""
PATTERNS_BY_MEANING: dict[str, tuple[str, ...]] = {
    "body": (
        "h01*/type0[0-5].*", "h03*/sektion.*", "h04*/*", "h06*/type00.*", "h06*/type0[2345].*", "h09*/type0[04].*",
        "h10*/type0[01245].*",
    ),
    "drawer": (
        "h01*/type0[6789].*", "h01*/type10.*", "h03*/drawer.*", "h03*/door_right.*", "h03*/door_left.*",
        "h06*/type01.*", "h06*/type09.*",
    ),
    "handle": ("h01*/type1[123].*", "h03*/drawer_handle.*", "h03*/door_*_nob.*"),
    "leg": ("h06*/type0[678].*", "h06*/type10.*"),
    "seat": ("h09*/type01.*",),
    "rail": ("h09*/type0[23].*",),
}  # fmt: skip
"""Patterns of parts by meaning. Windows keep their names."""


def side_by_side(models: Sequence[Model]) -> list[Model]:
    """Return the models of the folders FURNITURE, upright, with equal fronts, on the ground and of height 1."""
    return [_placed(model, model.path.resolve().parent.name) for model in models]


def _placed(model: Model, name: str) -> Model:
    angle = np.deg2rad(FURNITURE[name])
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    if name in Y_UP_MODELS:
        turn = turn @ np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    placed = [part.vertices @ (turn @ part.pose[:3, :3]).T + turn @ part.pose[:3, 3] for part in model.parts]
    low, high = (extreme([extreme(points, axis=0) for points in placed], axis=0) for extreme in (np.min, np.max))
    origin, size = np.array([*(low + high)[:2] / 2, low[2]]), high[2] - low[2]
    parts = []
    for part in model.parts:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = turn @ part.pose[:3, :3], (turn @ part.pose[:3, 3] - origin) / size
        parts.append(replace(part, pose=pose, vertices=part.vertices / size))
    return replace(model, parts=tuple(parts))
