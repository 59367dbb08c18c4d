"""Tables whose parts go by meaning: tops and legs of several shapes."""

from __future__ import annotations

import trimesh

from stages.exemplars.build import build_kit
from stages.exemplars.model import Model
from stages.shape.kit import Kit
from tests.toy_kits.chains_and_rings import Placed, box, config_of, models_of, pose

SQUARE, ROUND, SHORT = box(0.2, 1.0, 0.2), trimesh.creation.cylinder(0.12, 1.0, sections=8), box(0.2, 0.5, 0.2)
ROUND.apply_transform(trimesh.transformations.rotation_matrix(1.5707963267948966, [1, 0, 0]))
THIN, THICK = box(2.0, 0.2, 2.0), box(2.0, 0.3, 2.0)


def table(top: trimesh.Trimesh, leg: trimesh.Trimesh, reach: float = 0.8) -> Model:
    """A top that lies on four legs at the corners of a square; y = 0 is where they meet."""
    height, thickness = leg.extents[1], top.extents[1]
    corners = [(x, z) for x in (-reach, reach) for z in (-reach, reach)]
    parts: list[Placed] = [("top", pose(0.0, thickness / 2, 0.0))]
    parts += [("leg", pose(x, -height / 2, z)) for x, z in corners]
    return models_of({"top": top, "leg": leg}, [parts])[0]


def table_kit(*tables: Model, types: str = "meaning", **changed: object) -> Kit:
    config = config_of([[] for _ in tables]).model_copy(update={"types": types, **changed})
    return build_kit(config, tables)[0]
