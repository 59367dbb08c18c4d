"""Encoders of clouds learn what can be learnt, and Table 7 counts what was rebuilt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from eval.programs.cloud_reconstruction import (
    FITS,
    Rebuilt,
    clouds_table,
    described,
    f_score,
    reconstructions,
    trained_encoder,
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


def test_an_encoder_learns_where_clouds_stand_and_does_so_again() -> None:
    rng = np.random.default_rng(0)
    seen, way = rng.normal(size=(400, 6)), rng.normal(size=(6, 4))
    points = (seen @ way).astype(np.float32)
    found = trained_encoder(seen[:300], points[:300], 3)(seen[300:])
    assert np.abs(found - points[300:]).mean() < 0.3 * np.abs(points[300:]).mean()
    np.testing.assert_array_equal(found, trained_encoder(seen[:300], points[:300], 3)(seen[300:]))


def test_clouds_of_one_form_are_told_apart_by_their_size() -> None:
    clouds = clouds_of(boxes_of_programs(PROGRAMS[:1]), 256)
    small, large = described(np.concatenate([clouds, 2 * clouds]))
    np.testing.assert_allclose(small[:-6], large[:-6], atol=1e-6)
    np.testing.assert_allclose(2 * small[-6:], large[-6:])


def test_the_score_is_full_for_the_shape_itself_and_none_far_away() -> None:
    (boxes,) = boxes_of_programs(PROGRAMS[1:])
    cloud = clouds_of([boxes], 1024)[0]
    assert f_score(boxes, cloud) == 100
    assert f_score([replace(box, center=box.center + 5) for box in boxes], cloud) == 0


def test_what_a_model_has_is_fitted_as_cuboids_and_as_a_program() -> None:
    entry = ProgramVaeConfig(name="tiny", kind="program_vae", latent=8, hidden=16)
    programs = TrainedProgramVae(new_model(entry, 0).eval(), {"settings": entry.model_dump()})
    drawn = PartGraphVaeConfig(name="tiny", kind="part_graph_vae", latent=8, hidden=16)
    parts = TrainedPartGraphVae(new_part_graph_vae(drawn, 0).eval(), {"settings": drawn.model_dump()})
    cloud = clouds_of(boxes_of_programs(PROGRAMS[1:]), 256)[0]
    for model, learnt in ((programs, PROGRAMS), (parts, execute_all(PROGRAMS))):
        place = model.encode(learnt)[1]
        found = dict(reconstructions(model, place, cloud, np.random.default_rng(0), 3))
        assert list(found) in ([], list(FITS[:2]), list(FITS))
        assert len({len(boxes) for boxes in found.values()}) <= 1, "fits add no cuboid and take none away"


def test_the_table_stands_above_the_published_one() -> None:
    (boxes,) = boxes_of_programs(PROGRAMS[:1])
    table = clouds_table({"vae": Rebuilt([boxes], [clouds_of([boxes], 512)[0]])})
    assert table.rows[0][:3] == ("vae", 1, 100.0)
    assert "chair, ShapeAssembly + program" in table.markdown()
    assert len(table.published) == 6
