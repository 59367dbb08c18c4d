"""`make eval TABLE=radius_sweep a.glb`: how does the radius of similarity change a grammar? (symmetry figure 10 j)"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from pydantic import Field

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, Requirement, TableResult
from pipeline.config import StrictModel
from pipeline.errors import ConfigError

FILES = "a model as a file: radius_sweep a.glb"


class RadiusSweepOptions(StrictModel):
    """How grammars are extracted."""

    radii: tuple[float, ...] = Field(
        (0.008, 0.016, 0.032, 0.064), min_length=1, description="radii of similarity, in longest sides"
    )
    up: Literal["y", "z"] = Field("y", description="the axis that points up in the files")


def _compute(run: DatasetRun, options: RadiusSweepOptions) -> TableResult:
    raise ConfigError(f"this table takes {FILES}")


def _compute_from_files(paths: Sequence[Path], options: RadiusSweepOptions, _: int) -> TableResult:
    from eval.grammars.radius_sweep import extractions, radius_figure, radius_table
    from stages.grammars.settings import MAX_RADIUS_SHARE, MIN_RADIUS_SHARE

    for path in paths:
        if not path.is_file():
            raise ConfigError(f"there is no file {path}")
    for radius in options.radii:
        if not MIN_RADIUS_SHARE <= radius <= MAX_RADIUS_SHARE:
            raise ConfigError(
                f"radii: {radius:g} is not from {MIN_RADIUS_SHARE:g} to {MAX_RADIUS_SHARE:g} longest sides"
            )
    extracted = {path: extractions(path, sorted(options.radii), options.up) for path in paths}
    return TableResult(
        [radius_table(by_radius) for by_radius in extracted.values()],
        figures=[radius_figure(path, by_radius) for path, by_radius in extracted.items()],
    )


TABLE = Evaluation(
    question="How does the radius of similarity change the grammar of a mesh?",
    requirements=(Requirement("a model file", lambda run: f"it takes {FILES}"),),  # a minute or two: not in `all`
    estimate_seconds=lambda run: 120.0,
    compute=_compute,
    compute_from_files=_compute_from_files,
    options=RadiusSweepOptions,
)
