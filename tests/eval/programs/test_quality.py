"""Metrics of programs on cases with known values, and their tables."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from eval.programs.nearest import nearest_distances, paired_distances
from eval.programs.quality import (
    POINTS_PER_SHAPE,
    boxes_of_programs,
    clouds_of,
    novelty,
    physical_shares,
    sample_without_rejection,
    smoothness,
    variability,
)
from eval.programs.tables import editability_table, quality_table, smoothness_table, variability_table
from eval.programs.two_sample_test import TwoSampleScores
from stages.shapeassembly import parse
from stages.training.part_graph_vae.settings import PartGraphVaeConfig
from stages.training.part_graph_vae.trained import TrainedPartGraphVae
from stages.training.part_graph_vae.training import new_model as new_part_graph_vae
from stages.training.program_vae.settings import ProgramVaeConfig
from stages.training.program_vae.trained import TrainedProgramVae
from stages.training.program_vae.training import new_model
from tests.stages.training.program_vae.test_lines import BOX, STOOL

FALLING = """Assembly P { bbox = Cuboid(1.0, 1.0, 1.0, True) foot = Cuboid(0.1, 0.5, 0.1, True)
top = Cuboid(1.0, 0.1, 0.1, True) attach(foot, bbox, 0.5, 0.0, 0.5, 0.05, 0.0, 0.5)
attach(top, foot, 0.05, 0.0, 0.5, 0.5, 1.0, 0.5) }"""
FLOATING = (
    BOX[:-1].replace("c =", "d = Cuboid(0.2, 0.2, 0.2, True) c =") + "attach(d, bbox, 0.5, 1.0, 0.5, 0.5, 1.0, 0.5) }"
)
PROGRAMS = [parse(text) for text in (BOX, STOOL)]


def test_nearest_distances_agree_with_trees() -> None:
    rng = np.random.default_rng(0)
    clouds, others = rng.normal(size=(6, 40, 3)), rng.normal(size=(9, 30, 3)) * 1.5

    def chamfer(first: np.ndarray, second: np.ndarray) -> float:
        return float(cKDTree(first).query(second)[0].mean() + cKDTree(second).query(first)[0].mean()) / 2

    expected = np.array([[chamfer(cloud, other) for other in others] for cloud in clouds])
    np.testing.assert_allclose(nearest_distances(clouds, others, False), expected.min(axis=1), rtol=1e-6)
    np.testing.assert_allclose(paired_distances(clouds, others[:6]), np.diag(expected), rtol=1e-6)
    own = np.array([[chamfer(cloud, other) for other in clouds] for cloud in clouds]) + np.diag([1e9] * 6)
    np.testing.assert_allclose(nearest_distances(clouds, clouds, True), own.min(axis=1), rtol=1e-6)


def test_physical_shares_count_rooted_and_stable_shapes() -> None:
    """The stool falls, for its two legs are in one line."""
    found = physical_shares(boxes_of_programs([*PROGRAMS, parse(FALLING), parse(FLOATING)]))
    assert (found.rooted, found.stable) == (75, 25)


def test_clouds_are_on_the_surface_and_known_structures_are_not_novel() -> None:
    (cloud,) = clouds_of(boxes_of_programs(PROGRAMS[:1]))
    assert cloud.shape == (POINTS_PER_SHAPE, 3)
    np.testing.assert_allclose(np.abs(cloud - [0, -0.25, 0]).max(axis=1), 0.25)
    assert novelty(PROGRAMS, PROGRAMS[:1]) == 50
    boxes = boxes_of_programs(PROGRAMS)
    clouds = clouds_of(boxes)
    found = variability(boxes, clouds, clouds[:1])
    assert (found.generalization, found.coverage, found.leaf_parts) == (0, 0, 4)
    assert found.variety > 0.05
    assert variability(boxes, clouds, None).coverage == ""


def test_smoothness_is_measured_and_tables_have_reference_rows() -> None:
    entry = ProgramVaeConfig(name="tiny", kind="program_vae", latent=8, hidden=16)
    module = new_model(entry, 0)
    model = TrainedProgramVae(module.eval(), {"settings": entry.model_dump()})
    assert len(sample_without_rejection(model, 5, np.random.default_rng(0), 1.0)) == 5
    boxes = boxes_of_programs(PROGRAMS)
    smooth = smoothness(model, 2, 5, np.random.default_rng(0))
    assert smooth[0] == "" or float(smooth[0]) >= 0
    part_entry = PartGraphVaeConfig(name="tiny", kind="part_graph_vae", latent=8, hidden=16)
    parts = TrainedPartGraphVae(new_part_graph_vae(part_entry, 0).eval(), {"settings": part_entry.model_dump()})
    assert smoothness(parts, 2, 5, np.random.default_rng(0))[1] == "", "it generates no programs"
    tables = [
        quality_table(
            {"a": physical_shares(boxes)}, {"a": TwoSampleScores(20.0, 3.5)}, {"a": 12.5}, {"b": "it generates nothing"}
        ),
        editability_table({"a": PROGRAMS}),
        variability_table({"a": variability(boxes, clouds_of(boxes), None)}, {"a": 50.0}),
        smoothness_table({"a": smooth}),
    ]
    assert [len(table.reference_rows) for table in tables] == [27, 12, 12, 6]
    assert "Missing: b, it generates nothing." in tables[0].markdown()
    assert all("chair, ShapeAssembly" in table.markdown() for table in tables)
    assert quality_table({"a": physical_shares(boxes)}, {}, {}, {}).rows[0][3:] == ("", "", ""), "nothing was judged"
