"""`shapemill export`: samples of a finished dataset as URDF, MJCF, OpenUSD or OBJ."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipeline.config import nearest_word
from pipeline.display import counting
from pipeline.errors import ConfigError
from pipeline.options import DATASETS, DEFAULT_CONFIG, DEFAULT_OUT, ConfigOption, OutOption, load_dataset
from stages.export.settings import DEFAULT_DENSITY, DEFAULT_SHELL_THICKNESS, ExportSettings

if TYPE_CHECKING:
    from collections.abc import Iterator

    from stages.package.dataset_sample import DatasetSample
    from stages.package.reader import Dataset

COMMANDS = typer.Typer()


@COMMANDS.command(rich_help_panel=DATASETS)
def export(
    context: typer.Context,
    kind: Annotated[str, typer.Argument(metavar="FORMAT", help="urdf, mjcf, usd, obj or structurenet")],
    folder: Annotated[
        Path | None, typer.Argument(help="a dataset's folder; without, that of the config", show_default=False)
    ] = None,
    config: ConfigOption = DEFAULT_CONFIG,
    out: OutOption = DEFAULT_OUT,
    key: Annotated[str, typer.Option(help="keys of samples, with commas between; all if empty")] = "",
    count: Annotated[int, typer.Option(min=0, help="largest number of samples; 0: all")] = 0,
    to: Annotated[
        Path | None, typer.Option(help="folder of the files; default: <folder>-<format>", show_default=False)
    ] = None,
    links: Annotated[
        str, typer.Option(help="parts: each part is a link; bodies: parts that keep their places are one link")
    ] = "parts",
    density: Annotated[float, typer.Option(min=1e-3, help="in kilograms a cubic metre")] = DEFAULT_DENSITY,
    shell_thickness: Annotated[
        float, typer.Option(min=1e-6, help="thickness of the walls of open parts, in metres")
    ] = DEFAULT_SHELL_THICKNESS,
    scale: Annotated[float, typer.Option(min=1e-9, help="length of the unit of the shapes, in metres")] = 1.0,
    fixed_base: Annotated[bool, typer.Option(help="fix the shapes to the world")] = False,
) -> None:
    """Write samples of a finished dataset as files for simulators and modelling programs."""
    from pipeline.paths import write_file
    from stages.export.samples import FORMATS, export_files
    from stages.package.reader import Dataset

    chosen = next((name for name in FORMATS if name == kind), None)
    if chosen is None:
        close = nearest_word(kind, FORMATS)
        hint = f"did you mean {close}?" if close else f"formats are {', '.join(FORMATS)}"
        raise ConfigError(f"there is no format {kind!r} to export to; {hint}")
    if links not in ("parts", "bodies"):
        raise ConfigError(f"--links {links}: must be parts or bodies")
    settings = ExportSettings("parts" if links == "parts" else "bodies", density, shell_thickness, scale, fixed_base)
    folder = folder or out / load_dataset(context, config, out)[1].name
    dataset = Dataset.open(folder)
    target = to or folder.with_name(f"{folder.name}-{chosen}")
    wanted = tuple(filter(None, key.split(",")))
    total = len(wanted) or min(count or len(dataset), len(dataset))
    done, several, unitless = 0, 0, 0
    with counting("export", total, "samples") as show:
        for sample in _chosen(dataset, wanted, total):
            try:
                files = export_files(sample, chosen, settings)
            except ValueError as error:
                raise ConfigError(f"{sample.key}: cannot be exported: {error}") from None
            for name, content in files.items():
                write_file(target / sample.key / name, content)
            done += 1
            several += sample.record["physics"]["components"] > 1
            unitless += sample.record.get("unit") != "metre"
            show(done)
    print(f"wrote {done:,} samples to {target}")
    if chosen in ("obj", "structurenet"):
        return
    if several:
        print(f"{several:,} of them have several pieces; each piece is a body of its own")
    if unitless:
        print(f"{unitless:,} of them state no unit: {scale:g} m for a unit; --scale sets another")


def _chosen(dataset: Dataset, wanted: tuple[str, ...], total: int) -> Iterator[DatasetSample]:
    """Yield the wanted samples, or evenly spread ones. Raises ConfigError for a key that no sample has."""
    step = max(1, len(dataset) // max(total, 1))
    left = set(wanted)
    for index, sample in enumerate(dataset):
        if sample.key in left or (not wanted and index % step == 0 and index // step < total):
            left.discard(sample.key)
            yield sample
        if wanted and not left:
            return
    if left:
        keys = f"; its keys look like {sample.key}" if len(dataset) else ""
        raise ConfigError(f"{dataset.location} has no sample {', '.join(sorted(left))}{keys}")
