"""A contact sheet of each kit of a collection: the variants that differ most, and some at random; and one of what took
the place of what, where pieces of exemplars were replaced.

python -m stages.variations.report.sheet --config configs/castle.yaml [--out datasets]

Reads the finished variations from the work folder and writes `OUT/sheets/<dataset>-<kit>.png` and
`OUT/sheets/<dataset>-<kit>-replaced.png`.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.config import load_config
from pipeline.paths import DatasetPaths, write_file
from pipeline.randomness import decision_rng
from pipeline.records import read_record
from pipeline.registry import find_stages
from stages.exemplars.settings import ExemplarsConfig
from stages.shape.kit import Assembly, Kit
from stages.shape.kit_files import load_kit
from stages.shape.sample import Sample, read_samples
from stages.shape.shape import kit_shape, upright
from stages.shape.views.camera import Camera
from stages.shape.views.part_colors import part_paint
from stages.shape.views.portrait import portrait
from stages.shape.views.scene import scene_of
from stages.shape.views.sheet import Cell, Section, contact_sheet, picture_png
from stages.variations.substructures.replacement_sheet import replacements_sheet

SHOWN = 24
COLUMNS = 8
CELL = 232
CAMERA = Camera(azimuth=-40.0, elevation=25.0)


def kit_variants_sheet(kit: Kit, samples: Sequence[Sample], dull: str, rng: np.random.Generator) -> bytes:
    """The sheet of one kit as PNG. `samples` are its variants in the order in which they were chosen, which is that
    of how much each differs from the exemplars and from those before it. Where they are `dull`, which it then says,
    each of the first stands beside the exemplar of which it has copied most."""
    rest = rng.permutation(np.arange(min(SHOWN, len(samples)), len(samples)))[:SHOWN]
    drawn = [samples[place] for place in sorted(rest.tolist())]
    exemplars = {each.name: (each.whole, each.name) for each in kit.exemplars}
    first = [(each.assembly, each.key) for each in samples[:SHOWN]]
    if dull:
        pairs = zip(first[: SHOWN // 2], samples, strict=False)
        first = [shown for one, each in pairs for shown in (one, exemplars[each.lineage["copied"]["exemplar"]])]
    parts = [
        ("Exemplars", list(exemplars.values()), "what goes in"),
        ("Most different", first, f"each beside its exemplar; {dull}" if dull else "chosen first"),
        (
            "At random",
            [(each.assembly, each.key) for each in drawn],
            "of the rest",
        ),
    ]

    def cell(assembly: Assembly, name: str) -> Cell:
        shape = upright(kit_shape(kit, assembly))
        picture = portrait(scene_of(shape), CAMERA, (CELL, CELL), part_paint(shape))
        return Cell(picture, f"{name}, {len(assembly)} parts")

    sections = []
    for title, shown, note in parts:
        cells = [cell(assembly, name) for assembly, name in shown]
        rows = [cells[start : start + COLUMNS] for start in range(0, len(cells), COLUMNS)]
        sections.append(Section(title, rows, note))
    title = f"{kit.name}: {len(samples):,} variants"
    return picture_png(contact_sheet([each for each in sections if each.rows], title, CELL))


def _measures(path: Path) -> Mapping[str, Any]:
    """The measures of each kit from the record of the assignment. Raises FileNotFoundError where there is none."""
    record = read_record(path)
    if record is None:
        raise FileNotFoundError(f"{path} is no record; make the variations again")
    measures: Mapping[str, Any] = record.summary["kits"]
    return measures


def main() -> None:
    """Draw the sheet of each kit of a config whose variations are made."""
    parser = argparse.ArgumentParser(
        prog="python -m stages.variations.report.sheet", description="Draw contact sheets."
    )
    parser.add_argument("--config", type=Path, default=Path("configs/default.yaml"))
    parser.add_argument("--out", type=Path, default=Path("datasets"), help="the output folder of the run")
    asked = parser.parse_args()
    config = load_config(asked.config, {name: stage.config for name, stage in find_stages().items()})
    places = DatasetPaths(asked.out, config.name)
    shards = sorted(places.stage("variations").root.glob(f"{config.name}-*-*.tar"))
    if not shards:
        parser.error(f"{places.work} holds no variations; make them with: make variations CONFIG={asked.config}")
    measures = _measures(places.stage("variations").records / f"{config.name}-assignment.json")
    samples = sorted((each for shard in shards for each in read_samples(shard)), key=lambda each: each.key)
    for name in [each.name for each in config.section(ExemplarsConfig).kits]:
        stem = places.stage("exemplars").root / name
        kit = load_kit(stem.with_suffix(".json"), stem.with_suffix(".tar"))
        own = [each for each in samples if each.kit == name]
        sheet = kit_variants_sheet(kit, own, measures[name]["dull"], decision_rng(config.seed, "sheet", name))
        print(write_file(asked.out / "sheets" / f"{config.name}-{name}.png", sheet))
        replaced = replacements_sheet(kit, own)
        if replaced is not None:
            print(write_file(asked.out / "sheets" / f"{config.name}-{name}-replaced.png", replaced))


if __name__ == "__main__":
    main()
