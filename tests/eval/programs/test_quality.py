"""Metrics of programs on cases whose figures are known, and the table of a dataset."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from eval.programs.nearest import nearest, paired
from eval.programs.quality import (
    POINTS,
    boxes_of_programs,
    clouds_of,
    novelty,
    physics_of,
    smoothness,
    unrejected,
    variability,
)
from eval.programs.tables import editability_table, quality_table, smoothness_table, variability_table
from eval.programs.two_sample_test import Realism
from stages.shapeassembly import parse
from stages.training.part_graph_vae.settings import PartGraphVaeConfig
from stages.training.part_graph_vae.trained import TrainedPartGraphVae
from stages.training.part_graph_vae.training import new_model as new_part_graph_vae
from stages.training.program_vae.settings import ProgramVaeConfig
from stages.training.program_vae.trained import TrainedProgramVae
from stages.training.program_vae.training import new_model
from tests.stages.training.program_vae.test_lines import BOX, STOOL

FALLS = """Assembly P { bbox = Cuboid(1.0, 1.0, 1.0, True) foot = Cuboid(0.1, 0.5, 0.1, True)
top = Cuboid(1.0, 0.1, 0.1, True) attach(foot, bbox, 0.5, 0.0, 0.5, 0.05, 0.0, 0.5)
attach(top, foot, 0.05, 0.0, 0.5, 0.5, 1.0, 0.5) }"""
FLOATS = (
    BOX[:-1].replace("c =", "d = Cuboid(0.2, 0.2, 0.2, True) c =") + "attach(d, bbox, 0.5, 1.0, 0.5, 0.5, 1.0, 0.5) }"
)
PROGRAMS = [parse(text) for text in (BOX, STOOL)]


def test_nearest_is_the_nearest_by_trees() -> None:
    rng = np.random.default_rng(0)
    clouds, others = rng.normal(size=(6, 40, 3)), rng.normal(size=(9, 30, 3)) * 1.5

    def chamfer(one: np.ndarray, other: np.ndarray) -> float:
        return float(cKDTree(one).query(other)[0].mean() + cKDTree(other).query(one)[0].mean()) / 2

    table = np.array([[chamfer(one, other) for other in others] for one in clouds])
    np.testing.assert_allclose(nearest(clouds, others, False), table.min(axis=1), rtol=1e-6)
    np.testing.assert_allclose(paired(clouds, others[:6]), np.diag(table), rtol=1e-6)
    own = np.array([[chamfer(one, other) for other in clouds] for one in clouds]) + np.diag([1e9] * 6)
    np.testing.assert_allclose(nearest(clouds, clouds, True), own.min(axis=1), rtol=1e-6)


def test_physics_counts_what_is_rooted_and_what_of_it_stays_up() -> None:
    """The stool has two legs in a line."""
    found = physics_of(boxes_of_programs([*PROGRAMS, parse(FALLS), parse(FLOATS)]))
    assert (found.rooted, found.stable) == (75, 25)


def test_a_cloud_lies_on_the_surface_and_what_train_has_is_not_new() -> None:
    (cloud,) = clouds_of(boxes_of_programs(PROGRAMS[:1]))
    assert cloud.shape == (POINTS, 3)
    np.testing.assert_allclose(np.abs(cloud - [0, -0.25, 0]).max(axis=1), 0.25)
    assert novelty(PROGRAMS, PROGRAMS[:1]) == 50
    boxes = boxes_of_programs(PROGRAMS)
    clouds = clouds_of(boxes)
    found = variability(boxes, clouds, clouds[:1])
    assert (found.generalization, found.coverage, found.leaf_parts) == (0, 0, 4)
    assert found.variety > 0.05
    assert variability(boxes, clouds, None).coverage == ""


def test_steps_between_points_are_measured_and_tables_hold_the_published_rows() -> None:
    entry = ProgramVaeConfig(name="tiny", kind="program_vae", latent=8, hidden=16)
    module = new_model(entry, 0)
    model = TrainedProgramVae(module.eval(), {"settings": entry.model_dump()})
    assert len(unrejected(model, 5, np.random.default_rng(0), 1.0)) == 5
    boxes = boxes_of_programs(PROGRAMS)
    smooth = smoothness(model, 2, 5, np.random.default_rng(0))
    assert smooth[0] == "" or float(smooth[0]) >= 0
    drawn = PartGraphVaeConfig(name="tiny", kind="part_graph_vae", latent=8, hidden=16)
    parts = TrainedPartGraphVae(new_part_graph_vae(drawn, 0).eval(), {"settings": drawn.model_dump()})
    assert smoothness(parts, 2, 5, np.random.default_rng(0))[1] == "", "it writes no programs"
    tables = [
        quality_table({"a": physics_of(boxes)}, {"a": Realism(20.0, 3.5)}, {"a": 12.5}, {"b": "it writes nothing"}),
        editability_table({"a": PROGRAMS}),
        variability_table({"a": variability(boxes, clouds_of(boxes), None)}, {"a": 50.0}),
        smoothness_table({"a": smooth}),
    ]
    assert [len(each.published) for each in tables] == [27, 12, 12, 6]
    assert "Not here: b, it writes nothing." in tables[0].markdown()
    assert all("chair, ShapeAssembly" in each.markdown() for each in tables)
    assert quality_table({"a": physics_of(boxes)}, {}, {}, {}).rows[0][3:] == ("", "", ""), "nothing was judged"
