"""Contact sheets of a collection: for each kit the variants that differ most and some at random, and replacements."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from pipeline.config import Config
from pipeline.errors import ConfigError
from pipeline.paths import DatasetPaths, write_file
from pipeline.randomness import decision_rng
from pipeline.records import read_record
from stages.exemplars.settings import ExemplarsConfig
from stages.shape.kit import Assembly, Kit
from stages.shape.kit_files import load_kit
from stages.shape.sample import Sample, read_samples
from stages.shape.shape import kit_shape, upright
from stages.shape.views.camera import Camera
from stages.shape.views.part_colors import part_paint
from stages.shape.views.portrait import portrait
from stages.shape.views.scene import scene_of
from stages.shape.views.sheet import Cell, Section, contact_sheet, picture_png, trimmed
from stages.shape.views.viewpoint import best_viewpoint
from stages.variations.settings import VariationsConfig
from stages.variations.substructures.replacement_sheet import replacements_sheet

MAX_VARIANTS_SHOWN = 24
COLUMNS_PER_ROW = 8
CELL_PIXELS = 232
CAMERA = Camera(azimuth=-40.0, elevation=25.0)


def kit_variants_sheet(kit: Kit, samples: Sequence[Sample], low_diversity: str, rng: np.random.Generator) -> bytes:
    """Return the sheet of one kit as PNG.

    samples: its variants in the order of selection: how much each differs from the exemplars and those before it
    low_diversity: why they have low diversity, or ""; if so, each of the first is next to the exemplar it copies most
    """
    rest = rng.permutation(np.arange(min(MAX_VARIANTS_SHOWN, len(samples)), len(samples)))[:MAX_VARIANTS_SHOWN]
    drawn = [samples[number] for number in sorted(rest.tolist())]
    exemplars = {exemplar.name: (exemplar.whole, exemplar.name) for exemplar in kit.exemplars}
    first = [(sample.assembly, sample.key) for sample in samples[:MAX_VARIANTS_SHOWN]]
    if low_diversity:
        pairs = zip(first[: MAX_VARIANTS_SHOWN // 2], samples, strict=False)
        first = [
            shown for variant, sample in pairs for shown in (variant, exemplars[sample.lineage["copied"]["exemplar"]])
        ]
    note = f"each next to its exemplar; {low_diversity}" if low_diversity else "selected first"
    parts = [
        ("Exemplars", list(exemplars.values()), "the input"),
        ("Most different", first, note),
        ("At random", [(sample.assembly, sample.key) for sample in drawn], "of the rest"),
    ]

    scenes = [scene_of(upright(kit_shape(kit, assembly))) for assembly, _ in exemplars.values()]
    camera = best_viewpoint(scenes, CAMERA)

    def cells_of(assembly: Assembly, name: str, is_exemplar: bool) -> Iterator[Cell]:
        shape = upright(kit_shape(kit, assembly))
        yield Cell(portrait(scene_of(shape), camera, (CELL_PIXELS, CELL_PIXELS)), f"{name}, {len(assembly)} parts")
        paint = part_paint(shape)
        if is_exemplar and paint is not None:
            yield Cell(portrait(scene_of(shape), camera, (CELL_PIXELS, CELL_PIXELS), paint), "by part type")

    sections = []
    for title, shown, note in parts:
        is_input = title == "Exemplars"
        cells = [cell for assembly, name in shown for cell in cells_of(assembly, name, is_input)]
        rows = [trimmed(cells[start : start + COLUMNS_PER_ROW]) for start in range(0, len(cells), COLUMNS_PER_ROW)]
        sections.append(Section(title, rows, note))
    title = f"{kit.name}: {len(samples):,} variants"
    return picture_png(contact_sheet([section for section in sections if section.rows], title, CELL_PIXELS))


def write_sheets(config: Config, paths: DatasetPaths) -> list[Path]:
    """Write the sheets of each kit of a dataset to `OUT/sheets`; return their paths.

    Raise ConfigError where the variations are not made, or not requested.
    """
    if not config.section(VariationsConfig).samples_per_kit:
        raise ConfigError(
            f"{config.path}: variations.samples_per_kit is 0, and sheets show variations; preview.png in the finished "
            "dataset shows other shapes"
        )
    shards = sorted(paths.stage("variations").root.glob(f"{config.name}-*-*.tar"))
    record = read_record(paths.stage("variations").records / f"{config.name}-assignment.json")
    if not shards or record is None:
        raise ConfigError(f"{paths.work} holds no variations; make them with: make variations CONFIG={config.path}")
    samples = sorted((sample for shard in shards for sample in read_samples(shard)), key=lambda sample: sample.key)
    written = []
    for kit_config in config.section(ExemplarsConfig).kits:
        name = kit_config.name
        stem = paths.stage("exemplars").root / name
        kit = load_kit(stem.with_suffix(".json"), stem.with_suffix(".tar"))
        own = [sample for sample in samples if sample.kit == name]
        low_diversity, rng = record.summary["kits"][name]["low_diversity"], decision_rng(config.seed, "sheet", name)
        file = paths.out / "sheets" / f"{config.name}-{name}.png"
        written.append(write_file(file, kit_variants_sheet(kit, own, low_diversity, rng)))
        replaced = replacements_sheet(kit, own)
        if replaced is not None:
            written.append(write_file(file.with_stem(f"{file.stem}-replaced"), replaced))
    return written
