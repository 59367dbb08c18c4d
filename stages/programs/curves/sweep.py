"""Sweep and loft: a profile along a rail, with scale and twist (geocode §3.1, "triplets")."""

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
"""The ends of a sweep: flat, or a dome as deep as half the profile's shorter side."""

DOME_RINGS = 3
"""Rings of a dome beyond the end, its pole included."""


def sweep(
    rail: Curve,
    profile: Profile,
    style: Style | None = None,
    up: npt.ArrayLike | None = None,
    caps: Caps | tuple[Caps, Caps] = "flat",
) -> QuadMesh:
    """Sweep a profile along a rail: a leg, a rail, a handle; along a closed rail a ring without ends.

    Corners of the rail are mitred. There is a ring at each point of the rail and at each position of the style. A scale
    of 0 at an end closes the mesh in a point. A wide profile intersects itself where the rail turns too tightly.

    up: (3,), the profile's y leans towards it at the start and does not roll from there on. None is the world's +y, or
    +z for a rail that starts steeper than 45 degrees; state it where a parameter moves a rail across that angle.
    caps: one for both ends, or (start, end)

    Raises ValueError for an inner scale of 0 or of one axis alone, for `up` parallel to the rail, and for a style of a
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
    """Sweep a changing profile: `(position, profile)` pairs from 0 to 1, blended in between.

    Everything else is as in `sweep`; both ends are filled like the first profile. Raises ValueError for profiles with
    different numbers of points, for other positions, and for a closed rail whose last profile is not its first.
    """
    positions = np.array([position for position, _ in profiles], dtype=np.float64)
    if len(positions) < 2 or positions[0] != 0.0 or positions[-1] != 1.0 or (np.diff(positions) <= 0.0).any():
        raise ValueError(f"the positions of a loft's profiles rise from 0 to 1, unlike {positions.tolist()}")
    counts = {len(profile) for _, profile in profiles}
    if len(counts) > 1:
        raise ValueError(f"a loft's profiles have one count of points, not {sorted(counts)}")
    if rail.closed and not np.allclose(profiles[0][1].points, profiles[-1][1].points):
        raise ValueError("a loft along a closed rail ends with the profile it starts with")
    return _carried(rail, np.stack([profile.points for _, profile in profiles]), None, style, up, caps, positions)


def loft_rings(rings: npt.ArrayLike, closed: bool = False) -> QuadMesh:
    """The mesh over rings of points in space, (r, k, 3), each counter-clockwise seen from the rings after it.

    A first or last ring of coincident points is a pole; others are filled from their middle, which must see the whole
    ring. Clockwise rings turn the mesh inside out; `mesh_defects` reports it.
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
    profile_positions: FloatArray | None = None,
) -> QuadMesh:
    """The skin over `outline` (k, 2), or outlines (p, k, 2) at positions (p,), at the stations of the rail."""
    from stages.programs.curves.kernels import place_rings

    stations = _stations(rail, style, profile_positions)
    x, y = rail_axes(stations.points, stations.tangents, stations.positions, rail.closed, up)
    outlines = outline[None] if profile_positions is None else _blended(outline, profile_positions, stations.positions)
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


def _stations(rail: Curve, style: Style | None, profile_positions: FloatArray | None) -> Stations:
    """The stations of the rail, of the style and of a loft's profiles, each once."""
    wanted = [] if style is None else [style.positions]
    wanted += [] if profile_positions is None else [profile_positions]
    if all(len(positions) == 2 for positions in wanted) and not rail.closed:
        return rail.own_stations
    positions = np.unique(np.concatenate([rail.positions, *wanted]))
    if rail.closed:
        positions = positions[positions < 1.0 - 1e-9]
    kept = np.concatenate([[True], np.diff(positions) > 1e-6])
    # Among coincident points the rail's own is kept, since it may be a corner.
    own = np.abs(positions[:, None] - rail.positions[None]).argmin(axis=1)
    exact = rail.positions[own]
    positions = np.where(np.abs(exact - positions) <= 1e-6, exact, positions)[kept]
    return rail.own_stations if np.array_equal(positions, rail.positions) else rail.stations(positions)


def _blended(outlines: FloatArray, given: FloatArray, positions: FloatArray) -> FloatArray:
    """The outline at each position, float64 (n, k, 2), interpolated linearly between those at `given` (p,)."""
    before = np.clip(np.searchsorted(given, positions, side="right") - 1, 0, len(given) - 2)
    share = ((positions - given[before]) / (given[before + 1] - given[before]))[:, None, None]
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
        position = positions[((scale[:, 0] == 0.0) != (scale[:, 1] == 0.0)).argmax()]
        raise ValueError(f"the style's scale is 0 for one axis alone at position {position:g}: use a small one")
    return scale, twist


def _dome(
    ring: FloatArray, point: FloatArray, outwards: FloatArray, outline: FloatArray, scale: FloatArray
) -> FloatArray:
    """The rings beyond an end, from the end outwards, float64 (rings, k, 3)."""
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
