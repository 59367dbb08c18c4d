"""Sweep and loft: a profile carried along a rail, with scale and twist on the way (geocode §3.1, "triplets")."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
import numpy.typing as npt

from stages.programs.curves.caps import Cap, fan, polygon_cap
from stages.programs.curves.curve import Curve, Stations
from stages.programs.curves.frames import rail_axes
from stages.programs.curves.mesh import QuadMesh
from stages.programs.curves.profile import Profile
from stages.programs.curves.skin import skin
from stages.programs.curves.style import Style
from stages.shape.arrays import FloatArray

Caps = Literal["flat", "round"]
"""How a sweep ends: cut off, or with a dome as deep as half the profile's shorter side."""

DOME_RINGS = 3
"""Rings of a dome beyond the end, its pole included."""


def sweep(
    rail: Curve,
    profile: Profile,
    style: Style | None = None,
    up: npt.ArrayLike | None = None,
    caps: Caps | tuple[Caps, Caps] = "flat",
) -> QuadMesh:
    """The profile carried along the rail: a leg, a rail, a handle; along a closed rail a ring without ends.

    The profile's y leans towards `up` (3,) at the start of the rail and does not roll from there on. `up` None is the
    world's +y, or +z where the rail starts steeper than 45 degrees: say it where a parameter moves a rail across that
    angle. Corners of the rail are mitred. A ring stands at each point of the rail and at each position of the style.
    A scale of 0 at an end closes the mesh in a point. `caps`: one for both ends or (start, end).

    Nothing keeps a wide profile from meeting itself where the rail turns tighter than the profile is wide.
    Raises ValueError for a scale of 0 in between or for one axis alone, for `up` along the rail, and for a style of a
    closed rail that does not end as it starts.
    """
    return _carried(rail, profile.points, profile.cap, style, up, caps)


def loft(
    rail: Curve,
    profiles: Sequence[tuple[float, Profile]],
    style: Style | None = None,
    up: npt.ArrayLike | None = None,
    caps: Caps | tuple[Caps, Caps] = "flat",
) -> QuadMesh:
    """A sweep whose profile changes: `(position, profile)` pairs from 0 to 1, blended in between.

    Everything else is as in `sweep`; both ends are filled in the way of the first profile. Raises ValueError for
    profiles of different counts of points (those of `square_circle` with one `count` fit each other), for other
    positions, and for a closed rail whose last profile is not its first.
    """
    places = np.array([place for place, _ in profiles], dtype=np.float64)
    if len(places) < 2 or places[0] != 0.0 or places[-1] != 1.0 or (np.diff(places) <= 0.0).any():
        raise ValueError(f"a loft's profiles stand at positions that rise from 0 to 1, unlike {places.tolist()}")
    counts = {len(profile) for _, profile in profiles}
    if len(counts) > 1:
        raise ValueError(f"a loft's profiles have one count of points, not {sorted(counts)}")
    if rail.closed and not np.allclose(profiles[0][1].points, profiles[-1][1].points):
        raise ValueError("a loft along a closed rail ends with the profile it starts with")
    return _carried(rail, np.stack([profile.points for _, profile in profiles]), None, style, up, caps, places)


def loft_rings(rings: npt.ArrayLike, closed: bool = False) -> QuadMesh:
    """The mesh over rings of points in space, (r, k, 3), each counter-clockwise seen from the rings after it.

    A first or last ring at one place is a pole; others are filled from their middle, which has to see all of its ring.
    A ring drawn the other way round turns the mesh inside out: `mesh_faults` says so.
    """
    given = np.asarray(rings, dtype=np.float64)
    if given.ndim != 3 or given.shape[2] != 3 or given.shape[1] < 3:
        raise ValueError(f"a loft needs rings of shape (r, k, 3) with k from 3, not {given.shape}")
    around = given.shape[1]
    return skin(given, Cap(fan(around), around > 4), closed)


def _carried(
    rail: Curve,
    outline: FloatArray,
    cap: Cap | None,
    style: Style | None,
    up: npt.ArrayLike | None,
    caps: Caps | tuple[Caps, Caps],
    places: FloatArray | None = None,
) -> QuadMesh:
    """The skin over `outline` (k, 2), or over outlines (p, k, 2) at `places` (p,), at the stations of the rail."""
    from stages.programs.curves.kernels import place_rings

    stations = _stations(rail, style, places)
    x, y = rail_axes(stations.points, stations.tangents, stations.positions, rail.closed, up)
    outlines = outline[None] if places is None else _blended(outline, places, stations.positions)
    scale, twist = _styled(style, stations.positions, rail.closed)
    rings = place_rings(stations.points, x, y, scale, twist, stations.fold, stations.excess, outlines)
    if not rail.closed and caps != "flat":
        start, end = (caps, caps) if isinstance(caps, str) else caps
        pieces = [rings]
        if start == "round":
            pieces.insert(0, _dome(rings[0], stations.points[0], -stations.tangents[0], outlines[0], scale[0])[::-1])
        if end == "round":
            pieces.append(_dome(rings[-1], stations.points[-1], stations.tangents[-1], outlines[-1], scale[-1]))
        rings = np.concatenate(pieces)
    return skin(rings, polygon_cap(outlines[0]) if cap is None else cap, rail.closed)


def _stations(rail: Curve, style: Style | None, places: FloatArray | None) -> Stations:
    """The stations of the rail, of the style and of a loft's profiles, each once."""
    wanted = [each for each in (None if style is None else style.positions, places) if each is not None]
    if all(len(each) == 2 for each in wanted) and not rail.closed:
        return rail.own_stations
    every = np.unique(np.concatenate([rail.positions, *wanted]))
    if rail.closed:
        every = every[every < 1.0 - 1e-9]
    kept = np.concatenate([[True], np.diff(every) > 1e-6])
    # What coincides is the rail's own point, where a corner has to stay.
    own = np.abs(every[:, None] - rail.positions[None]).argmin(axis=1)
    exact = rail.positions[own]
    every = np.where(np.abs(exact - every) <= 1e-6, exact, every)[kept]
    return rail.own_stations if np.array_equal(every, rail.positions) else rail.stations(every)


def _blended(outlines: FloatArray, places: FloatArray, positions: FloatArray) -> FloatArray:
    """The outline at each position, float64 (n, k, 2), straight between those given."""
    before = np.clip(np.searchsorted(places, positions, side="right") - 1, 0, len(places) - 2)
    share = ((positions - places[before]) / (places[before + 1] - places[before]))[:, None, None]
    blended: FloatArray = outlines[before] + share * (outlines[before + 1] - outlines[before])
    return blended


def _styled(style: Style | None, positions: FloatArray, closed: bool) -> tuple[FloatArray, FloatArray]:
    """Scale (n, 2) and twist (n,) at positions (n,)."""
    if style is None:
        return np.ones((len(positions), 2)), np.zeros(len(positions))
    if closed and np.abs(style.scale[0] - style.scale[-1]).max() > 1e-9:
        raise ValueError("on a closed rail the style's last scale is its first")
    turns = (style.twist[-1] - style.twist[0]) / 360.0
    if closed and abs(turns - round(turns)) > 1e-9:
        raise ValueError(f"on a closed rail a twist is made of whole turns of 360 degrees, not {360.0 * turns:g}")
    scale, twist = style.at(positions)
    if scale.min() == 0.0 and ((scale[:, 0] == 0.0) != (scale[:, 1] == 0.0)).any():
        where = positions[((scale[:, 0] == 0.0) != (scale[:, 1] == 0.0)).argmax()]
        raise ValueError(f"the style's scale is 0 for one axis alone at position {where:g}: use a small one")
    return scale, twist


def _dome(
    ring: FloatArray, point: FloatArray, outwards: FloatArray, outline: FloatArray, scale: FloatArray
) -> FloatArray:
    """The rings beyond an end, from the end outwards, float64 (DOME, k, 3)."""
    spokes = ring - point
    depth = float((np.ptp(outline, axis=0) * scale).min()) / 2.0
    if depth <= 0.0:
        raise ValueError("an end whose scale is 0 is a point and takes no round cap: make it flat")
    angles = np.pi / 2.0 * np.arange(1, DOME_RINGS + 1) / DOME_RINGS
    shrink = np.cos(angles)
    shrink[-1] = 0.0
    reach = depth * np.sin(angles)[:, None] * outwards
    rings: FloatArray = shrink[:, None, None] * spokes + (point + reach)[:, None]
    return rings
