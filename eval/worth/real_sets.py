"""Real shapes with parts: published programs, GRASS chairs, and the models of a folder."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import ConfigError
from pipeline.randomness import decision_rng
from stages.exemplars.settings import Segmentation
from stages.training.point_encoder.clouds import LEARNT_POINTS, LabelledClouds

CATEGORIES = {"chair": "chairs", "table": "tables", "storage": "storage furniture"}
"""Of the published programs, and what their shapes are called."""
PROGRAMS, GRASS = Path("shapeassembly/programs.tar.xz"), Path("partgraphs/grass_chairs.npz")
"""Below the folder of shared material."""
MIN_MODELS = 2
TESTED_POINTS = 1024
"""Points of a tested cloud."""


@dataclass(frozen=True)
class RealSet:
    """Real shapes of one kind.

    category: of the published programs; empty for models.
    files: all files that its clouds depend on.
    read: returns the shapes to test on, others to learn from, and a sentence on what was left out, or an empty text.
    """

    name: str
    category: str
    files: tuple[Path, ...]
    read: Callable[[], tuple[LabelledClouds, LabelledClouds, str]]


def real_sets(
    shared: Path, models: Path | None, segmentation: Segmentation, test_shapes: int, labelled: int, seed: int
) -> list[RealSet]:
    """Return the real sets that exist.

    test_shapes, labelled: shapes to test on and to learn from, at most.
    Raises ConfigError for a folder of models that does not exist or holds fewer than two.
    """
    sets = []
    if (archive := shared / PROGRAMS).is_file():
        sets += [_program_set(archive, category, test_shapes, labelled, seed) for category in CATEGORIES]
    if (file := shared / GRASS).is_file():
        sets.append(_grass_set(file, test_shapes, labelled, seed))
    if models is not None:
        sets.append(_model_set(models, segmentation, test_shapes, labelled, seed))
    return sets


def real_training_clouds(archive: Path, without: str, shapes: int, seed: int) -> LabelledClouds:
    """Return clouds of `shapes` published training programs, equally many of each category but one."""
    from eval.worth.labelled_clouds import program_clouds

    others = [category for category in CATEGORIES if category != without]
    rng = decision_rng(seed, "worth", "real", without)
    return LabelledClouds.joined(
        [program_clouds(archive, other, "train", shapes // len(others), LEARNT_POINTS, rng) for other in others]
    )


def _program_set(archive: Path, category: str, test_shapes: int, labelled: int, seed: int) -> RealSet:
    def read() -> tuple[LabelledClouds, LabelledClouds, str]:
        from eval.worth.labelled_clouds import program_clouds

        rng = decision_rng(seed, "worth", "programs", category)
        tested = program_clouds(archive, category, "val", test_shapes, TESTED_POINTS, rng)
        return tested, program_clouds(archive, category, "train", labelled, LEARNT_POINTS, rng), ""

    return RealSet(category, category, (archive,), read)


def _grass_set(file: Path, test_shapes: int, labelled: int, seed: int) -> RealSet:
    def read() -> tuple[LabelledClouds, LabelledClouds, str]:
        from eval.worth.labelled_clouds import grass_clouds

        clouds = grass_clouds(file, test_shapes + labelled, LEARNT_POINTS, decision_rng(seed, "worth", "grass"))
        return (*clouds.divided(test_shapes, TESTED_POINTS), "")

    return RealSet("GRASS chair", "chair", (file,), read)


def _model_set(folder: Path, segmentation: Segmentation, test_shapes: int, labelled: int, seed: int) -> RealSet:
    from stages.model_files.folder import model_files

    files = model_files(folder)
    if len(files) < MIN_MODELS:
        raise ConfigError(f"{folder} holds {len(files)} models to test on; name a folder of at least {MIN_MODELS}")

    def read() -> tuple[LabelledClouds, LabelledClouds, str]:
        from eval.worth.labelled_clouds import model_clouds

        rng = decision_rng(seed, "worth", "models")
        clouds, skipped = model_clouds(files, segmentation, test_shapes + labelled, LEARNT_POINTS, rng)
        note = (
            f"{folder}: {len(clouds)} of {len(files)} models were taken; {skipped.unreadable} others cannot be read, "
            f"and {skipped.without_parts} have no parts."
        )
        learnt = min(labelled, len(clouds) // 2)
        return (*clouds.divided(min(test_shapes, len(clouds) - learnt), TESTED_POINTS), note)

    return RealSet(folder.name or str(folder), "", tuple(files), read)
