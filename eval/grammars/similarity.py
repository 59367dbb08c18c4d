"""r-similarity of a shape to an exemplar, from their surfaces alone (symmetry §3.1).

The test is independent of the search for symmetries and of how a shape was made.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from statistics import median
from typing import Any

import numba
import numpy as np

from eval.engine.table import Cell, Table
from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.pose import transform_points
from stages.shape.geometry.triangles import area_vectors
from stages.shape.shape import Shape

COLUMNS = ("shapes of", "exemplars", "shapes", "radius", "similar %", "probes", "matched %", "worst", "transforms")

NOTES = (
    "Similar: shapes with all probes matched. A probe is a random point of the surface; it matches if a rigid "
    "transform "
    "aligns its neighbourhood, within the radius along the surface, with one of an exemplar, in both directions and "
    "with "
    "normals. Matched: probes. Worst: matched share of the neighbourhood of the least matched probe. Transforms: "
    "median number that matches a shape; the exemplar was cut into at least as many pieces.",
)

SAMPLES_PER_RADIUS = 6.0
"""Samples of a surface along the radius."""
MAX_LINK_SPACINGS = 2.2
"""Between linked samples, in spacings; distances along the surface are sums of links."""
TOLERANCE_SHARE = 0.02
"""Of the radius, between surfaces that are the same."""
MAX_NORMAL_RADIANS = 0.05
"""Between normals that are the same."""
PLANE_RADIANS = 1e-3
"""Between faces at a vertex that count as one plane."""
WELD_SHARE = 1e-4
"""Of the radius, between corners of triangles that are one vertex."""
EDGE_DIRECTIONS = np.linspace(0.25, 1.75, 7) * np.pi
"""About a side, in radians from its own triangle, in which adjacent surface is looked for."""
MAX_PLANES = 8
"""A vertex of more planes is the tip of a cone."""
CORNER_FRAMES_TRIED = 12
"""Of the shape, nearest to a probe."""
MAX_EXEMPLAR_FRAMES = 30_000
"""Of one kind, about."""
PRECHECK_SAMPLES = 6
"""Of a neighbourhood, before all of them are compared."""
MAX_TRANSFORMS = 64
"""Compared in full for a probe."""
FALLBACK_SAMPLES, FALLBACK_TURNS = 1000, 12
"""Samples of the exemplar, and turns about the normal, tried for a probe without matching corners."""


@dataclass(frozen=True)
class Similarity:
    """The result for the probes of a shape."""

    probes: FloatArray
    """Points of the shape, float64 (p, 3)."""
    matched: BoolArray
    """Whether the exemplar has the neighbourhood of each, bool (p,)."""
    shares: FloatArray
    """Greatest matched share of each neighbourhood, 1 if matched, float64 (p,)."""
    transforms: FloatArray
    """Those that matched, from the exemplar to the shape, float64 (m, 4, 4)."""

    @property
    def share(self) -> float:
        """The share of matched probes."""
        return float(self.matched.mean())

    @property
    def worst(self) -> FloatArray:
        """The least matched probe, float64 (3,)."""
        probe: FloatArray = self.probes[self.shares.argmin()]
        return probe


def r_similarity(
    exemplar: FloatArray, shape: FloatArray, radius: float, probes: int, rng: np.random.Generator
) -> Similarity:
    """Test whether each of `probes` random points of a shape, triangles (t, 3, 3), has its ball in an exemplar.

    By §3.1, a rigid transform must take a point of the exemplar to the probe, and its neighbourhood, within `radius`
    along the surface, onto the shape with its normals. For equal topology the neighbourhood of the probe must also come
    from the exemplar. Distances along a surface are those in a graph of samples, some per cent longer; sheets closer
    than about a third of the radius count as linked.

    Transforms align corners of one kind, where two planes meet. Each that matches one probe is tried on all others, so
    there is one search for each piece of a shape. Raises ValueError for a surface without area.
    """
    exemplar_surface, surface = _Surface(exemplar, radius, rng), _Surface(shape, radius, rng)
    samples = np.sort(rng.choice(len(surface.points), min(probes, len(surface.points)), replace=False))
    balls = surface.balls(samples)
    matched, shares = np.zeros(len(samples), dtype=bool), np.zeros(len(samples))
    transforms: list[FloatArray] = []
    for probe in range(len(samples)):
        if matched[probe]:
            continue
        transform, shares[probe] = _search(exemplar_surface, surface, samples[probe], balls[probe], rng)
        if transform is None:
            continue
        transforms.append(transform)
        left = np.flatnonzero(~matched)
        of_left = [balls[number] for number in left.tolist()]
        same = _matches(exemplar_surface, surface, transform, samples[left], of_left)
        matched[left[same >= 1.0]] = True
        matched[probe], shares[probe] = True, 1.0
    shares[matched] = 1.0
    return Similarity(surface.points[samples], matched, shares, np.array(transforms).reshape(-1, 4, 4))


def triangles_of(shape: Shape) -> FloatArray:
    """Return all triangles of a shape, float64 (t, 3, 3)."""
    placed = zip(shape.assembly.types.tolist(), shape.assembly.poses, strict=True)
    return np.concatenate(
        [transform_points(pose, shape.meshes[kind].vertices)[shape.meshes[kind].faces] for kind, pose in placed]
    )


def lay_side_by_side(shapes: Sequence[FloatArray]) -> FloatArray:
    """Join shapes, triangles (t, 3, 3) each, along x with gaps as wide as the widest."""
    width = max(float(np.ptp(shape[..., 0])) for shape in shapes)
    shifts = [np.array([2 * width * number - shape[..., 0].min(), 0, 0]) for number, shape in enumerate(shapes)]
    return np.concatenate([shape + shift for shape, shift in zip(shapes, shifts, strict=True)])


def similarity_row(
    name: str,
    exemplars: Sequence[FloatArray],
    shapes: Sequence[FloatArray],
    radius: float,
    probes: int,
    rng: np.random.Generator,
) -> tuple[Cell, ...]:
    """Return the row of at least one shape, triangles (t, 3, 3), compared with its exemplars.

    radius: as a share of the longest side of the largest exemplar's box.
    """
    longest = max(float(np.ptp(exemplar.reshape(-1, 3), axis=0).max()) for exemplar in exemplars)
    joined = lay_side_by_side(exemplars)
    results = [r_similarity(joined, shape, radius * longest, probes, rng) for shape in shapes]
    return (
        name,
        len(exemplars),
        len(shapes),
        radius * longest,
        100 * float(np.mean([result.matched.all() for result in results])),
        sum(len(result.probes) for result in results),
        100 * float(np.concatenate([result.matched for result in results]).mean()),
        float(min(result.shares.min() for result in results)),
        round(median(len(result.transforms) for result in results)),
    )


def similarity_table(rows: Sequence[tuple[Cell, ...]]) -> Table:
    """Return the table of rows of `similarity_row`."""
    return Table("r-similarity of shapes to their exemplars", COLUMNS, tuple(rows), NOTES)


class _Surface:
    """A surface with samples, distances between them, corner frames, and nearest points."""

    def __init__(self, corners: FloatArray, radius: float, rng: np.random.Generator) -> None:
        import open3d as o3d

        ways = area_vectors(corners)
        doubled = np.linalg.norm(ways, axis=1)
        # slivers, such as cuts leave, have normals of rounding
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        real = doubled > WELD_SHARE * radius * sides
        if not real.any():
            raise ValueError("a surface without area is similar to nothing")
        corners, doubled = corners[real], doubled[real]
        normals = ways[real] / doubled[:, None]
        self.corners, self.face_normals, self.radius = corners, normals, radius
        self.tolerance, self.spacing = TOLERANCE_SHARE * radius, radius / SAMPLES_PER_RADIUS
        self._scene = o3d.t.geometry.RaycastingScene(1)
        self._scene.add_triangles(
            corners.reshape(-1, 3).astype(np.float32), np.arange(3 * len(corners), dtype=np.uint32).reshape(-1, 3)
        )
        areas = np.cumsum(doubled) / 2
        count = int(np.ceil(areas[-1] / self.spacing**2))
        face = np.searchsorted(areas, (np.arange(count) + rng.random(count)) / count * areas[-1])
        face = np.minimum(face, len(corners) - 1)
        u, v = rng.random((2, count, 1))
        u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
        first, ways = corners[face, 0], corners[face, 1:] - corners[face, :1]
        points, normals = first + u * ways[:, 0] + v * ways[:, 1], normals[face]
        clear = self.lies_on(points, normals)
        self.points, self.normals = points[clear], normals[clear]

    def lies_on(self, points: FloatArray, normals: FloatArray) -> BoolArray:
        """Return which points (n, 3) are on the surface with normals (n, 3), bool (n,).

        The query is slightly above the surface, where the right side of a crease is the nearest.
        """
        above = 2 * self.tolerance
        query = points + above * normals
        nearest = self._scene.compute_closest_points(query.astype(np.float32))
        offset = query - nearest["points"].numpy()
        along = (offset * normals).sum(axis=1)
        faces = self.face_normals[nearest["primitive_ids"].numpy()]
        found: BoolArray = np.asarray(
            (np.abs(along - above) <= self.tolerance)
            & (np.linalg.norm(offset - along[:, None] * normals, axis=1) <= self.tolerance)
            & ((faces * normals).sum(axis=1) > np.cos(MAX_NORMAL_RADIANS))
        )
        return found

    @cached_property
    def tree(self) -> Any:
        """A tree of the samples."""
        from scipy.spatial import KDTree

        return KDTree(self.points)

    @cached_property
    def _links(self) -> tuple[np.ndarray, np.ndarray, FloatArray]:
        pairs = self.tree.query_pairs(MAX_LINK_SPACINGS * self.spacing, output_type="ndarray")
        ends = np.concatenate([pairs, pairs[:, ::-1]])
        ends = ends[np.argsort(ends[:, 0], kind="stable")]
        lengths: FloatArray = np.linalg.norm(self.points[ends[:, 0]] - self.points[ends[:, 1]], axis=1)
        return np.searchsorted(ends[:, 0], np.arange(len(self.points) + 1)), ends[:, 1], lengths

    def balls(self, samples: np.ndarray, offsets: FloatArray | None = None) -> list[np.ndarray]:
        """Return the samples within the radius, less `offsets` (n,), along the surface around each sample, int64."""
        limits = np.full(len(samples), self.radius) if offsets is None else self.radius - offsets
        starts, members = _balls(*self._links, samples, limits)
        return np.split(members, starts[1:-1]) if len(samples) else []

    @cached_property
    def frames(self) -> tuple[FloatArray, np.ndarray, BoolArray]:
        """Corner frames (m, 4, 4), the third axis one plane's normal and the first turned to that of another which
        meets it; what kind each is, int64 (m, 3): the angle of the planes in hundredths of its cosine, whether the
        corner bends outward there, and which planes are none but ends of the surface; and whether three planes meet
        there, bool (m,): else it may be any point of a crease."""
        vertices, planes, ends, middles = self._planes()
        order = np.argsort(vertices, kind="stable")
        vertices, planes, ends, middles = vertices[order], planes[order], ends[order], middles[order]
        first = np.flatnonzero(np.r_[True, vertices[1:] != vertices[:-1]])
        full = np.add.reduceat(~ends, first) >= 3
        count = np.diff(np.r_[first, len(vertices)])
        count[count > MAX_PLANES] = 0
        start, width = np.repeat(first, count**2), np.repeat(count, count**2)
        number = np.arange(len(start)) - np.repeat(np.cumsum(count**2) - count**2, count**2)
        one, two = start + number // np.maximum(width, 1), start + number % np.maximum(width, 1)
        cosine = (planes[one] * planes[two]).sum(axis=1)
        bent = np.abs(cosine) < np.cos(MAX_NORMAL_RADIANS)
        one, two, cosine = one[bent], two[bent], cosine[bent]
        frames = np.zeros((len(one), 4, 4))
        across = planes[two] - cosine[:, None] * planes[one]
        across /= np.linalg.norm(across, axis=1)[:, None]
        frames[:, :3, 0], frames[:, :3, 1], frames[:, :3, 2] = across, np.cross(planes[one], across), planes[one]
        frames[:, :3, 3], frames[:, 3, 3] = self._vertices[vertices[one]], 1.0
        outward = ((middles[two] - self._vertices[vertices[one]]) * planes[one]).sum(axis=1) < 0
        kinds = np.column_stack([np.round(100 * cosine), outward, 2 * ends[one] + ends[two]]).astype(np.int64)
        return frames, kinds, np.repeat(full, count**2)[bent]

    @cached_property
    def _welded(self) -> tuple[FloatArray, np.ndarray]:
        points = self.corners.reshape(-1, 3)
        _, first, place = np.unique(
            np.round(points / (WELD_SHARE * self.radius)), axis=0, return_index=True, return_inverse=True
        )
        return points[first], place.reshape(-1, 3)

    @property
    def _vertices(self) -> FloatArray:
        return self._welded[0]

    def _planes(self) -> tuple[np.ndarray, FloatArray, BoolArray, FloatArray]:
        """Each plane at each vertex once: the vertex, its normal (m, 3), whether it is no plane but an end of the
        surface, whose normal lies along the surface, and a point on it (m, 3)."""
        vertices, faces = self._welded
        middles = self.corners.mean(axis=1)
        sides = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)])
        of = np.tile(np.arange(len(faces)), 3)
        edge = np.sort(sides, axis=1)
        _, inverse, count = np.unique(edge, axis=0, return_inverse=True, return_counts=True)
        single = np.flatnonzero((count[inverse.reshape(-1)] == 1) & (edge[:, 0] != edge[:, 1]))
        along = vertices[sides[single, 1]] - vertices[sides[single, 0]]
        out = np.cross(along, self.face_normals[of[single]])
        out /= np.maximum(np.linalg.norm(out, axis=1), 1e-300)[:, None]
        bare = ~self._goes_on(vertices[sides[single]].mean(axis=1), out, self.face_normals[of[single]])
        single, out = single[bare], out[bare]
        at = np.concatenate([faces.T.reshape(-1), sides[single].T.reshape(-1)])
        normals = np.concatenate([np.tile(self.face_normals, (3, 1)), np.tile(out, (2, 1))])
        is_end = np.arange(len(at)) >= 3 * len(faces)
        points = np.concatenate([np.tile(middles, (3, 1)), np.tile(vertices[sides[single]].mean(axis=1), (2, 1))])
        labels = np.column_stack([at, is_end, np.round(normals / PLANE_RADIANS)])
        _, first = np.unique(labels, axis=0, return_index=True)
        return at[first], normals[first], is_end[first], points[first]

    def _goes_on(self, middles: FloatArray, out: FloatArray, normals: FloatArray) -> BoolArray:
        """Whether there is more surface about sides of triangles, bool (n,), than the triangles, which lie against
        `out` (n, 3): sides that are cut in other places on either side are no ends, though no two triangles share
        them."""
        reach = 2 * self.tolerance
        found = np.zeros(len(middles), dtype=bool)
        for angle in EDGE_DIRECTIONS:
            asked = middles + reach * (np.sin(angle) * normals - np.cos(angle) * out)
            found |= self._scene.compute_distance(asked.astype(np.float32)).numpy() < reach / 2
        return found


def _search(
    one: _Surface, other: _Surface, probe: int, around: np.ndarray, rng: np.random.Generator
) -> tuple[FloatArray | None, float]:
    """A motion that takes a neighbourhood of the exemplar `one` to that of a sample of the shape `other`, if any is
    found, and the greatest share of it that one did."""
    best = 0.0
    glance = np.r_[probe, around[rng.integers(len(around), size=PRECHECK_SAMPLES)]]
    for way in range(3):
        motions = _by_corners(one, other, other.points[probe], way) if way < 2 else _anywhere(one, other, probe, rng)
        for sample in glance.tolist():
            back = np.linalg.inv(motions)
            there = back[:, :3, :3] @ other.points[sample] + back[:, :3, 3]
            motions = motions[one.lies_on(there, back[:, :3, :3] @ other.normals[sample])] if len(back) else motions
        for motion in motions[:MAX_TRANSFORMS]:
            share = float(_matches(one, other, motion, np.array([probe]), [around])[0])
            if share >= 1.0:
                return motion, share
            best = max(best, share)
    return None, best


def _by_corners(one: _Surface, other: _Surface, point: FloatArray, way: int) -> FloatArray:
    """Motions (m, 4, 4) that take corner frames of one surface to those of the other that are near a point: to full
    corners, or, `way` 1, to points of creases, such as seams leave."""
    frames, kinds, full = other.frames
    own, known, _ = one.frames
    there = np.flatnonzero(np.isin(_packed(kinds), _packed(known)) & (full == (way == 0)))
    order = np.argsort(np.linalg.norm(frames[there, :3, 3] - point, axis=1), kind="stable")
    found = []
    for each in there[order[:CORNER_FRAMES_TRIED]].tolist():
        like = np.flatnonzero((known == kinds[each]).all(axis=1))
        found.append(frames[each] @ np.linalg.inv(own[like[:: 1 + len(like) // MAX_EXEMPLAR_FRAMES]]))
    return np.concatenate(found) if found else np.empty((0, 4, 4))


def _packed(kinds: np.ndarray) -> np.ndarray:
    packed: np.ndarray = (kinds[:, 0] * 2 + kinds[:, 1]) * 4 + kinds[:, 2]
    return packed


def _anywhere(one: _Surface, other: _Surface, probe: int, rng: np.random.Generator) -> FloatArray:
    """Motions (m, 4, 4) that take samples of one surface to a sample of the other, however turned about its normal."""
    asked = rng.integers(len(one.points), size=FALLBACK_SAMPLES)
    own = _with_normal(one.points[asked], one.normals[asked])
    goal = _with_normal(other.points[[probe]], other.normals[[probe]])[0]
    turns = np.zeros((FALLBACK_TURNS, 4, 4))
    angle = 2 * np.pi * np.arange(FALLBACK_TURNS) / FALLBACK_TURNS
    turns[:, 0, 0] = turns[:, 1, 1] = np.cos(angle)
    turns[:, 1, 0], turns[:, 0, 1] = np.sin(angle), -np.sin(angle)
    turns[:, 2, 2] = turns[:, 3, 3] = 1.0
    found: FloatArray = (goal @ turns @ np.linalg.inv(own)[:, None]).reshape(-1, 4, 4)
    return found


def _with_normal(points: FloatArray, normals: FloatArray) -> FloatArray:
    """A frame at each point whose third axis is the normal."""
    frames = np.zeros((len(points), 4, 4))
    least = np.eye(3)[np.abs(normals).argmin(axis=1)]
    across = np.cross(normals, least)
    across /= np.linalg.norm(across, axis=1)[:, None]
    frames[:, :3, 0], frames[:, :3, 1], frames[:, :3, 2] = across, np.cross(normals, across), normals
    frames[:, :3, 3], frames[:, 3, 3] = points, 1.0
    return frames


def _matches(
    one: _Surface, other: _Surface, motion: FloatArray, probes: np.ndarray, around: list[np.ndarray]
) -> FloatArray:
    """The share of the neighbourhood of each of `probes` of the shape `other` that a motion (4, 4) of the exemplar
    matches, both ways, float64 (n,); 0 where it takes no point to the probe."""
    back: FloatArray = np.asarray(np.linalg.inv(motion), dtype=np.float64)
    shares = np.zeros(len(probes))
    there = other.points[probes] @ back[:3, :3].T + back[:3, 3]
    asked = np.flatnonzero(one.lies_on(there, other.normals[probes] @ back[:3, :3].T))
    if not len(asked):
        return shares
    forth = _share(one, back, other, [around[each] for each in asked.tolist()])
    away, start = one.tree.query(there[asked])
    shares[asked] = np.minimum(forth, _share(other, motion, one, one.balls(start, away)))
    return shares


def _share(target: _Surface, motion: FloatArray, source: _Surface, around: list[np.ndarray]) -> FloatArray:
    """Of each neighbourhood of `source` the share that a motion takes onto `target`; 1 where there is nothing."""
    sizes = np.array([len(each) for each in around])
    members = np.concatenate(around)
    points = source.points[members] @ motion[:3, :3].T + motion[:3, 3]
    found = target.lies_on(points, source.normals[members] @ motion[:3, :3].T)
    total = np.bincount(np.repeat(np.arange(len(sizes)), sizes), weights=found, minlength=len(sizes))
    shares: FloatArray = np.where(sizes > 0, total / np.maximum(sizes, 1), 1.0)
    return shares


@numba.njit(cache=True)
def _balls(starts, ends, lengths, places, limits):
    """Samples within a limit along links of each of `places`: their starts and members, in the order they are met."""
    members, first = [0 for _ in range(0)], np.zeros(len(places) + 1, dtype=np.int64)
    distance = np.full(len(starts) - 1, np.inf)
    for number in range(len(places)):
        queue = [places[number]]
        distance[places[number]] = 0.0
        touched = [places[number]]
        while len(queue):
            after = [0 for _ in range(0)]
            for n in queue:
                for link in range(starts[n], starts[n + 1]):
                    way = distance[n] + lengths[link]
                    if way <= limits[number] and way < distance[ends[link]] - 1e-12:
                        if np.isinf(distance[ends[link]]):
                            touched.append(ends[link])
                        distance[ends[link]] = way
                        after.append(ends[link])
            queue = after
        for n in touched:
            members.append(n)
            distance[n] = np.inf
        first[number + 1] = len(members)
    found = np.empty(len(members), dtype=np.int64)
    for n in range(len(members)):
        found[n] = members[n]
    return first, found
