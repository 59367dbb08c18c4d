"""Recover the parameters of a program from a cloud or a drawing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stages.programs.program import find_program, program_names
from stages.recovery.fitting import best_fit
from stages.recovery.initial_estimate import Up, initial_estimate
from stages.recovery.inputs import RecoveryInput, checked_cloud, ink_from_picture
from stages.recovery.outliers import find_outliers
from stages.recovery.refinement import refine_estimate
from stages.recovery.result import RecoveryResult, recovery_result
from stages.shape.arrays import ByteArray, FloatArray
from stages.training.recovery.trained import RecoveryModels

PROGRAM_TRIAL_SHAPES = 40
"""Shapes built of each program to find the likeliest."""


def recover(
    source: FloatArray | ByteArray,
    program: str = "",
    models: RecoveryModels | None = None,
    up: Up = "",
    budget: int = 600,
    seed: int = 0,
) -> RecoveryResult:
    """Find the shape of a program that is most like a cloud or a drawing. Equal arguments give equal results.

    source: a cloud, float (n, 3), of any size, position and number of points; or a drawing, uint8 (h, w) or (h, w, 3),
    of any size, dark on light or light on dark. Outliers of a cloud are left out, with a warning.
    program: its name; empty: the likeliest of Shapemill's programs and those of `models`
    models: by program and kind of input, see `find_models`
    up: the axis of a cloud that points up; empty: the best of the three. The front points along another axis.
    budget: most shapes that are built, besides those for finding axes and program

    Raises InputError for a source that is neither, ConfigError for an unknown program.
    """
    if np.asarray(source).dtype == np.uint8:
        checked = RecoveryInput("drawing", ink=ink_from_picture(np.asarray(source, np.uint8)))
    else:
        checked = RecoveryInput("cloud", points=checked_cloud(source))
    return recover_input(checked, program, models or {}, up, budget, seed)


def recover_input(
    source: RecoveryInput, program: str, models: RecoveryModels, up: Up, budget: int, seed: int, turned: bool = True
) -> RecoveryResult:
    """`recover` for an input from `read_inputs`. turned: whether the front of a cloud may point along any axis."""
    source, outliers = _without_outliers(source)
    kind = "points" if source.points is not None else "sketch"
    names = [program] if program else sorted({*program_names(), *(name for name, known in models if known == kind)})
    initials = [
        initial_estimate(find_program(name), models.get((name, kind)), source, up, turned, seed) for name in names
    ]
    if len(initials) > 1:
        rng = np.random.default_rng(seed)
        distances = [
            refine_estimate(initial.program, initial.estimate, initial.target, PROGRAM_TRIAL_SHAPES, rng).distance
            for initial in initials
        ]
        initials = [initials[int(np.argmin(distances))]]
    fit = best_fit(initials[0], source, up, turned, budget, seed)
    result = recovery_result(fit, kind, outliers, program_named=bool(program))
    return replace(result, warnings=(*source.warnings, *result.warnings))


def _without_outliers(source: RecoveryInput) -> tuple[RecoveryInput, int]:
    """A cloud without its outliers, and their number."""
    if source.points is None:
        return source, 0
    outliers = find_outliers(source.points)
    return replace(source, points=source.points[~outliers]), int(outliers.sum())
