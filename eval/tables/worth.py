"""`make eval TABLE=worth`: does a network that learns from a dataset do better on real shapes?"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import Field

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, TableResult
from eval.engine.requirements import FINISHED_DATASET
from eval.engine.results_cache import TableSection, cached_sections
from eval.engine.table import Table
from pipeline.config import StrictModel
from pipeline.errors import ConfigError
from stages.exemplars.settings import Segmentation
from stages.package.reader import Dataset
from stages.training.point_encoder.settings import Augmentation

if TYPE_CHECKING:
    from stages.training.point_encoder.clouds import LabelledClouds

SECONDS_PER_STEP = 0.15
NETWORKS_OF_A_SEED = 5
"""Of random weights, the dataset, and real shapes without one category."""


class WorthOptions(StrictModel):
    """What is learned from, how long, and what it is tested on."""

    datasets: tuple[Path, ...] = Field((), description="folders of other finished datasets, one row each")
    models: Path | None = Field(None, description="folder of labelled models to test on, too")
    parts: Segmentation = Field("auto", description="what a part of these models is, as in exemplars.kits[].parts")
    shared: Path = Field(Path("../shared"), description="folder of the published programs and GRASS chairs")
    shapes: int = Field(1000, ge=8, description="training shapes of each dataset")
    steps: int = Field(900, ge=1, description="steps of pre-training")
    labelled: tuple[int, ...] = Field((0, 10), description="labelled real shapes to learn from in the end")
    labelled_steps: int = Field(150, ge=1, description="steps of learning from labelled real shapes")
    test_shapes: int = Field(100, ge=2, description="shapes of each test set")
    seeds: int = Field(2, ge=1, description="repeated trainings")
    augmentation: tuple[Augmentation, ...] = Field((), description="ways of augmentation in pre-training")


OPTIONS_OF_A_ROW = tuple(name for name in WorthOptions.model_fields if name != "datasets")


def _sections(run: DatasetRun, options: WorthOptions) -> Iterator[TableSection]:
    """Yield a section for each row: two references, each dataset, and real shapes of other categories."""
    from eval.worth.real_sets import CATEGORIES, PROGRAMS, real_sets, real_training_clouds
    from eval.worth.rows import Training, distance_tables, network_tables

    seed, archive = run.config.seed, options.shared / PROGRAMS
    sets = real_sets(
        options.shared, options.models, options.parts, options.test_shapes, max(options.labelled, default=0), seed
    )
    if not sets:
        yield TableSection("no real shapes", (), partial(_no_real_shapes, options))
        return
    real_files = [file for real in sets for file in real.files]
    training = Training(
        options.steps, options.labelled, options.labelled_steps, options.seeds, options.augmentation, seed
    )

    def section(name: str, files: list[Path], tables: Callable[[], list[Table]]) -> TableSection:
        return TableSection(name, [*real_files, *files], lambda: TableResult(tables()), (), OPTIONS_OF_A_ROW)

    yield section("distance of points", [], partial(distance_tables, sets))
    yield section("random weights", [], partial(network_tables, "random weights", None, sets, sets, training))
    for folder in _folders(run, options):
        read = partial(_training_clouds, folder, options.shapes, seed)
        tables = partial(network_tables, folder.name, read, sets, sets, training)
        yield section(folder.name, [folder / "checksums.txt"], tables)
    for category, plural in CATEGORIES.items() if archive.is_file() else ():
        name = f"real furniture without {plural}"
        read = partial(real_training_clouds, archive, category, options.shapes, seed)
        tested = [real for real in sets if real.category in (category, "")]
        yield section(name, [archive], partial(network_tables, name, read, tested, sets, training))


def _no_real_shapes(options: WorthOptions) -> TableResult:
    note = (
        f"There are no real shapes to test on: {options.shared} holds neither the published programs nor GRASS chairs. "
        "Name a folder of labelled models: --set models=FOLDER."
    )
    return TableResult([Table("Worth on real shapes", ("learnt from", "shapes"), (), (note,))])


def _folders(run: DatasetRun, options: WorthOptions) -> list[Path]:
    """Return the folders of the datasets. Raises ConfigError for one without dataset, and where two have one name."""
    folders = [run.folder, *options.datasets]
    for folder in folders:
        Dataset.open(folder)
    names = [folder.name for folder in folders]
    if repeated := sorted({name for name in names if names.count(name) > 1}):
        raise ConfigError(f"two datasets are in folders called {repeated[0]}; rename one: rows go by these names")
    return folders


def _training_clouds(folder: Path, shapes: int, seed: int) -> LabelledClouds:
    from eval.worth.labelled_clouds import labelled_dataset_clouds
    from pipeline.randomness import decision_rng
    from stages.training.point_encoder.clouds import LEARNT_POINTS

    return labelled_dataset_clouds(folder, shapes, LEARNT_POINTS, decision_rng(seed, "worth", "dataset", folder.name))


def _estimate_seconds(run: DatasetRun) -> float:
    """Return the seconds of the rows at the default options."""
    options = WorthOptions()
    steps = options.steps + 4 * options.labelled_steps * sum(count > 0 for count in options.labelled)
    return NETWORKS_OF_A_SEED * options.seeds * steps * SECONDS_PER_STEP


TABLE = Evaluation(
    question="Does a network that learns from the dataset tell the parts of real shapes apart?",
    requirements=(FINISHED_DATASET,),
    estimate_seconds=_estimate_seconds,
    compute=cached_sections(_sections),
    options=WorthOptions,
    in_report=False,
)
