from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stages.shape.views.camera import Camera, eye_rotation


def clip(view, points):
    eye = points @ view.eye[:3, :3].T + view.eye[:3, 3]
    out = np.column_stack([eye, np.ones(len(eye))]) @ view.projection.T
    return out[:, :3] / out[:, 3:]


def test_azimuth_and_elevation_say_where_the_eye_stands():
    towards = {name: eye_rotation(a, e, "y")[2] for name, a, e in (("front", 0, 0), ("right", 90, 0), ("top", 0, 90))}
    assert np.allclose(towards["front"], [0, 0, 1])
    assert np.allclose(towards["right"], [1, 0, 0])
    assert np.allclose(towards["top"], [0, 1, 0])
    assert np.allclose(eye_rotation(0, 0, "z")[2], [0, -1, 0])
    assert np.allclose(eye_rotation(0, 0, "z")[1], [0, 0, 1])


@given(st.floats(-180, 180), st.floats(-90, 90), st.sampled_from(["y", "z"]))
def test_eye_axes_are_a_right_handed_frame(azimuth, elevation, up):
    rotation = eye_rotation(azimuth, elevation, up)
    assert np.allclose(rotation @ rotation.T, np.eye(3))
    assert np.isclose(np.linalg.det(rotation), 1.0)


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 10_000),
    st.floats(-180, 180),
    st.floats(-90, 90),
    st.floats(5, 90),
    st.sampled_from(["perspective", "orthographic"]),
    st.sampled_from([0.5, 1.0, 2.0]),
    st.sampled_from([1e-3, 1.0, 1e6]),
)
def test_a_fitted_view_crops_nothing_and_fills_the_frame(seed, azimuth, elevation, fov, projection, aspect, scale):
    rng = np.random.default_rng(seed)
    points = scale * (rng.normal(size=(40, 3)) * rng.uniform(0.05, 1, 3) + rng.normal(size=3) * 5)
    view = Camera(azimuth, elevation, projection, fov, margin=0.1).look(points, "y", aspect)
    shown = clip(view, points)
    assert (np.abs(shown[:, 2]) < 1.0).all()
    assert (np.abs(shown[:, :2]) <= 0.8 + 1e-6).all()
    # Both borders of the tighter direction are reached, unless depth alone keeps the eye away.
    reached = (np.abs(shown[:, :2]) > 0.8 - 1e-4).any(axis=0)
    assert reached.any() or fov > 60


def test_a_given_distance_is_kept_for_shapes_of_any_size():
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    for scale in (0.01, 1.0, 100.0):
        view = Camera(20.0, 30.0, distance=4.0).look(scale * corners, "y")
        assert np.isclose(view.depth, 4.0 * scale * np.sqrt(3))


def test_a_camera_inside_the_shape_is_refused():
    with pytest.raises(ValueError, match="inside the shape"):
        Camera(0.0, 0.0, distance=0.5).look(np.eye(3), "y")


def test_nothing_to_look_at_is_refused():
    with pytest.raises(ValueError, match="at least one point"):
        Camera(0.0, 0.0).look(np.empty((0, 3)), "y")
