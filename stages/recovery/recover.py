"""Anything that looks like a shape of a program, back to its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import ConfigError
from stages.programs.parameters import Value
from stages.programs.program import Program, find_program, program_names
from stages.recovery.fitting import RecoveryFit, Up, best_fit, initial_estimate
from stages.recovery.outliers import find_outliers
from stages.recovery.reading import RecoveryInput, checked_cloud, ink_from_picture
from stages.recovery.refinement import RefinedShape, refine
from stages.shape.arrays import ByteArray, FloatArray
from stages.shape.views.camera import Camera
from stages.training.checkpoint import CheckpointError, weights_of_kind
from stages.training.recovery.estimate import ParameterEstimate
from stages.training.recovery.trained import RECOVERY_KIND, TrainedRecovery, load_recovery

PRETRAINED_FOLDER = Path(__file__).parents[2] / "datasets/exemplars/models"
"""Models that come with Shapemill; `ship.py` puts them there."""

UNLIKE = {"points": 0.004, "sketch": 0.001}
"""A shape that is farther from the input than this, and than chance would have it, is of another sort. Lines of a
drawing are everywhere, so that no other lines are far from them."""
NO_BETTER = 0.9
"""A recovery that is not nearer than this share of the base shape's distance says nothing of the input."""
PROGRAM_TRIAL_SHAPES = 40
"""Shapes that a program is given to show that it is the likeliest."""

RecoveryModels = Mapping[tuple[str, str], TrainedRecovery]
"""Trained models by program and kind of input, `points` or `sketch`."""


@dataclass(frozen=True)
class RecoveryResult:
    """program and values: what makes the shape. distance: mean squared distance between input and shape, both ways
    added, in longest sides of the box around the input (of a drawing: around its ink). base_distance: that of the
    program's base shape. missing: the share of the shape's surface that a torn cloud says nothing of, and which its
    distances leave out; 0 of a whole one and of a drawing. confidence: of each visible parameter the probability that
    the network gave to its value; None without a network. placement: float64 (4, 4), from the program's coordinates to
    the input's; None of a drawing. camera: from where a drawing is seen; None of a cloud. up: the axis of the input
    that points up. warnings: what speaks against the result, in words.
    """

    program: Program
    values: Mapping[str, Value]
    distance: float
    base_distance: float
    missing: float
    confidence: Mapping[str, float] | None
    placement: FloatArray | None
    camera: Camera | None
    up: str
    tried: int
    warnings: tuple[str, ...]

    def described(self) -> dict[str, Any]:
        """All of it as JSON; `parameters` is what `stages.programs make` reads."""
        schema = self.program.schema
        settled, visible = schema.canonical(self.values)
        return {
            "program": self.program.name,
            "parameters": {name: value for name, value in settled.items() if name in visible},
            "chamfer": self.distance,
            "chamfer_of_base": self.base_distance,
            "partial": self.missing > 0.0,
            "missing": round(self.missing, 3),
            "confidence": None if self.confidence is None else dict(self.confidence),
            "placement": None if self.placement is None else self.placement.tolist(),
            "camera": None if self.camera is None else asdict(self.camera),
            "up": self.up,
            "shapes_tried": self.tried,
            "warnings": list(self.warnings),
        }


def recover(
    source: FloatArray | ByteArray,
    program: str = "",
    models: RecoveryModels | None = None,
    up: Up = "",
    budget: int = 600,
    seed: int = 0,
) -> RecoveryResult:
    """The shape of a program that is most like a cloud, float (n, 3), or a drawing, uint8 (h, w) or (h, w, 3).

    A cloud may have any number of points, stand anywhere, be of any size and have any of its axes up (`up`; empty: the
    best of the three); its front looks along an axis. A drawing may be of any size, dark on light or light on dark.
    program: which; empty: the likeliest of those that come with Shapemill and those that `models` know. budget: shapes
    that are made for it at most, besides those that up and program are found with.

    Points that stand alone beside the shape are left out, and a warning says how many. Equal arguments have equal
    answers. Raises InputError for what is neither a cloud nor a drawing, ConfigError for a
    program that is not there.
    """
    if np.asarray(source).dtype == np.uint8:
        given = RecoveryInput("drawing", ink=ink_from_picture(np.asarray(source, np.uint8)))
    else:
        given = RecoveryInput("cloud", points=checked_cloud(source))
    return recover_input(given, program, models or {}, up, budget, seed)


def recover_input(
    given: RecoveryInput, program: str, models: RecoveryModels, up: Up, budget: int, seed: int, turned: bool = True
) -> RecoveryResult:
    """`recover` of what `read_inputs` has read. turned: whether the front of a cloud may look along any axis, and not
    only along the program's."""
    given, strays = _without_strays(given)
    kind = "points" if given.ink is None else "sketch"
    names = [program] if program else sorted({*program_names(), *(name for name, known in models if known == kind)})
    looks = [initial_estimate(find_program(name), models.get((name, kind)), given, up, turned, seed) for name in names]
    if len(looks) > 1:
        rng = np.random.default_rng(seed)
        glances = [
            refine(each.program, each.estimate, each.target, PROGRAM_TRIAL_SHAPES, rng).distance for each in looks
        ]
        looks = [looks[int(np.argmin(glances))]]
    fit = best_fit(looks[0], given, up, turned, budget, seed)
    return _told(fit, kind, strays, guessed_program=not program)


def _without_strays(given: RecoveryInput) -> tuple[RecoveryInput, int]:
    """A cloud without the points that lie beside it, and how many these are."""
    if given.points is None:
        return given, 0
    strays = find_outliers(given.points)
    return replace(given, points=given.points[~strays]), int(strays.sum())


def find_models(*folders: Path) -> tuple[dict[tuple[str, str], TrainedRecovery], list[str]]:
    """The recovery models in folders of published models, or, of a folder of datasets, in all of theirs. And what is
    wrong with others, in words.

    Of several for one program and input those of the folder that was named first, and of these the one that validated
    best, and no baseline: with SHIPPED last, weights that come with Shapemill serve where a user has trained none.
    """
    found: dict[tuple[str, str], TrainedRecovery] = {}
    wrong: list[str] = []
    for folder in folders:
        here = _models_in(folder, wrong)
        found = {**here, **found}
    return found, wrong


def _models_in(folder: Path, wrong: list[str]) -> dict[tuple[str, str], TrainedRecovery]:
    """The best models in one folder; adds to `wrong`."""
    found: dict[tuple[str, str], TrainedRecovery] = {}
    losses: dict[tuple[str, str], float] = {}
    for path in chain.from_iterable(
        weights_of_kind(each, RECOVERY_KIND) for each in (folder, *sorted(folder.glob("*-models")))
    ):
        try:
            model = load_recovery(path)
            if model.entry.is_baseline:
                continue
            key, loss = (model.header["program"], model.entry.input), float(model.header["figures"]["val_loss"])
        except CheckpointError as error:
            wrong.append(str(error))
        except (ConfigError, ImportError, LookupError, TypeError, ValueError, RuntimeError) as error:
            wrong.append(f"{path} cannot be used: {type(error).__name__}: {error}")
        else:
            if key not in found or loss < losses[key]:
                found[key], losses[key] = model, loss
    return found


def _told(fit: RecoveryFit, kind: str, strays: int, guessed_program: bool) -> RecoveryResult:
    """A fit, and what speaks against it."""
    look, refined, program = fit.initial, fit.refined, fit.initial.program
    warnings = []
    if guessed_program:
        warnings.append(f"no program was named: {program.name} fits best")
    if look.model is None:
        warnings.append(f"there is no trained model of {program.name} for {kind}: searched from its base shape alone")
    if strays:
        warnings.append(f"{strays:,} points of the cloud stand alone, beside the shape, and were left out")
    if fit.missing > 0.0:
        warnings.append(
            f"the cloud is partial: beyond its edge lies {fit.missing:.0%} of the shape that was found, of which the "
            "cloud says nothing; its parameters there are guesses"
        )
    limit = UNLIKE[kind] if look.model is None or kind == "sketch" else min(UNLIKE[kind], look.model.typical_distance)
    if fit.distance - fit.floor > limit:
        warnings.append(
            f"the input is unlike any {program.name}: the nearest that was found is {fit.distance:.2g} away, where "
            f"{fit.floor + limit:.2g} is much"
        )
    if fit.distance - fit.floor > NO_BETTER * (fit.base - fit.floor):
        warnings.append(f"the result is no better than the base shape of the program ({fit.base:.2g})")
    confidence = None if look.model is None else _confidence(program, look.estimate, refined)
    return RecoveryResult(
        program, refined.values, fit.distance, fit.base, fit.missing, confidence, fit.placement, fit.camera, look.up,
        fit.tried, tuple(warnings),
    )  # fmt: skip


def _confidence(program: Program, guess: ParameterEstimate, refined: RefinedShape) -> dict[str, float]:
    _, visible = program.schema.canonical(refined.values)
    return {
        each.name: round(float(guess.probabilities[each.name][each.class_of(refined.values[each.name])]), 4)
        for each in program.parameters
        if each.name in visible
    }
