"""Which of two faces in one plane is seen: every renderer sets the parts of higher layers back equally."""

from __future__ import annotations

from stages.shape.arrays import FloatArray
from stages.shape.views.camera import View
from stages.shape.views.scene import Scene

LAYER_STEP = 5e-5
"""How far each layer is set back, in radii of the shape: far above rounding, far below a pixel."""


def layered_moves(scene: Scene, view: View) -> FloatArray:
    """Return transforms from mesh coordinates to eye space, float64 (n, 4, 4), parts set back along the rays by layer.

    In perspective a part is scaled about the eye, so nothing moves on the screen.
    """
    moves: FloatArray = view.eye @ scene.placed
    back = LAYER_STEP * view.radius * scene.layers
    if view.perspective:
        moves[:, :3] *= (1.0 + back / view.depth)[:, None, None]
    else:
        moves[:, 2, 3] -= back
    return moves
