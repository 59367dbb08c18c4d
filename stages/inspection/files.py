"""The files of an inspection: the picture of the models, the figure of samples, and the config."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from pipeline.paths import write_file
from stages.autoconfig.resolve import REQUIREMENT_KEYS
from stages.exemplars.kit_figure import kit_figure
from stages.inspection.config_text import config_text, dataset_name, proportions_section, variations_section
from stages.inspection.report import InspectionReport
from stages.inspection.sample_figure import ShownShapes, sample_figure
from stages.shape.resolved_settings import FALLBACK_STABLE_KEY


def write_report_files(folder: Path, paths: Sequence[Path], report: InspectionReport) -> Iterator[tuple[str, Path]]:
    """Write the picture of the observation, the figure of samples and the config; yield a title and path for each."""
    name, resolution, resizing = dataset_name(paths), report.resolution, report.resizing
    kit = report.observed.kit
    kit = replace(kit, name=" + ".join(exemplar.name for exemplar in kit.exemplars))
    yield "picture", write_file(folder / f"{name}.png", kit_figure(kit))
    if report.shapes:
        note = "; ".join(f"{title}: {text}" for title, text in report.forecast.lines())
        if resizing is not None:
            note = f"{note}; {resizing.success_rate:.0%} of what is drawn holds together"
        groups = [
            ShownShapes("At random, as most of a dataset looks", report.typical, note),
            ShownShapes("The most different", report.shapes, report.sentence),
        ]
        figure = sample_figure(report.built.kit, groups, name)
        yield "samples", write_file(folder / f"{name}-samples.png", figure)
    if resizing is not None:
        reason = resolution.reasons[FALLBACK_STABLE_KEY]
        others = report.layouts.sentence if report.layouts else "nothing"
        section = proportions_section(resizing.different, resizing.stable, reason, others, resizing.has_rows)
    else:
        require = {key: resolution.values[key] for key in REQUIREMENT_KEYS}
        layouts = report.layouts.layouts if report.layouts is not None else 0
        section = variations_section(report.config, resolution.reasons, require, layouts)
    text = config_text(
        name, report.config, report.models, resolution.reasons, section, report.sentence, bool(report.built.refusals)
    )
    yield "config", write_file(folder / f"{name}.yaml", text.encode())
