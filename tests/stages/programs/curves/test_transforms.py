"""Attachment, stretching, copies, deformation, parts."""

from __future__ import annotations

import numpy as np
import pytest

import stages.programs.curves as guide
from stages.programs.curves import (
    Part,
    attach,
    bend,
    box,
    circle,
    copies,
    evenly,
    follow,
    frame,
    joined,
    line,
    linear,
    mesh_defects,
    mirroring,
    polyline,
    radial,
    rotation,
    scaling,
    stretch,
    sweep,
    symmetric,
    taper,
    translation,
    twist,
)

PEG = Part("peg", box((1, 1, 1), (2, 0.5, 0)), (1, 2, 3))


def moved(matrix: np.ndarray, *point: float) -> list[float]:
    return (matrix @ [*point, 1])[:3].tolist()


def test_matrices_move_points() -> None:
    assert moved(rotation("y", 90), 1, 0, 0) == pytest.approx([0, 0, -1])
    assert moved(rotation("z", 90, (1, 0, 0)), 2, 0, 0) == pytest.approx([1, 1, 0])
    assert moved(scaling(2, 3, 4, (1, 1, 1)), 2, 2, 2) == pytest.approx([3, 4, 5])
    assert moved(mirroring("x", 1), 3, 2, 1) == pytest.approx([-1, 2, 1])


def test_attach_moves_one_frame_onto_another() -> None:
    leg, rail = polyline([(0, 0, 0), (0.2, 1, 0)]), line((0, 0, 0), (1, 0, 0))
    own, to = rail.frames(0.0), leg.frames(0.7)
    assert attach(own, to) @ own == pytest.approx(to)
    assert rail.transformed(attach(own, to)).at(0.0) == pytest.approx(leg.at(0.7))


def test_stretch_spans_two_attachments_and_keeps_the_cross_section() -> None:
    rail = sweep(line((0, 0, 0), (1, 0, 0)), circle(0.1))
    start, end = np.array([-2.0, 1, 0.5]), np.array([3.0, 2, -1])
    matrix = stretch(((0, 0, 0), (1, 0, 0)), (start, end))
    assert moved(matrix, 0, 0, 0) == pytest.approx(start)
    assert moved(matrix, 1, 0, 0) == pytest.approx(end)
    long = rail.transformed(matrix)
    assert long.volume == pytest.approx(rail.volume * np.linalg.norm(end - start))
    assert mesh_defects(long) == []
    grown = stretch(((0, 0, 0), (1, 0, 0)), (start, end), uniform=True)
    assert np.linalg.det(grown[:3, :3]) == pytest.approx(np.linalg.norm(end - start) ** 3)
    with pytest.raises(ValueError, match="move the attachments apart"):
        stretch(((0, 0, 0), (1, 0, 0)), (start, start))


def test_frame_is_right_handed_and_refuses_one_direction_twice() -> None:
    made = frame((1, 2, 3), z=(0, 0, 2), y=(0, 1, 1))
    assert made[:3, :3] == pytest.approx(np.eye(3))
    assert made[:3, 3].tolist() == [1, 2, 3]
    with pytest.raises(ValueError, match="no frame"):
        frame((0, 0, 0), z=(0, 1, 0), y=(0, 2, 0))


def centers(parts: list[Part]) -> list[list[float]]:
    return [part.mesh.bounds.mean(axis=0).round(9).tolist() for part in parts]


def test_copies_have_their_poses_and_keep_label_and_color() -> None:
    assert centers(radial([PEG], 4)) == [[2, 0.5, 0], [0, 0.5, -2], [-2, 0.5, 0], [0, 0.5, 2]]
    assert centers(radial([PEG], 2, angle=90)) == [[2, 0.5, 0], [0, 0.5, -2]]
    assert centers(linear([PEG], 3, (0, 1, 0))) == [[2, 0.5, 0], [2, 1.5, 0], [2, 2.5, 0]]
    assert centers(symmetric([PEG], "x")) == [[2, 0.5, 0], [-2, 0.5, 0]]
    rail = line((0, 0, 0), (0, 0, 4))
    along = copies([Part("slat", box((1, 1, 0.1)), (1, 2, 3))], rail.frames(evenly(3)))
    assert centers(along) == [[0, 0, 0], [0, 0, 2], [0, 0, 4]]
    assert evenly(1, 0.2, 0.8).tolist() == [0.5]
    for part in symmetric(radial([PEG], 3), "x"):
        assert (part.label, part.color) == ("peg", (1, 2, 3))
        assert mesh_defects(part.mesh) == []


def test_flattening_matrix_is_refused() -> None:
    with pytest.raises(ValueError, match="flattens"):
        PEG.transformed(scaling(1, 0, 1))


def test_deformations_move_vertices() -> None:
    bar = sweep(polyline([(x, 0, 0) for x in np.linspace(0, 2, 41)]), circle(0.1))
    bent = bar.deformed(bend("x", "y", 180))
    assert np.ptp(bent.vertices[:, 0]) == pytest.approx(2 * 2 / np.pi + 0.2, rel=1e-2)
    assert bent.vertices[:, 1].max() == pytest.approx(2 / np.pi, abs=0.01)
    assert bar.deformed(bend("x", "y", 0)).vertices.tolist() == bar.vertices.tolist()
    thin = bar.deformed(taper("x", 1, 0.5))
    assert np.ptp(thin.vertices[np.isclose(thin.vertices[:, 0], 2), 1]) == pytest.approx(
        0.5 * np.ptp(bar.vertices[:, 1])
    )
    turned = bar.deformed(lambda v: v + np.array([0, 1, 0])).deformed(twist("x", 90))
    assert turned.vertices[np.isclose(turned.vertices[:, 0], 2)].mean(axis=0).tolist() == pytest.approx([2, 0, 1])
    rail = polyline([(0, 0, 0), (0, 0, 1), (1, 0, 1)])
    assert bar.deformed(follow(rail, "x")).bounds[1, 0] == pytest.approx(1)
    lifted = bar.deformed(lambda v: v + bar.relative(v)[:, :1] * [0, 1, 0])
    assert lifted.bounds[1, 1] == pytest.approx(1.1, abs=0.01)
    with pytest.raises(ValueError, match="finite vertices"):
        bar.deformed(lambda v: v[:3])


def test_parts_export_as_labelled_triangles() -> None:
    both = joined([PEG, PEG.transformed(translation(0, 2, 0))], "pegs")
    exported = both.part_mesh()
    assert exported.name == "pegs"
    assert exported.faces.shape == (24, 3)
    assert exported.faces.dtype == np.int32
    assert exported.face_colors.dtype == np.uint8
    assert (exported.face_colors == (1, 2, 3)).all()
    assert len(exported.vertices) == 16


def test_example_of_the_package_runs() -> None:
    lines = (guide.__doc__ or "").split("\n")
    first = next(k for k, text in enumerate(lines) if text.startswith("    import numpy"))
    last = next(k for k, text in enumerate(lines) if text.startswith("Conventions"))
    names: dict[str, object] = {}
    exec("\n".join(text[4:] for text in lines[first:last]), names)
    assert sorted({mesh.name for mesh in names["meshes"]}) == ["leg", "rung", "seat"]  # type: ignore[attr-defined]
    assert len(names["meshes"]) == 9  # type: ignore[arg-type]
