"""The paper's figures hold what their captions say, and what is nearest is nearest."""

from __future__ import annotations

import io
from functools import partial

import numpy as np
import torch
from PIL import Image

from eval.engine.evaluation import Figure
from eval.engine.models import TrainedModel
from eval.programs.figures import WIDTH, beside_sheet, edits_sheet, journey_sheet, neighbours, neighbours_table
from eval.programs.nearest import nearest, nearest_and_which, nearest_programs
from eval.programs.part_surfaces import curve_parts, surface_of, surfaces_sheet, trained_surfaces
from eval.programs.quality import boxes_of_programs, clouds_of
from stages.shapeassembly import execute_all, parse
from stages.shapeassembly.analysis.structure import program_distance
from stages.shapeassembly.extraction.boxes import box_corners
from stages.training.part_graph_vae.settings import PartGraphVaeConfig
from stages.training.part_graph_vae.trained import TrainedPartGraphVae
from stages.training.part_graph_vae.training import new_model as new_part_graph_vae
from stages.training.program_vae.settings import ProgramVaeConfig
from stages.training.program_vae.trained import TrainedProgramVae
from stages.training.program_vae.training import new_model
from tests.stages.training.program_vae.test_lines import BOX, STOOL

BOUNDS = (partial(np.min, axis=0), partial(np.max, axis=0))
PROGRAMS = [parse(text) for text in (BOX, STOOL)]


def _size(sheet: Figure) -> tuple[int, int]:
    return Image.open(io.BytesIO(sheet.picture)).size


def test_the_nearest_programs_are_those_of_the_least_edit_distance() -> None:
    found = nearest_programs(PROGRAMS, PROGRAMS[::-1])
    assert found == [(0, 1), (0, 0)]
    (only,) = nearest_programs(PROGRAMS[:1], PROGRAMS[1:])
    assert only == (program_distance(*PROGRAMS), 0)


def test_the_nearest_cloud_is_named() -> None:
    clouds = np.random.default_rng(0).normal(size=(5, 20, 3))
    distances, places = nearest_and_which(clouds + 1e-3, clouds[::-1].copy(), False)
    assert places.tolist() == [4, 3, 2, 1, 0]
    np.testing.assert_array_equal(distances, nearest(clouds + 1e-3, clouds[::-1].copy(), False))


def test_figure_7_tells_a_copy_from_a_new_structure() -> None:
    train = PROGRAMS[:1]
    sheet, row = neighbours("vae-box-0", "box", PROGRAMS, train, clouds_of(boxes_of_programs(train)))
    assert sheet.name == "figure7_vae-box-0"
    assert row[:2] == ("vae-box-0", 2)
    assert (row[3], row[4]) == (program_distance(*PROGRAMS) / 2, 50)
    assert neighbours_table([row]).rows == (row,)


def test_figures_8_and_9_have_a_picture_for_each_sample() -> None:
    edits = edits_sheet("vae-box-0", "box", PROGRAMS, np.random.default_rng(0))
    beside = beside_sheet("box", {"one": boxes_of_programs(PROGRAMS), "other": boxes_of_programs(PROGRAMS[:1])})
    assert min(_size(edits)[0], _size(beside)[0]) > 2 * WIDTH
    assert _size(edits)[1] < _size(beside)[1], "captions stand below"


def test_figure_12_goes_from_shape_to_shape_by_every_model() -> None:
    entry = ProgramVaeConfig(name="tiny", kind="program_vae", latent=8, hidden=16)
    programs = TrainedProgramVae(new_model(entry, 0).eval(), {"settings": entry.model_dump()})
    drawn = PartGraphVaeConfig(name="tiny", kind="part_graph_vae", latent=8, hidden=16)
    parts = TrainedPartGraphVae(new_part_graph_vae(drawn, 0).eval(), {"settings": drawn.model_dump()})
    assert parts.encode(execute_all(PROGRAMS)).shape == (2, 8)
    models = [TrainedModel("tiny", "box", 0, programs), TrainedModel("parts", "box", 0, parts)]
    both, one = (journey_sheet("box", each, [(PROGRAMS[0], PROGRAMS[1])]) for each in (models, models[:1]))
    assert both.name == "figure12_box"
    assert _size(both)[1] > 1.5 * _size(one)[1]


def test_figure_11_keeps_surfaces_within_their_cuboids() -> None:
    parts = curve_parts("chair", 2, np.random.default_rng(0))
    assert parts.points.shape == (len(parts.places), 256, 3)
    assert np.abs(parts.points).max() < 0.501, "a part lies in its cuboid"
    module = trained_surfaces(parts, 3, 0)
    again = trained_surfaces(parts, 3, 0).state_dict()
    assert all(torch.equal(each, again[name]) for name, each in module.state_dict().items())
    boxes = boxes_of_programs(PROGRAMS)
    cloud = surface_of(module, boxes[0], np.random.default_rng(0))
    low, high = (bound(np.concatenate([box_corners(each) for each in boxes[0]])) for bound in BOUNDS)
    assert (cloud >= low - 1e-6).all()
    assert (cloud <= high + 1e-6).all()
    assert surfaces_sheet("tiny", "chair", module, boxes, np.random.default_rng(0)).name == "figure11_tiny"
