"""r-similarity of a shape to an exemplar, from their surfaces alone (symmetry §3.1).

The test is independent of the search for symmetries and of how a shape was made.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from statistics import median
from typing import Any

import numba
import numpy as np

from eval.engine.table import Cell, Table
from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.distinct_rows import distinct_rows
from stages.shape.geometry.pose import transform_points
from stages.shape.geometry.triangles import area_vectors
from stages.shape.shape import Shape

COLUMNS = ("shapes of", "exemplars", "shapes", "radius", "similar %", "probes", "matched %", "worst", "transforms")

NOTES = (
    "Similar: shapes with all probes matched. A probe is a random point of the surface; it matches if a rigid "
    "transform aligns its neighbourhood, within the radius along the surface, with one of an exemplar, in both "
    "directions and with normals. Matched: probes. Worst: matched share of the neighbourhood of the least matched "
    "probe. Transforms: median number that matches a shape; the exemplar was cut into at least as many pieces.",
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
    """Whether the exemplar has the neighbourhood of a probe, bool (p,)."""
    shares: FloatArray
    """Greatest matched share of a neighbourhood, 1 if matched, float64 (p,)."""
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
    """Test whether an exemplar has the neighbourhoods of `probes` random points of a shape, triangles (t, 3, 3).

    By §3.1, a rigid transform must take a point of the exemplar to the probe, and its neighbourhood, within `radius`
    along the surface, onto the shape with its normals. For equal topology the neighbourhood of the probe must also come
    from the exemplar. Distances along a surface are those in a graph of samples, some per cent longer; sheets closer
    than about a third of the radius count as linked.

    Transforms align corners of one kind, where two planes meet. A transform that matches one probe is tried on all
    others, so there is one search per piece of a shape. Raises ValueError for a surface without area.
    """
    return similarity_to(SampledSurface(exemplar, radius, rng), shape, probes, rng)


def similarity_to(exemplar: SampledSurface, shape: FloatArray, probes: int, rng: np.random.Generator) -> Similarity:
    """Test a shape, triangles (t, 3, 3), like `r_similarity`, against an exemplar that is sampled once for several."""
    surface = SampledSurface(shape, exemplar.radius, rng)
    samples = np.sort(rng.choice(len(surface.points), min(probes, len(surface.points)), replace=False))
    balls = surface.balls(samples)
    matched, shares = np.zeros(len(samples), dtype=bool), np.zeros(len(samples))
    transforms: list[FloatArray] = []
    for probe in range(len(samples)):
        if matched[probe]:
            continue
        transform, shares[probe] = _search(exemplar, surface, samples[probe], balls[probe], rng)
        if transform is None:
            continue
        transforms.append(transform)
        left = np.flatnonzero(~matched)
        of_left = [balls[number] for number in left.tolist()]
        same = _matches(exemplar, surface, transform, samples[left], of_left)
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


class SampledSurface:
    """A surface with samples, distances between them, corner frames, and nearest points."""

    def __init__(self, corners: FloatArray, radius: float, rng: np.random.Generator) -> None:
        import open3d as o3d

        vectors = area_vectors(corners)
        doubled = np.linalg.norm(vectors, axis=1)
        # normals of slivers, as made by cuts, are rounding errors
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        real = doubled > WELD_SHARE * radius * sides
        if not real.any():
            raise ValueError("the surface has no area")
        corners, doubled = corners[real], doubled[real]
        normals = vectors[real] / doubled[:, None]
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
        first, legs = corners[face, 0], corners[face, 1:] - corners[face, :1]
        points, normals = first + u * legs[:, 0] + v * legs[:, 1], normals[face]
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
        is_on: BoolArray = np.asarray(
            (np.abs(along - above) <= self.tolerance)
            & (np.linalg.norm(offset - along[:, None] * normals, axis=1) <= self.tolerance)
            & ((faces * normals).sum(axis=1) > np.cos(MAX_NORMAL_RADIANS))
        )
        return is_on

    @cached_property
    def tree(self) -> Any:
        """A tree of the samples."""
        from scipy.spatial import KDTree

        return KDTree(self.points)

    @cached_property
    def _links(self) -> tuple[np.ndarray, np.ndarray, FloatArray]:
        """Links between samples: where those of each begin, int64 (n + 1,), their ends, int64, and lengths."""
        first, second = self.tree.query_pairs(MAX_LINK_SPACINGS * self.spacing, output_type="ndarray").T
        x, y, z = (self.points[first] - self.points[second]).T
        lengths = np.sqrt(x * x + y * y + z * z)
        starts, order = _grouped(np.concatenate([first, second]), len(self.points))
        return starts, np.concatenate([second, first])[order], np.concatenate([lengths, lengths])[order]

    def balls(self, samples: np.ndarray, offsets: FloatArray | None = None) -> list[np.ndarray]:
        """Return the samples within the radius, less `offsets` (n,), along the surface around each sample, int64."""
        limits = np.full(len(samples), self.radius) if offsets is None else self.radius - offsets
        starts, members = _balls(*self._links, samples, limits)
        return np.split(members, starts[1:-1]) if len(samples) else []

    @cached_property
    def frames(self) -> tuple[FloatArray, np.ndarray, BoolArray]:
        """Corner frames, their kinds, and whether they are full corners.

        A frame, float64 (m, 4, 4), belongs to two planes that meet at a vertex: its third axis is the normal of one,
        and its first points towards the normal of the other. A kind, int64 (m, 3), is 100 times the cosine between the
        planes, whether the corner is convex, and which planes are ends of the surface. At full corners, bool (m,),
        three planes meet; other frames are on creases.
        """
        vertices, planes, ends, middles = self._planes()
        order = np.argsort(vertices, kind="stable")
        vertices, planes, ends, middles = vertices[order], planes[order], ends[order], middles[order]
        first = np.flatnonzero(np.r_[True, vertices[1:] != vertices[:-1]])
        full = np.add.reduceat(~ends, first) >= 3
        count = np.diff(np.r_[first, len(vertices)])
        count[count > MAX_PLANES] = 0
        start, width = np.repeat(first, count**2), np.repeat(count, count**2)
        number = np.arange(len(start)) - np.repeat(np.cumsum(count**2) - count**2, count**2)
        a, b = start + number // np.maximum(width, 1), start + number % np.maximum(width, 1)
        cosine = (planes[a] * planes[b]).sum(axis=1)
        bent = np.abs(cosine) < np.cos(MAX_NORMAL_RADIANS)
        a, b, cosine = a[bent], b[bent], cosine[bent]
        frames = np.zeros((len(a), 4, 4))
        across = planes[b] - cosine[:, None] * planes[a]
        across /= np.linalg.norm(across, axis=1)[:, None]
        frames[:, :3, 0], frames[:, :3, 1], frames[:, :3, 2] = across, np.cross(planes[a], across), planes[a]
        frames[:, :3, 3], frames[:, 3, 3] = self._vertices[vertices[a]], 1.0
        convex = ((middles[b] - self._vertices[vertices[a]]) * planes[a]).sum(axis=1) < 0
        kinds = np.column_stack([np.round(100 * cosine), convex, 2 * ends[a] + ends[b]]).astype(np.int64)
        return frames, kinds, np.repeat(full, count**2)[bent]

    @cached_property
    def inverse_frames(self) -> FloatArray:
        """The inverses of the corner frames, float64 (m, 4, 4)."""
        return np.asarray(np.linalg.inv(self.frames[0]), dtype=np.float64)

    @cached_property
    def _welded(self) -> tuple[FloatArray, np.ndarray]:
        points = self.corners.reshape(-1, 3)
        first, welded = distinct_rows(np.round(points / (WELD_SHARE * self.radius)))
        return points[first], welded.reshape(-1, 3)

    @property
    def _vertices(self) -> FloatArray:
        return self._welded[0]

    def _planes(self) -> tuple[np.ndarray, FloatArray, BoolArray, FloatArray]:
        """Return the distinct planes at vertices: the vertex, the normal, whether it is an end, and a point on it.

        At an end of the surface, the normal is tangent to the surface and points away from it. Shapes (m,), (m, 3).
        """
        vertices, faces = self._welded
        middles = self.corners.mean(axis=1)
        sides = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)])
        owner = np.tile(np.arange(len(faces)), 3)
        edge = np.sort(sides, axis=1)
        numbers = distinct_rows(edge).numbers
        single = np.flatnonzero((np.bincount(numbers)[numbers] == 1) & (edge[:, 0] != edge[:, 1]))
        along = vertices[sides[single, 1]] - vertices[sides[single, 0]]
        out = np.cross(along, self.face_normals[owner[single]])
        out /= np.maximum(np.linalg.norm(out, axis=1), 1e-300)[:, None]
        open_sides = ~self._continues(vertices[sides[single]].mean(axis=1), out, self.face_normals[owner[single]])
        single, out = single[open_sides], out[open_sides]
        at = np.concatenate([faces.T.reshape(-1), sides[single].T.reshape(-1)])
        normals = np.concatenate([np.tile(self.face_normals, (3, 1)), np.tile(out, (2, 1))])
        is_end = np.arange(len(at)) >= 3 * len(faces)
        points = np.concatenate([np.tile(middles, (3, 1)), np.tile(vertices[sides[single]].mean(axis=1), (2, 1))])
        labels = np.column_stack([at, is_end, np.round(normals / PLANE_RADIANS)])
        first = distinct_rows(labels).first
        return at[first], normals[first], is_end[first], points[first]

    def _continues(self, middles: FloatArray, out: FloatArray, normals: FloatArray) -> BoolArray:
        """Return whether the surface continues beyond sides of triangles, whose `out` (n, 3) points away, bool (n,).

        It does where two triangles meet without a common side, because the side is split in different places.
        """
        reach = 2 * self.tolerance
        continues = np.zeros(len(middles), dtype=bool)
        for angle in EDGE_DIRECTIONS:
            points = middles + reach * (np.sin(angle) * normals - np.cos(angle) * out)
            continues |= self._scene.compute_distance(points.astype(np.float32)).numpy() < reach / 2
        return continues


def _search(
    exemplar: SampledSurface, shape: SampledSurface, probe: int, around: np.ndarray, rng: np.random.Generator
) -> tuple[FloatArray | None, float]:
    """Return a transform that maps a neighbourhood of the exemplar to that of a sample of the shape, or None.

    Also return the greatest matched share of the neighbourhood.
    """
    best = 0.0
    precheck = np.r_[probe, around[rng.integers(len(around), size=PRECHECK_SAMPLES)]]
    candidates = (
        partial(_by_corners, exemplar, shape, shape.points[probe], full=True),
        partial(_by_corners, exemplar, shape, shape.points[probe], full=False),
        partial(_by_normals, exemplar, shape, probe, rng),
    )
    for find in candidates:
        transforms = find()
        for sample in precheck.tolist():
            if not len(transforms):
                break
            back = transforms[:, :3, :3].transpose(0, 2, 1)
            points = (back @ (shape.points[sample] - transforms[:, :3, 3])[:, :, None])[..., 0]
            transforms = transforms[exemplar.lies_on(points, back @ shape.normals[sample])]
        for transform in transforms[:MAX_TRANSFORMS]:
            share = float(_matches(exemplar, shape, transform, np.array([probe]), [around])[0])
            if share >= 1.0:
                return transform, share
            best = max(best, share)
    return None, best


def _by_corners(exemplar: SampledSurface, shape: SampledSurface, point: FloatArray, full: bool) -> FloatArray:
    """Return transforms (m, 4, 4) that map corner frames of the exemplar to those of the shape near a point.

    full: frames of the shape at full corners; else those on creases.
    """
    frames, kinds, is_full = shape.frames
    packed, exemplar_packed = _packed(kinds), _packed(exemplar.frames[1])
    usable = np.flatnonzero(np.isin(packed, exemplar_packed) & (is_full == full))
    order = np.argsort(np.linalg.norm(frames[usable, :3, 3] - point, axis=1), kind="stable")
    transforms = []
    for frame in usable[order[:CORNER_FRAMES_TRIED]].tolist():
        same_kind = np.flatnonzero(exemplar_packed == packed[frame])
        origin = same_kind[:: 1 + len(same_kind) // MAX_EXEMPLAR_FRAMES]
        transforms.append(frames[frame] @ exemplar.inverse_frames[origin])
    return np.concatenate(transforms) if transforms else np.empty((0, 4, 4))


def _packed(kinds: np.ndarray) -> np.ndarray:
    packed: np.ndarray = (kinds[:, 0] * 2 + kinds[:, 1]) * 4 + kinds[:, 2]
    return packed


def _by_normals(exemplar: SampledSurface, shape: SampledSurface, probe: int, rng: np.random.Generator) -> FloatArray:
    """Return transforms (m, 4, 4) that map samples of the exemplar to one of the shape, turned about its normal."""
    samples = rng.integers(len(exemplar.points), size=FALLBACK_SAMPLES)
    source = _normal_frames(exemplar.points[samples], exemplar.normals[samples])
    target = _normal_frames(shape.points[[probe]], shape.normals[[probe]])[0]
    turns = np.zeros((FALLBACK_TURNS, 4, 4))
    angle = 2 * np.pi * np.arange(FALLBACK_TURNS) / FALLBACK_TURNS
    turns[:, 0, 0] = turns[:, 1, 1] = np.cos(angle)
    turns[:, 1, 0], turns[:, 0, 1] = np.sin(angle), -np.sin(angle)
    turns[:, 2, 2] = turns[:, 3, 3] = 1.0
    transforms: FloatArray = (target @ turns @ np.linalg.inv(source)[:, None]).reshape(-1, 4, 4)
    return transforms


def _normal_frames(points: FloatArray, normals: FloatArray) -> FloatArray:
    """Return frames (n, 4, 4) at points, whose third axes are the normals."""
    frames = np.zeros((len(points), 4, 4))
    axis = np.eye(3)[np.abs(normals).argmin(axis=1)]
    across = np.cross(normals, axis)
    across /= np.linalg.norm(across, axis=1)[:, None]
    frames[:, :3, 0], frames[:, :3, 1], frames[:, :3, 2] = across, np.cross(normals, across), normals
    frames[:, :3, 3], frames[:, 3, 3] = points, 1.0
    return frames


def _matches(
    exemplar: SampledSurface, shape: SampledSurface, transform: FloatArray, probes: np.ndarray, around: list[np.ndarray]
) -> FloatArray:
    """Return the shares of neighbourhoods of the shape that a transform of the exemplar matches, float64 (n,).

    A share is the lesser of both directions; it is 0 if no point of the exemplar is mapped to the probe.
    """
    inverse: FloatArray = np.asarray(np.linalg.inv(transform), dtype=np.float64)
    shares = np.zeros(len(probes))
    points = shape.points[probes] @ inverse[:3, :3].T + inverse[:3, 3]
    mapped = np.flatnonzero(exemplar.lies_on(points, shape.normals[probes] @ inverse[:3, :3].T))
    if not len(mapped):
        return shares
    to_exemplar = _share(exemplar, inverse, shape, [around[probe] for probe in mapped.tolist()])
    distance, nearest = exemplar.tree.query(points[mapped])
    shares[mapped] = np.minimum(to_exemplar, _share(shape, transform, exemplar, exemplar.balls(nearest, distance)))
    return shares


def _share(
    target: SampledSurface, transform: FloatArray, source: SampledSurface, around: list[np.ndarray]
) -> FloatArray:
    """Return the shares of neighbourhoods of `source` that a transform maps onto `target`; 1 for empty ones."""
    sizes = np.array([len(ball) for ball in around])
    members = np.concatenate(around)
    points = source.points[members] @ transform[:3, :3].T + transform[:3, 3]
    is_on = target.lies_on(points, source.normals[members] @ transform[:3, :3].T)
    total = np.bincount(np.repeat(np.arange(len(sizes)), sizes), weights=is_on, minlength=len(sizes))
    shares: FloatArray = np.where(sizes > 0, total / np.maximum(sizes, 1), 1.0)
    return shares


@numba.njit(cache=True)
def _grouped(owners, count):
    """Return where the things of each of `count` owners begin, and the things by owner, in their order, int64."""
    starts = np.zeros(count + 1, dtype=np.int64)
    for owner in owners:
        starts[owner + 1] += 1
    starts = np.cumsum(starts)
    next_place, order = starts[:-1].copy(), np.empty(len(owners), dtype=np.int64)
    for thing in range(len(owners)):
        order[next_place[owners[thing]]] = thing
        next_place[owners[thing]] += 1
    return starts, order


@numba.njit(cache=True)
def _balls(starts, ends, lengths, centers, limits):
    """Return the samples within limits along links around centers: starts, and members in order of discovery."""
    members, first = [0 for _ in range(0)], np.zeros(len(centers) + 1, dtype=np.int64)
    distance = np.full(len(starts) - 1, np.inf)
    for number in range(len(centers)):
        queue = [centers[number]]
        distance[centers[number]] = 0.0
        touched = [centers[number]]
        while len(queue):
            following = [0 for _ in range(0)]
            for n in queue:
                for link in range(starts[n], starts[n + 1]):
                    length = distance[n] + lengths[link]
                    if length <= limits[number] and length < distance[ends[link]] - 1e-12:
                        if np.isinf(distance[ends[link]]):
                            touched.append(ends[link])
                        distance[ends[link]] = length
                        following.append(ends[link])
            queue = following
        for n in touched:
            members.append(n)
            distance[n] = np.inf
        first[number + 1] = len(members)
    packed = np.empty(len(members), dtype=np.int64)
    for n in range(len(members)):
        packed[n] = members[n]
    return first, packed
