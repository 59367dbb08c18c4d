"""`make eval TABLE=decomposition a.glb`: are merged parts found again, and what can be exchanged? (symmetry)"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from pydantic import Field

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, Requirement, TableResult
from pipeline.config import StrictModel
from pipeline.errors import ConfigError

FILES = "models with known parts, as files: decomposition a.glb b.glb"


class DecompositionOptions(StrictModel):
    """How merged models are segmented."""

    segmentations: tuple[Literal["symmetry", "sections", "components"], ...] = Field(
        ("symmetry",), min_length=1, description="as exemplars.kits.parts"
    )


def _compute(run: DatasetRun, options: DecompositionOptions) -> TableResult:
    raise ConfigError(f"this table takes {FILES}")


def _compute_from_files(paths: Sequence[Path], options: DecompositionOptions, _: int) -> TableResult:
    from eval.engine.shapes import model_kits
    from eval.grammars.decomposition import decomposition_table
    from eval.grammars.grammar_recall import grammar_table
    from stages.shape.shape import kit_shape

    for path in paths:
        if not path.is_file():
            raise ConfigError(f"there is no file {path}")
    kits = [named for path in paths for named in model_kits(path, "y")]
    shapes = [(name, kit_shape(kit, kit.exemplars[0].assembly)) for name, kit in kits]
    return TableResult([decomposition_table(shapes, options.segmentations), grammar_table(kits)])


TABLE = Evaluation(
    question="Are the parts of merged models found again, and how much of their grammar?",
    requirements=(Requirement("model files", lambda run: f"it takes {FILES}"),),  # a minute or two each: not in `all`
    estimate_seconds=lambda run: 120.0,
    compute=_compute,
    compute_from_files=_compute_from_files,
    options=DecompositionOptions,
)
