# SPDX-License-Identifier: GPL-3.0-or-later
"""Queries of triangles as `open3d.t.geometry.RaycastingScene` has them, with exact answers.

Arrays are NumPy arrays or tensors of Open3D; the results are tensors if an argument or a geometry is one. Open3D is not
imported. The class differs from Open3D's in these answers:

- No ray passes between triangles that share an edge or a vertex. There it hits all of them at one distance, exactly:
  this counts as one intersection, with the triangle that was added first.
- Signed distance and occupancy send rays that meet no edge and no vertex, so one ray decides; `nsamples` is without
  effect.
- A ray or point that is NaN or infinite raises an error.
- Only the device CPU is supported.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _arrays, _compiled

if TYPE_CHECKING:
    from halfspace_native import Structure

native = _compiled.module()

Floats = npt.NDArray[np.float32]
Integers = npt.NDArray[np.int64]

INVALID = 0xFFFF_FFFF
"""The number of a geometry or triangle that stands for none."""

CLEAR = 1e-6
"""A hit whose three weights exceed this lies on no edge: weights are rounded by less."""

DIRECTIONS = np.random.default_rng(20).normal(size=(16, 3)).astype(np.float32)
"""Directions of rays that tell inside from outside, tried in turn where a ray meets an edge."""


BY_MATRICES = ("intrinsic_matrix", "extrinsic_matrix", "width_px", "height_px")
BY_ANGLE = ("fov_deg", "center", "eye", "up", "width_px", "height_px")
"""Arguments of the two forms of create_rays_pinhole(), in Open3D's order."""

SHAPES = {"intrinsic_matrix": (3, 3), "extrinsic_matrix": (4, 4), "center": (3,), "eye": (3,), "up": (3,)}


class RaycastingScene:
    """Triangles of one or more geometries. The structure is built at the first query after a geometry is added.

    nthreads: threads of the build, 0 = all, or another scene, as `other`, to copy it. device: None or a device of
    Open3D, which must be the CPU. structure: a configuration of the family `bvh-sah`, or for rays alone any other; the
    answers are the same. Raises ValueError.
    """

    INVALID_ID = INVALID

    def __init__(
        self, nthreads: Any = 0, device: Any = None, *, other: RaycastingScene | None = None, structure: str = "bvh-sah"
    ) -> None:
        source = nthreads if isinstance(nthreads, RaycastingScene) else other
        if source is not None:
            # Arrays and structures never change, only the lists of them.
            self.__dict__.update(
                {name: list(one) if isinstance(one, list) else one for name, one in vars(source).items()}
            )
            return
        if device is not None and not str(device).upper().startswith("CPU"):
            raise ValueError(f"device: expected the CPU, got {device}")
        self._nthreads, self._spec = nthreads, structure
        self._vertices: list[Floats] = []
        self._triangles: list[Integers] = []
        self._built: _Built | None = None
        self._tensor: Any = None  # the class of tensors, if a geometry is one

    def __copy__(self) -> RaycastingScene:
        """Another scene with the same geometries."""
        return RaycastingScene(other=self)

    def __deepcopy__(self, _memo: Any) -> RaycastingScene:
        """Another scene with the same geometries."""
        return RaycastingScene(other=self)

    def add_triangles(self, vertex_positions: Any = None, triangle_indices: Any = None, *, mesh: Any = None) -> int:
        """Add a geometry and return its number, counted from 0.

        vertex_positions: (n, 3), rounded to float32, or a mesh of Open3D (`open3d.t.geometry.TriangleMesh`), as `mesh`.
        triangle_indices: (m, 3) integers, not with a mesh. Raises ValueError for other shapes.
        """
        if triangle_indices is None:
            mesh = vertex_positions if mesh is None else mesh
            vertex_positions, triangle_indices = mesh.vertex.positions, mesh.triangle.indices
        if _is_tensor(vertex_positions):
            self._tensor = type(vertex_positions)
        vertices = _array(vertex_positions)
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            raise ValueError(f"vertex_positions: expected shape (n, 3), got {vertices.shape}")
        triangles = _arrays.indices("triangle_indices", _numpy(triangle_indices))
        self._vertices.append(vertices)
        self._triangles.append(triangles)
        self._built = None
        return len(self._triangles) - 1

    def cast_rays(self, rays: Any, nthreads: int = 0) -> dict[str, Any]:
        """The nearest hit of each ray, a dictionary.

        rays: (..., 6), origin and direction of any length, which is the unit of t_hit. nthreads: 0 = all. t_hit: (...),
        inf for a miss; geometry_ids, primitive_ids: (...) uint32, INVALID_ID for a miss; primitive_uvs: (..., 2),
        weights of the second and third vertex; primitive_normals: (..., 3), unit vectors. Zeros for a miss.
        """
        origins, directions, shape = _rays(rays)
        built = self._prepared()
        hits = built.structure.closest(origins, directions, threads=nthreads)
        geometries, primitives = built.numbers(hits.triangle)
        miss = hits.triangle < 0
        uvs = np.where(miss[:, None], np.float32(0), np.stack([hits.u, hits.v], axis=1))
        found = {
            "t_hit": np.where(miss, np.float32(np.inf), hits.t),
            "geometry_ids": geometries,
            "primitive_ids": primitives,
            "primitive_uvs": uvs,
            "primitive_normals": built.normals(hits.triangle),
        }
        return {name: self._like(rays, column.reshape(*shape, *column.shape[1:])) for name, column in found.items()}

    def test_occlusions(self, rays: Any, tnear: float = 0.0, tfar: float = float("inf"), nthreads: int = 0) -> Any:
        """Whether each ray hits anything from tnear to tfar: (...) bool. Arguments as for cast_rays()."""
        origins, directions, shape = _rays(rays)
        structure = self._prepared().structure
        found = structure.occluded(origins, directions, t_min=tnear, t_max=tfar, threads=nthreads)
        return self._like(rays, found.reshape(shape))

    def count_intersections(self, rays: Any, nthreads: int = 0) -> Any:
        """Number of distances at which each ray hits something: (...) int32. Arguments as for cast_rays()."""
        *_, shape = _rays(rays)
        splits = self._intersections(rays, nthreads)[0]
        return self._like(rays, np.diff(splits).astype(np.int32).reshape(shape))

    def list_intersections(self, rays: Any, nthreads: int = 0) -> dict[str, Any]:
        """All hits, those of one ray after another, nearest first, one for each distance. Arguments as for cast_rays().

        A dictionary: ray_splits, (n + 1,) uint32, where the hits of each ray begin; ray_ids, t_hit, geometry_ids,
        primitive_ids, primitive_uvs: (h, ...), as in cast_rays().
        """
        splits, ray_ids, hits = self._intersections(rays, nthreads)
        geometries, primitives = self._prepared().numbers(hits["triangle"])
        found = {
            "ray_splits": splits.astype(np.uint32),
            "ray_ids": ray_ids.astype(np.uint32),
            "t_hit": hits["t"],
            "geometry_ids": geometries,
            "primitive_ids": primitives,
            "primitive_uvs": np.stack([hits["u"], hits["v"]], axis=1),
        }
        return {name: self._like(rays, column) for name, column in found.items()}

    def compute_closest_points(self, query_points: Any, nthreads: int = 0) -> dict[str, Any]:
        """The nearest triangle of each point, a dictionary; of equally near ones, the one that was added first.

        query_points: (..., 3). points: (..., 3), the closest point; geometry_ids, primitive_ids, primitive_uvs,
        primitive_normals: as in cast_rays().
        """
        points, shape = _points(query_points)
        built = self._prepared()
        found = built.structure.closest_points(points, threads=nthreads)
        geometries, primitives = built.numbers(found.triangle)
        columns = {
            "points": found.point,
            "geometry_ids": geometries,
            "primitive_ids": primitives,
            "primitive_uvs": built.weights(found.triangle, found.point),
            "primitive_normals": built.normals(found.triangle),
        }
        return {name: self._like(query_points, one.reshape(*shape, *one.shape[1:])) for name, one in columns.items()}

    def compute_distance(self, query_points: Any, nthreads: int = 0) -> Any:
        """The distance of each point to the nearest triangle: (...) float32. Arguments as before."""
        points, shape = _points(query_points)
        found = self._prepared().structure.closest_points(points, threads=nthreads)
        return self._like(query_points, found.distance.reshape(shape))

    def compute_signed_distance(self, query_points: Any, nthreads: int = 0, nsamples: int = 1) -> Any:
        """The distance of each point, negative inside; the surfaces must be closed. nsamples: without effect."""
        distance = np.asarray(_numpy(self.compute_distance(query_points, nthreads)))
        inside = np.asarray(_numpy(self.compute_occupancy(query_points, nthreads, nsamples))) > 0
        return self._like(query_points, np.where(inside, -distance, distance))

    def compute_occupancy(self, query_points: Any, nthreads: int = 0, nsamples: int = 1) -> Any:  # noqa: ARG002
        """1 for points inside, else 0: (...) float32; the surfaces must be closed. nsamples: without effect."""
        points, shape = _points(query_points)
        structure, inside = self._prepared().structure, np.zeros(len(points), np.float32)
        open_points = np.arange(len(points))
        # Send a ray from each point, and another one where it meets an edge or a vertex.
        for direction in DIRECTIONS:
            if not len(open_points):
                break
            directions = np.broadcast_to(direction, (len(open_points), 3))
            offsets, hits = structure.all_hits(points[open_points], np.ascontiguousarray(directions), threads=nthreads)
            inside[open_points] = np.diff(offsets) % 2
            on_edge = np.minimum(np.minimum(hits.u, hits.v), 1 - hits.u.astype(np.float64) - hits.v) <= CLEAR
            rays = np.repeat(np.arange(len(open_points)), np.diff(offsets))
            open_points = open_points[np.unique(rays[on_edge])]
        return self._like(query_points, inside.reshape(shape))

    @staticmethod
    def create_rays_pinhole(*arguments: Any, **named: Any) -> Any:
        """The rays of a pinhole camera through the centres of its pixels: (height_px, width_px, 6) float32.

        Either intrinsic_matrix, (3, 3), extrinsic_matrix, (4, 4) from the world to the camera, width_px and height_px;
        or fov_deg, the horizontal angle, center, the point in the middle, eye, up, width_px and height_px. The depth of
        a direction is 1, so that t_hit is the depth of a hit. Raises TypeError and ValueError for other arguments.
        """
        names = BY_MATRICES if len(arguments) + len(named) == len(BY_MATRICES) else BY_ANGLE
        given = dict(zip(names, arguments, strict=False)) | named
        if len(arguments) + len(named) != len(names) or given.keys() != set(names):
            raise TypeError(f"create_rays_pinhole: expected {', '.join(BY_MATRICES)}, or {', '.join(BY_ANGLE)}")
        tensor = next((type(one) for one in given.values() if _is_tensor(one)), None)
        width, height = (int(given.pop(name)) for name in ("width_px", "height_px"))
        camera = {name: _shaped(name, value, SHAPES.get(name, ())) for name, value in given.items()}
        if names is BY_ANGLE:
            turn = _turned(camera["eye"], camera["center"], camera["up"])
            eye = camera["eye"]
            focus = 0.5 * width / np.tan(np.radians(camera["fov_deg"]) / 2)
            inverse = np.array([[1 / focus, 0, -width / 2 / focus], [0, 1 / focus, -height / 2 / focus], [0, 0, 1]])
        else:
            turn, shift = camera["extrinsic_matrix"][:3, :3], camera["extrinsic_matrix"][:3, 3]
            eye = -turn.T @ shift
            inverse = np.linalg.inv(camera["intrinsic_matrix"])
        x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        directions = np.stack([x, y, np.ones_like(x)], axis=-1) @ (turn.T @ inverse).T
        rays = np.concatenate([np.broadcast_to(eye, directions.shape), directions], axis=-1).astype(np.float32)
        return rays if tensor is None else tensor.from_numpy(rays)

    def _like(self, example: Any, found: npt.NDArray[Any]) -> Any:
        """The array, as a tensor if the example or a geometry is one."""
        kind = type(example) if _is_tensor(example) else self._tensor
        return found if kind is None else kind.from_numpy(np.ascontiguousarray(found))

    def _prepared(self) -> _Built:
        """The structure over all geometries. Raises halfspace_native.ShapeError for indices out of range."""
        if self._built is None:
            self._built = _Built(self._vertices, self._triangles, self._spec, self._nthreads)
        return self._built

    def _intersections(self, rays: Any, nthreads: int) -> tuple[Integers, Integers, dict[str, Any]]:
        """Where the hits of each ray begin, (n + 1,), the ray of each hit, and the columns of the hits."""
        origins, directions, _ = _rays(rays)
        offsets, hits = self._prepared().structure.all_hits(origins, directions, threads=nthreads)
        ray_ids = np.repeat(np.arange(len(origins)), np.diff(offsets))
        # Keep the first hit of each distance.
        kept = np.flatnonzero(np.r_[True, (np.diff(ray_ids) != 0) | (np.diff(hits.t) != 0)][: len(ray_ids)])
        splits = np.searchsorted(ray_ids[kept], np.arange(len(origins) + 1))
        columns = {"t": hits.t, "triangle": hits.triangle, "u": hits.u, "v": hits.v}
        return splits, ray_ids[kept], {name: column[kept] for name, column in columns.items()}


class _Built:
    """A structure over the triangles of all geometries, and which is whose."""

    def __init__(self, vertices: list[Floats], triangles: list[Integers], spec: str, threads: int) -> None:
        counts = [len(own) for own in triangles]
        starts = np.cumsum([0, *(len(own) for own in vertices)])
        # Check the indices of each geometry alone: out of range, they would name vertices of another.
        for number, (own, indices) in enumerate(zip(vertices, triangles, strict=True)):
            if len(indices) and not 0 <= indices.min() <= indices.max() < len(own):
                message = f"triangle_indices: geometry {number} has an index out of range for {len(own)} vertices"
                raise native.ShapeError(message)
        moved = [indices + start for indices, start in zip(triangles, starts, strict=False)]
        self.vertices = np.concatenate([np.zeros((0, 3), np.float32), *vertices])
        self.triangles = np.concatenate([np.zeros((0, 3), np.int64), *moved])
        self.firsts = np.cumsum([0, *counts])
        self.structure: Structure = native.build(self.vertices, self.triangles, spec, threads=threads)

    def numbers(self, triangles: npt.NDArray[np.int32]) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.uint32]]:
        """The geometry of each triangle and its number there; INVALID for -1."""
        geometry = np.searchsorted(self.firsts, triangles, side="right") - 1
        miss = triangles < 0
        primitive = triangles - self.firsts[np.maximum(geometry, 0)]
        ids = np.where(miss, INVALID, geometry), np.where(miss, INVALID, primitive)
        return ids[0].astype(np.uint32), ids[1].astype(np.uint32)

    def normals(self, triangles: npt.NDArray[np.int32]) -> Floats:
        """Unit normals, (n, 3), by the order of the vertices; zeros for -1 and for triangles without area."""
        a, b, c = self._corners(triangles)
        normals = np.cross(b - a, c - a)
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        unit = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
        unit[triangles < 0] = 0
        return unit.astype(np.float32)

    def weights(self, triangles: npt.NDArray[np.int32], points: Floats) -> Floats:
        """The weights of the second and third vertex that give points on these triangles, (n, 2); zeros for -1."""
        a, b, c = self._corners(triangles)
        e, f, p = b - a, c - a, points.astype(np.float64) - a
        ee, ef, ff, ep, fp = ((x * y).sum(axis=1) for x, y in ((e, e), (e, f), (f, f), (e, p), (f, p)))
        determinant = ee * ff - ef * ef
        known = (triangles >= 0) & (determinant > 0)
        found = np.stack([ff * ep - ef * fp, ee * fp - ef * ep], axis=1)
        divisor = np.where(known, determinant, 1.0)[:, None]
        return np.where(known[:, None], np.clip(found / divisor, 0, 1), 0).astype(np.float32)

    def _corners(self, triangles: npt.NDArray[np.int32]) -> npt.NDArray[np.float64]:
        """(3, n, 3): the vertices of each triangle, those of the first for -1; zeros without triangles."""
        if not len(self.triangles):
            return np.zeros((3, len(triangles), 3))
        corners: npt.NDArray[np.float64] = self.vertices.astype(np.float64)[self.triangles[np.maximum(triangles, 0)]]
        return corners.transpose(1, 0, 2)


def _numpy(values: Any) -> Any:
    """The NumPy array of a tensor; others as they are."""
    return values.cpu().numpy() if _is_tensor(values) else values


def _array(values: Any) -> Floats:
    return np.ascontiguousarray(_numpy(values), np.float32)


def _is_tensor(values: Any) -> bool:
    return hasattr(values, "cpu")


def _rays(rays: Any) -> tuple[Floats, Floats, tuple[int, ...]]:
    """Origins and directions, each (n, 3), and the shape of the rays. Raises ValueError."""
    both = _array(rays)
    if not both.ndim or both.shape[-1] != 6:
        raise ValueError(f"rays: expected shape (..., 6), got {both.shape}")
    flat = both.reshape(-1, 6)
    return np.ascontiguousarray(flat[:, :3]), np.ascontiguousarray(flat[:, 3:]), both.shape[:-1]


def _shaped(name: str, value: Any, shape: tuple[int, ...]) -> npt.NDArray[np.float64]:
    """A value of this shape in float64. Raises ValueError."""
    found = np.asarray(_numpy(value), np.float64)
    if found.shape != shape:
        raise ValueError(f"{name}: expected shape {shape}, got {found.shape}")
    return found


def _turned(eye: Any, center: Any, up: Any) -> npt.NDArray[np.float64]:
    """The rows of a rotation from the world to a camera whose z axis points at `center` and its y axis along `up`."""
    z = center - eye
    x = np.cross(up, z)
    if not x.any():
        raise ValueError("create_rays_pinhole: expected center apart from eye, and up not along the view")
    y = np.cross(z, x)
    return np.array([axis / np.linalg.norm(axis) for axis in (x, y, z)])


def _points(points: Any) -> tuple[Floats, tuple[int, ...]]:
    """(n, 3), and the shape of the points. Raises ValueError."""
    found = _array(points)
    if not found.ndim or found.shape[-1] != 3:
        raise ValueError(f"query_points: expected shape (..., 3), got {found.shape}")
    return found.reshape(-1, 3), found.shape[:-1]
