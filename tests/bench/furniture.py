"""Six pieces of furniture and a shop, by six makers, as one family by meaning: what they need to be put side by side.

Each is turned upright, its front towards -y, put on the ground and made one unit tall; their makers count their parts,
so what these mean is said here.
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
"""By how many degrees about the vertical each is turned."""
LYING = ("h10_shop_building",)
"""Those whose files have y up, not z."""
MEANINGS: dict[str, tuple[str, ...]] = {
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
"""What parts mean, coarsely: a handle is made of three parts in one, of one in another. Windows keep their names."""


def side_by_side(models: Sequence[Model]) -> list[Model]:
    """The models of the folders FURNITURE, upright, their fronts one way, on the ground, all of them one unit tall."""
    return [_placed(model, model.path.resolve().parent.name) for model in models]


def _placed(model: Model, name: str) -> Model:
    angle = np.deg2rad(FURNITURE[name])
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    if name in LYING:
        turn = turn @ np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    placed = [each.vertices @ (turn @ each.pose[:3, :3]).T + turn @ each.pose[:3, 3] for each in model.parts]
    low, high = (look([look(each, axis=0) for each in placed], axis=0) for look in (np.min, np.max))
    origin, size = np.array([*(low + high)[:2] / 2, low[2]]), high[2] - low[2]
    parts = []
    for part in model.parts:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = turn @ part.pose[:3, :3], (turn @ part.pose[:3, 3] - origin) / size
        parts.append(replace(part, pose=pose, vertices=part.vertices / size))
    return replace(model, parts=tuple(parts))
