"""The paper's figures, and nearest programs and clouds."""

from __future__ import annotations

import io
from functools import partial

import numpy as np
import torch
from PIL import Image

from eval.engine.evaluation import Figure
from eval.engine.models import TrainedModel
from eval.programs.figures import (
    PICTURE_WIDTH,
    edits_figure,
    interpolation_figure,
    neighbours_figure,
    neighbours_table,
    samples_figure,
)
from eval.programs.nearest import nearest_clouds, nearest_distances
from eval.programs.nearest_programs import nearest_programs
from eval.programs.part_surfaces import curve_parts, surface_of, surfaces_figure, train_surfaces
from eval.programs.quality import boxes_of_programs, clouds_of
from stages.shapeassembly import execute_all, parse
from stages.shapeassembly.analysis.structure import program_distance
from stages.shapeassembly.extraction.boxes import corners_of_box
from stages.training.part_graph_vae.settings import PartGraphVaeConfig
from stages.training.part_graph_vae.trained import TrainedPartGraphVae
from stages.training.part_graph_vae.training import new_model as new_part_graph_vae
from stages.training.program_vae.settings import ProgramVaeConfig
from stages.training.program_vae.trained import TrainedProgramVae
from stages.training.program_vae.training import new_model
from tests.stages.training.program_vae.test_lines import BOX, STOOL

BOUNDS = (partial(np.min, axis=0), partial(np.max, axis=0))
PROGRAMS = [parse(text) for text in (BOX, STOOL)]


def _size(figure: Figure) -> tuple[int, int]:
    return Image.open(io.BytesIO(figure.png)).size


def test_nearest_programs_have_least_edit_distance() -> None:
    found = nearest_programs(PROGRAMS, PROGRAMS[::-1])
    assert found == [(0, 1), (0, 0)]
    (only,) = nearest_programs(PROGRAMS[:1], PROGRAMS[1:])
    assert only == (program_distance(*PROGRAMS), 0)


def test_nearest_clouds_have_index_and_distance() -> None:
    clouds = np.random.default_rng(0).normal(size=(5, 20, 3))
    distances, indices = nearest_clouds(clouds + 1e-3, clouds[::-1].copy(), False)
    assert indices.tolist() == [4, 3, 2, 1, 0]
    np.testing.assert_array_equal(distances, nearest_distances(clouds + 1e-3, clouds[::-1].copy(), False))


def test_figure_7_counts_copies_and_new_structures() -> None:
    train = PROGRAMS[:1]
    figure, row = neighbours_figure("vae-box-0", "box", PROGRAMS, train, clouds_of(boxes_of_programs(train)))
    assert figure.name == "figure7_vae-box-0"
    assert row[:2] == ("vae-box-0", 2)
    assert (row[3], row[4]) == (program_distance(*PROGRAMS) / 2, 50)
    assert neighbours_table([row]).rows == (row,)


def test_figures_8_and_9_have_a_picture_per_sample() -> None:
    edits = edits_figure("vae-box-0", "box", PROGRAMS, np.random.default_rng(0))
    samples = samples_figure("box", {"one": boxes_of_programs(PROGRAMS), "other": boxes_of_programs(PROGRAMS[:1])})
    assert min(_size(edits)[0], _size(samples)[0]) > 2 * PICTURE_WIDTH
    assert _size(edits)[1] < _size(samples)[1], "captions are below the pictures"


def test_figure_12_interpolates_with_every_model() -> None:
    entry = ProgramVaeConfig(name="tiny", kind="program_vae", latent=8, hidden=16)
    programs = TrainedProgramVae(new_model(entry, 0).eval(), {"settings": entry.model_dump()})
    part_entry = PartGraphVaeConfig(name="tiny", kind="part_graph_vae", latent=8, hidden=16)
    parts = TrainedPartGraphVae(new_part_graph_vae(part_entry, 0).eval(), {"settings": part_entry.model_dump()})
    assert parts.encode(execute_all(PROGRAMS)).shape == (2, 8)
    models = [TrainedModel("tiny", "box", 0, programs), TrainedModel("parts", "box", 0, parts)]
    both, single = (
        interpolation_figure("box", subset, [(PROGRAMS[0], PROGRAMS[1])]) for subset in (models, models[:1])
    )
    assert both.name == "figure12_box"
    assert _size(both)[1] > 1.5 * _size(single)[1]


def test_figure_11_keeps_surfaces_within_their_cuboids() -> None:
    parts = curve_parts("chair", 2, np.random.default_rng(0))
    assert parts.points.shape == (len(parts.features), 256, 3)
    assert np.abs(parts.points).max() < 0.501, "parts are in their cuboids"
    module = train_surfaces(parts, 3, 0)
    again = train_surfaces(parts, 3, 0).state_dict()
    assert all(torch.equal(value, again[name]) for name, value in module.state_dict().items())
    boxes = boxes_of_programs(PROGRAMS)
    cloud = surface_of(module, boxes[0], np.random.default_rng(0))
    low, high = (bound(np.concatenate([corners_of_box(cuboid) for cuboid in boxes[0]])) for bound in BOUNDS)
    assert (cloud >= low - 1e-6).all()
    assert (cloud <= high + 1e-6).all()
    assert surfaces_figure("tiny", "chair", module, boxes, np.random.default_rng(0)).name == "figure11_tiny"
