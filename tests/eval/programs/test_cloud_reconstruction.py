"""Encoders of clouds, fits of decoded shapes, and Table 7."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from eval.programs.cloud_reconstruction import (
    FIT_SUFFIXES,
    ReconstructedShapes,
    cloud_descriptors,
    cloud_f_score,
    clouds_table,
    reconstructions,
    train_cloud_encoder,
)
from eval.programs.quality import boxes_of_programs, clouds_of
from stages.shapeassembly import execute_all, parse
from stages.training.part_graph_vae.settings import PartGraphVaeConfig
from stages.training.part_graph_vae.trained import TrainedPartGraphVae
from stages.training.part_graph_vae.training import new_model as new_part_graph_vae
from stages.training.program_vae.settings import ProgramVaeConfig
from stages.training.program_vae.trained import TrainedProgramVae
from stages.training.program_vae.training import new_model
from tests.stages.training.program_vae.test_lines import BOX, STOOL

PROGRAMS = [parse(text) for text in (BOX, STOOL)]


def test_encoder_learns_a_linear_map_reproducibly() -> None:
    rng = np.random.default_rng(0)
    descriptors, weights = rng.normal(size=(400, 6)), rng.normal(size=(6, 4))
    points = (descriptors @ weights).astype(np.float32)
    found = train_cloud_encoder(descriptors[:300], points[:300], 3)(descriptors[300:])
    assert np.abs(found - points[300:]).mean() < 0.3 * np.abs(points[300:]).mean()
    np.testing.assert_array_equal(found, train_cloud_encoder(descriptors[:300], points[:300], 3)(descriptors[300:]))


def test_descriptors_differ_by_size_alone() -> None:
    clouds = clouds_of(boxes_of_programs(PROGRAMS[:1]), 256)
    small, large = cloud_descriptors(np.concatenate([clouds, 2 * clouds]))
    np.testing.assert_allclose(small[:-6], large[:-6], atol=1e-6)
    np.testing.assert_allclose(2 * small[-6:], large[-6:])


def test_f_score_is_full_for_the_shape_and_zero_far_away() -> None:
    (boxes,) = boxes_of_programs(PROGRAMS[1:])
    cloud = clouds_of([boxes], 1024)[0]
    assert cloud_f_score(boxes, cloud) == 100
    assert cloud_f_score([replace(box, center=box.center + 5) for box in boxes], cloud) == 0


def test_decoded_shapes_are_fitted_as_cuboids_and_programs() -> None:
    entry = ProgramVaeConfig(name="tiny", kind="program_vae", latent=8, hidden=16)
    programs = TrainedProgramVae(new_model(entry, 0).eval(), {"settings": entry.model_dump()})
    part_entry = PartGraphVaeConfig(name="tiny", kind="part_graph_vae", latent=8, hidden=16)
    parts = TrainedPartGraphVae(new_part_graph_vae(part_entry, 0).eval(), {"settings": part_entry.model_dump()})
    cloud = clouds_of(boxes_of_programs(PROGRAMS[1:]), 256)[0]
    for model, inputs in ((programs, PROGRAMS), (parts, execute_all(PROGRAMS))):
        point = model.encode(inputs)[1]
        found = dict(reconstructions(model, point, cloud, np.random.default_rng(0), 3))
        assert list(found) in ([], list(FIT_SUFFIXES[:2]), list(FIT_SUFFIXES))
        assert len({len(boxes) for boxes in found.values()}) <= 1, "fits keep the number of cuboids"


def test_table_has_reference_rows() -> None:
    (boxes,) = boxes_of_programs(PROGRAMS[:1])
    table = clouds_table({"vae": ReconstructedShapes([boxes], [clouds_of([boxes], 512)[0]])})
    assert table.rows[0][:3] == ("vae", 1, 100.0)
    assert "chair, ShapeAssembly + program" in table.markdown()
    assert len(table.reference_rows) == 6
