# SPDX-License-Identifier: GPL-3.0-or-later
"""Queries of a surface as `mathutils.bvhtree.BVHTree` of Blender has them, with exact answers, and in batches.

Vertices, points and rays are float32, as in Blender. Which triangle is nearest, which a ray hits and which overlap is
decided without error on these. Distances of points and nearest points are rounded once, those of rays twice. Without
Blender's `mathutils`, vectors are NumPy arrays of three float32. The class differs from Blender's in these answers:

- Of triangles at the same distance, the one of the smallest index is found.
- A distance that is given counts as within: a point on the surface is found at distance 0.
- `find_nearest_range` returns the nearest first. As in Blender, each triangle of a polygon has an entry of its own.
- Triangles that only touch overlap, in a vertex, along an edge or in one plane; Blender's test of their planes has a
  tolerance and leaves out part of them. In a tree with itself, neighbours are left out as in Blender: triangles that
  share two vertices, and those that share one and have no further point in common.
- A point or ray that is NaN or infinite raises an error; in Blender it finds nothing.
- `epsilon` is accepted and without effect: no ray passes between two triangles that share an edge.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _arrays, _compiled

native = _compiled.module()

Floats = npt.NDArray[np.float32]
Doubles = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

Found = tuple[Any, Any, int | None, float | None]
"""Position, normal, polygon and distance; None four times if nothing was found."""

Columns = tuple[Floats, Floats, Integers, Floats]
"""Positions and normals, (n, 3) float32, NaN = none; polygons, (n,) int64, -1 = none; distances, (n,) float32, inf."""

NOTHING: Found = (None, None, None, None)

_MOST = 1e300
"""As good as no limit for distances of float32, and no product with it overflows."""

SURFACES = ("MESH", "CURVE", "SURFACE", "FONT", "META")
"""Types of Blender's objects that have triangles."""

FAR = 1.84467e19
"""Largest distance of nearest polygons unless another is given, as in Blender."""

try:
    from mathutils import Vector
except ImportError:

    def Vector(numbers: Floats) -> Any:  # noqa: N802 (stands for the class of mathutils)
        """Three numbers as they are."""
        return numbers


class BVHTree:
    """A surface of triangles that belong to polygons; immutable. Made by FromPolygons(), FromObject() or FromBMesh().

    vertices: (n, 3) floats, rounded to float32. triangles: (m, 3) indices. polygons: (m,), the polygon of each
    triangle, None = each its own. normals: (p, 3), of the polygons, None = those of the triangles. Raises
    halfspace_native.ShapeError, and MemoryError for a surface that does not fit. Triangles with a vertex that is not
    finite are never found, those without area only by rays never.
    """

    def __init__(
        self,
        vertices: npt.ArrayLike,
        triangles: npt.ArrayLike,
        polygons: npt.ArrayLike | None = None,
        normals: npt.ArrayLike | None = None,
    ) -> None:
        self._vertices = _float32(_corners(vertices))
        indices = _arrays.indices("triangles", triangles)
        self._structure = native.build(self._vertices, indices, "bvh-sah")
        self._triangles = indices
        self._polygons = np.arange(len(indices)) if polygons is None else np.asarray(polygons, np.int64)
        if normals is None:
            a, b, c = self._vertices.astype(np.float64)[indices].transpose(1, 0, 2)
            of_triangles = _unit(np.cross(b - a, c - a))
        else:
            of_triangles = np.asarray(normals, np.float64).reshape(-1, 3)[self._polygons]
        self._normals = _float32(of_triangles)

    @classmethod
    def FromPolygons(  # noqa: N802 (the name in Blender)
        cls,
        vertices: npt.ArrayLike | Iterable[Sequence[float]],
        polygons: Iterable[Iterable[int]] | npt.NDArray[Any],
        all_triangles: bool = False,
        epsilon: float = 0.0,  # noqa: ARG003 (in Blender's order)
    ) -> BVHTree:
        """The tree of polygons over vertices.

        vertices: (n, 3). polygons: the indices of the vertices of each, those of fewer than three are never found. Both
        may be generators.
        Polygons of more than three are cut into triangles in their plane, a quadrilateral at its second and fourth
        vertex if this diagonal lies inside. all_triangles: promises that all have three. epsilon: without effect.
        Raises ValueError for indices out of range, and for other polygons than promised.
        """
        points = _corners(vertices)
        listed = polygons if isinstance(polygons, np.ndarray) else [tuple(polygon) for polygon in polygons]
        _check(listed, len(points), 3 if all_triangles else None)
        if all_triangles:
            return cls(points, np.asarray(listed, np.int64))
        # Round the vertices first: the triangles must suit what is traced.
        return cls(points, *_cut(_float32(points).astype(np.float64), listed))

    @classmethod
    def FromObject(  # noqa: N802 (the name in Blender)
        cls,
        object: Any,  # noqa: A002 (the name in Blender)
        depsgraph: Any,
        deform: bool = True,
        cage: bool = False,
        epsilon: float = 0.0,  # noqa: ARG003 (in Blender's order)
    ) -> BVHTree:
        """The tree of an object of Blender as `depsgraph` evaluates it, in the object's space: of a mesh, or of the
        surface of a curve, text, surface or metaball.

        Its triangles are those that Blender makes, and as there each has its own normal. epsilon: without effect.
        Raises ValueError for an object without surface, and for deform=False or cage=True: Python cannot reach these.
        """
        if not deform or cage:
            raise ValueError("deform, cage: only deform=True and cage=False are offered")
        if object.type not in SURFACES:
            raise ValueError(f"object: expected a mesh or a surface, got {object.type}")
        evaluated = object.evaluated_get(depsgraph)
        mesh = evaluated.to_mesh()
        try:
            if mesh is None or (object.type != "MESH" and not len(mesh.polygons)):
                raise ValueError(f"object: expected a mesh or a surface, got {object.type} without one")
            count = len(mesh.loop_triangles)
            vertices = np.empty(3 * len(mesh.vertices), np.float32)
            triangles, polygons = np.empty(3 * count, np.int32), np.empty(count, np.int32)
            mesh.vertices.foreach_get("co", vertices)
            mesh.loop_triangles.foreach_get("vertices", triangles)
            mesh.loop_triangles.foreach_get("polygon_index", polygons)
        finally:
            evaluated.to_mesh_clear()
        return cls(vertices, triangles, polygons)

    @classmethod
    def FromBMesh(cls, bmesh: Any, epsilon: float = 0.0) -> BVHTree:  # noqa: N802, ARG003 (as in Blender)
        """The tree of a BMesh of Blender. Its triangles are those that Blender makes. epsilon: without effect."""
        vertex = {one: number for number, one in enumerate(bmesh.verts)}
        face = {one: number for number, one in enumerate(bmesh.faces)}
        loops = bmesh.calc_loop_triangles()
        return cls(
            np.array([one.co for one in vertex], np.float32).reshape(-1, 3),
            np.array([[vertex[loop.vert] for loop in triangle] for triangle in loops], np.int64).reshape(-1, 3),
            np.array([face[triangle[0].face] for triangle in loops], np.int64),
            np.array([one.normal for one in face], np.float32).reshape(-1, 3),
        )

    def ray_cast(self, origin: Sequence[float], direction: Sequence[float], distance: float = float("inf")) -> Found:
        """The nearest polygon that a ray hits, from either side, at most at `distance`.

        direction: of any length; zero hits nothing. Raises halfspace_native.NonFiniteError.
        """
        return _single(self.ray_cast_batch(_point(origin), _point(direction), distance))

    def find_nearest(self, origin: Sequence[float], distance: float = FAR) -> Found:
        """The polygon nearest to a point, at most at `distance`. Raises halfspace_native.NonFiniteError."""
        return _single(self.find_nearest_batch(_point(origin), distance))

    def find_nearest_range(self, origin: Sequence[float], distance: float = FAR) -> list[Found]:
        """All triangles at most at `distance` from a point, nearest first, each with the index of its polygon.

        Raises halfspace_native.NonFiniteError.
        """
        _, columns = self.find_nearest_range_batch(_point(origin), distance)
        return [_single(tuple(column[i : i + 1] for column in columns)) for i in range(len(columns[2]))]

    def overlap(self, other_tree: BVHTree) -> list[tuple[int, int]]:
        """All pairs of a polygon of this tree and one of the other that have a point in common, sorted.

        With the tree itself, neighbours are left out as the module describes.
        """
        return [(int(a), int(b)) for a, b in self.overlap_batch(other_tree)]

    def ray_cast_batch(
        self, origins: npt.ArrayLike, directions: npt.ArrayLike, distance: npt.ArrayLike = float("inf")
    ) -> Columns:
        """As ray_cast() for many rays. origins, directions: (n, 3). distance: one number or (n,).

        Raises ValueError for arrays of different shapes, and as ray_cast().
        """
        starts, ways = _rows(origins), _rows(directions).astype(np.float64)
        if starts.shape != ways.shape:
            raise ValueError(f"origins and directions differ in shape: {starts.shape} and {ways.shape}")
        # Scale directions by powers of two, which changes no ray.
        _, exponents = np.frexp(np.abs(ways).max(axis=1, initial=0))
        ways = np.ldexp(ways, -exponents[:, None])
        length = np.linalg.norm(ways, axis=1)
        limit = _limits(np.minimum(distance, _MOST), len(length)).astype(np.float64)
        # A distance within two roundings of the limit is compared below.
        reach = np.divide(limit, length, out=np.full_like(length, np.inf), where=length > 0)
        hits = self._structure.closest(starts, ways.astype(np.float32), t_max=_float32(reach * (1 + 2**-21)))
        distances = np.full_like(length, np.inf)
        np.multiply(hits.t, length, out=distances, where=hits.triangle >= 0)
        distances = _float32(distances).astype(np.float64)
        triangle = np.where(distances <= limit, hits.triangle, -1)
        # Points by weights lie on their triangles.
        corners = self._vertices.astype(np.float64)[self._triangles[triangle]] if len(self._triangles) else None
        points = np.full((len(starts), 3), np.nan)
        if corners is not None:
            u, v = hits.u.astype(np.float64)[:, None], hits.v.astype(np.float64)[:, None]
            points = corners[:, 0] + u * (corners[:, 1] - corners[:, 0]) + v * (corners[:, 2] - corners[:, 0])
        return self._columns(_float32(points), triangle, _float32(distances))

    def find_nearest_batch(self, origins: npt.ArrayLike, distance: npt.ArrayLike = FAR) -> Columns:
        """As find_nearest() for many points. origins: (n, 3). distance: one number or (n,)."""
        points = _rows(origins)
        found = self._structure.closest_points(points, _limits(distance, len(points)))
        return self._columns(found.point, found.triangle, found.distance)

    def find_nearest_range_batch(
        self, origins: npt.ArrayLike, distance: npt.ArrayLike = FAR
    ) -> tuple[Integers, Columns]:
        """As find_nearest_range() for many points: where the entries of each begin, (n + 1,) int64, and all entries.

        origins: (n, 3). distance: one number or (n,).
        """
        points = _rows(origins)
        offsets, found = self._structure.points_within(points, _limits(distance, len(points)))
        return offsets, self._columns(found.point, found.triangle, found.distance)

    def overlap_batch(self, other: BVHTree) -> Integers:
        """As overlap(): (k, 2) int64."""
        pairs = self._structure.overlaps(other._structure)
        polygons = np.stack([self._polygons[pairs[:, 0]], other._polygons[pairs[:, 1]]], axis=1)
        unique: Integers = np.unique(polygons, axis=0)
        return unique

    def _columns(self, points: Floats, triangles: npt.NDArray[Any], distances: Floats) -> Columns:
        """Positions, normals, polygons and distances of triangles, -1 = none."""
        none = triangles < 0
        if none.all():
            count = len(triangles)
            empty = np.full((count, 3), np.nan, np.float32)
            return empty, empty.copy(), np.full(count, -1), np.full(count, np.inf, np.float32)
        polygons = np.where(none, -1, self._polygons[triangles])
        normals = np.where(none[:, None], np.float32(np.nan), self._normals[triangles])
        points = np.where(none[:, None], np.float32(np.nan), points)
        return points, normals, polygons, np.where(none, np.float32(np.inf), distances)


def _corners(vertices: Any) -> Doubles:
    """Vertices as (n, 3) float64, from an array, flat or not, or from anything to iterate over. Raises ValueError."""
    array = np.asarray(vertices if isinstance(vertices, np.ndarray) else list(vertices), np.float64)
    if array.size and (array.shape[1:] != (3,) if array.ndim != 1 else array.size % 3):
        raise ValueError(f"vertices: expected shape (n, 3), got {array.shape}")
    return array.reshape(-1, 3)


def _float32(numbers: Doubles) -> Floats:
    """Numbers rounded to float32; those beyond its range become infinite."""
    with np.errstate(over="ignore", under="ignore"):
        return numbers.astype(np.float32)


def _rows(points: npt.ArrayLike) -> Floats:
    """Points as (n, 3) float32. Raises ValueError for another shape."""
    array = np.asarray(points, np.float64)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"expected an (n, 3) array, got shape {array.shape}")
    return _float32(array)


def _point(point: Sequence[float]) -> Floats:
    """One point or direction as (1, 3) float32. Raises ValueError unless there are three numbers."""
    array = np.asarray(point, np.float64)
    if array.shape != (3,):
        raise ValueError(f"expected three numbers, got shape {array.shape}")
    return _float32(array[None])


def _limits(distance: npt.ArrayLike, count: int) -> Floats:
    """Distances as (count,) float32. Raises ValueError if their number differs."""
    return _float32(np.broadcast_to(np.asarray(distance, np.float64), (count,)))


def _single(columns: Any) -> Found:
    """The only row of columns as Blender returns it."""
    point, normal, polygon, distance = (column[0] for column in columns)
    if polygon < 0:
        return NOTHING
    return Vector(point), Vector(normal), int(polygon), float(distance)


def _unit(vectors: Doubles) -> Doubles:
    """Vectors of unit length; zero stays zero."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)


def _check(polygons: Sequence[Sequence[int]] | npt.NDArray[Any], count: int, size: int | None) -> None:
    """Raises ValueError for a polygon with an index out of range, or of another number of vertices than `size`."""
    for number, polygon in enumerate(polygons):
        if size is not None and len(polygon) != size:
            raise ValueError(f"polygons[{number}]: expected {size} vertices, got {len(polygon)}")
        for index in polygon:
            if not 0 <= index < count:
                raise ValueError(f"polygons[{number}]: index {index} is out of range for {count} vertices")
            if int(index) != index:
                raise ValueError(f"polygons[{number}]: index {index} is no whole number")


def _cut(points: Doubles, polygons: Sequence[Sequence[int]] | npt.NDArray[Any]) -> tuple[Integers, Integers, Doubles]:
    """The triangles of polygons, (m, 3), the polygon of each, (m,), and the polygons' normals of unit length."""
    sizes = np.array([len(polygon) for polygon in polygons], np.int64)
    normals = np.zeros((len(sizes), 3))
    triangles, owners = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)]
    for size in np.unique(sizes[sizes > 2]):
        numbers = np.flatnonzero(sizes == size)
        rows = np.array([polygons[int(i)] for i in numbers], np.int64)
        corners = points[rows]
        # The sum of the normals of the triangles from the first corner.
        sides = corners[:, 1:] - corners[:, :1]
        normals[numbers] = np.cross(sides[:, :-1], sides[:, 1:]).sum(axis=1)
        parts = _parts(corners, normals[numbers])
        triangles.append(np.take_along_axis(rows[:, None], parts, axis=2).reshape(-1, 3))
        owners.append(np.repeat(numbers, size - 2))
    # Sort by polygon, so that of equal distances the first polygon's counts.
    all_owners = np.concatenate(owners)
    order = np.argsort(all_owners, kind="stable")
    return np.concatenate(triangles)[order], all_owners[order], _unit(normals)


def _parts(corners: Doubles, normals: Doubles) -> Integers:
    """The triangles of polygons of one size: (k, size - 2, 3), as numbers of their corners. corners: (k, size, 3)."""
    count, size, _ = corners.shape
    if size == 3:
        return np.broadcast_to(np.arange(3), (count, 1, 3))
    if size == 4:
        # The diagonal from the second to the fourth corner lies inside if both triangles are turned as the whole.
        a, b, c, d = corners.transpose(1, 0, 2)
        inside = [(np.cross(q - p, r - p) * normals).sum(axis=1) > 0 for p, q, r in ((d, a, b), (b, c, d))]
        choice = (inside[0] & inside[1])[:, None, None]
        chosen: Integers = np.where(choice, [[3, 0, 1], [1, 2, 3]], [[0, 1, 2], [0, 2, 3]])
        return chosen
    return np.array([_triangles(one, normal) for one, normal in zip(corners, normals, strict=True)], np.int64)


def _triangles(corners: Doubles, normal: Doubles) -> list[tuple[int, int, int]]:
    """The triangles of a polygon, by clipping ears: corners between whose neighbours the polygon has no other corner.

    corners: (n, 3). normal: of the polygon. If rounding or a polygon that crosses itself leave no ear, the rest is cut
    from its first corner.
    """
    rest = list(range(len(corners)))
    found = []
    while len(rest) > 3:
        at = next((i for i in range(len(rest)) if _is_ear(corners, normal, rest, i)), 1)
        found.append((rest[at - 1], rest[at], rest[(at + 1) % len(rest)]))
        del rest[at]
    return [*found, (rest[0], rest[1], rest[2])] if len(rest) == 3 else found


def _is_ear(corners: Doubles, normal: Doubles, rest: list[int], at: int) -> bool:
    """Whether the corner `rest[at]` of what is left of a polygon can be clipped."""
    ear = [rest[at - 1], rest[at], rest[(at + 1) % len(rest)]]
    a, b, c = corners[ear]
    if np.dot(np.cross(b - a, c - b), normal) <= 0:
        return False
    others = corners[[i for i in rest if i not in ear]]
    sides = [np.cross(q - p, others - p) @ normal for p, q in pairwise((a, b, c, a))]
    # Corners at the place of one of the ear's own are no obstacle.
    same = (others[:, None] == corners[ear]).all(axis=2).any(axis=1)
    return not bool(((np.array(sides) >= 0).all(axis=0) & ~same).any())
