"""`make eval`: prints a table about a dataset or about files, and keeps it as Markdown, CSV and LaTeX.

python -m eval physical [--config YAML] [--out FOLDER] [--most N] [--dry N] [--up y|z] [FILE...]
python -m eval near_twins [--config YAML] [--out FOLDER]

FILE is a model (GLB, OBJ, ...) or an `.npz` of boxes; without any, the finished dataset of the config is measured. The
table is written to `OUT/<dataset>-eval/<table>.md`, `.csv` and `.tex`; of files it is only printed.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator
from pathlib import Path

from eval.table import Table

__all__ = ["main"]

TABLES = ("physical", "near_twins")


def main(arguments: list[str]) -> int:
    """Print the table that the arguments ask for; 0, or 2 with a message where there is nothing to measure."""
    parser = argparse.ArgumentParser(prog="python -m eval", description="Tables about datasets.")
    parser.add_argument("table", choices=TABLES)
    parser.add_argument("--config", type=Path, default=Path("configs/default.yaml"), help="the dataset's YAML")
    parser.add_argument("--out", type=Path, default=Path("datasets"), help="folder that datasets are made in")
    parser.add_argument("--most", type=int, default=200, help="so many shapes of a dataset are measured at most")
    parser.add_argument("--dry", type=int, default=10, help="so many of a kind at most are judged as dry blocks, too")
    parser.add_argument("--up", choices=("y", "z"), default="y", help="the axis that points up in the files")
    parser.add_argument("files", nargs="*", type=Path, help="models or boxes instead of the dataset")
    asked = parser.parse_args(arguments)
    if asked.most < 1:
        parser.error("--most must be at least 1")
    if asked.dry < 0:
        parser.error("--dry must not be negative")
    # Solvers of small systems on a busy machine: threads that wait for each other take a hundred times as long.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from pipeline.errors import ConfigError

    try:
        return _physical(asked) if asked.table == "physical" else _near_twins(asked)
    except ConfigError as error:
        print(error, file=sys.stderr)
        return 2


def _physical(asked: argparse.Namespace) -> int:
    from eval.physical import PUBLISHED, physical_table
    from eval.shapes import box_shapes, dataset_shapes, model_shapes
    from pipeline.config import load_config
    from pipeline.errors import ConfigError
    from pipeline.registry import find_stages
    from stages.shape.physics.settings import PhysicsConfig
    from stages.shape.shape import Shape

    def of_files() -> Iterator[tuple[str, Shape]]:
        for path in asked.files:
            if not path.is_file():
                raise ConfigError(f"there is no file {path}")
            yield from (box_shapes if path.suffix == ".npz" else model_shapes)(path, asked.up)

    if asked.files:
        published = [
            name for name in PUBLISHED if any(name in path.stem and path.suffix == ".npz" for path in asked.files)
        ]
        print(physical_table(of_files(), PhysicsConfig(), asked.dry, published).markdown(), end="")
        return 0
    config = load_config(asked.config, {name: stage.config for name, stage in find_stages().items()})
    shapes = dataset_shapes(asked.out / config.name, asked.most)
    _keep(
        physical_table(shapes, config.section(PhysicsConfig), asked.dry), asked.out / f"{config.name}-eval", "physical"
    )
    return 0


def _near_twins(asked: argparse.Namespace) -> int:
    from eval.near_twins import dataset_clouds, near_twins_table
    from pipeline.config import load_config
    from pipeline.registry import find_stages

    config = load_config(asked.config, {name: stage.config for name, stage in find_stages().items()})
    clouds = dataset_clouds(asked.out / config.name, config.seed)
    _keep(near_twins_table(clouds), asked.out / f"{config.name}-eval", "near_twins")
    return 0


def _keep(table: Table, folder: Path, name: str) -> None:
    """Print a table and write it to a folder."""
    from pipeline.places import write_whole

    folder.mkdir(parents=True, exist_ok=True)
    for suffix, text in (("md", table.markdown()), ("csv", table.csv()), ("tex", table.latex())):
        write_whole(folder / f"{name}.{suffix}", text.encode())
    print(table.markdown(), end="")
    print(f"\nAlso in {folder}: {name}.md, {name}.csv, {name}.tex")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
