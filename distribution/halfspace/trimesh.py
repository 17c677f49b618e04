# SPDX-License-Identifier: GPL-3.0-or-later
"""Ray queries of a trimesh.Trimesh: the methods and results of trimesh's own `RayMeshIntersector`, with exact answers.

`mesh.ray = RayMeshIntersector(mesh)` lets trimesh use it. Every hit of a ray is found; no ray is moved past a hit and
cast again. A ray through an edge or a vertex hits all triangles there at one distance, exactly: as in trimesh this is
one hit, with the triangle of the smallest index. trimesh is imported only by `contains_points`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _arrays, _compiled

if TYPE_CHECKING:
    from halfspace_native import Structure

native = _compiled.module()

RADIUS = 2.0
"""A mesh lies within this distance of its centre, in its own frame."""

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


class RayMeshIntersector:
    """Answers rays on one mesh. Its structure is built at the first query, and again when the mesh has changed.

    geometry: a trimesh.Trimesh, or any object with `vertices`, (n, 3) float64, and `faces`, (m, 3) integers.
    scale_to_box: accepted for compatibility, and without effect: answers depend on neither size nor place, since the
    vertices that faces use are rounded to float32 around their centre, in units of their size. Faces with a vertex that
    is NaN or infinite are left out. Rays are float64 until they are near the mesh. structure: a configuration, such as
    "bvh-sah" or "kd"; the answers are the same for all.
    """

    def __init__(self, geometry: Any, scale_to_box: bool = True, *, structure: str = "bvh-sah") -> None:
        self.mesh = geometry
        self.scale_to_box = scale_to_box
        self.structure = structure
        self._built: tuple[Any, Structure, _Frame] | None = None

    def intersects_location(
        self, ray_origins: npt.ArrayLike, ray_directions: npt.ArrayLike, multiple_hits: bool = True
    ) -> tuple[Floats, Integers, Integers]:
        """Where rays hit the mesh: (points, index_ray, index_tri), (h, 3) float64 and twice (h,) int64.

        Arguments and errors as for intersects_id().
        """
        triangles, rays, points = self.intersects_id(ray_origins, ray_directions, multiple_hits, return_locations=True)
        return points, rays, triangles

    def intersects_id(
        self,
        ray_origins: npt.ArrayLike,
        ray_directions: npt.ArrayLike,
        multiple_hits: bool = True,
        max_hits: int | None = None,
        return_locations: bool = False,
    ) -> Any:
        """The triangles that rays hit: (index_tri, index_ray), each (h,) int64, and with return_locations the points,
        (h, 3) float64. Hits are grouped by ray, nearest first.

        ray_origins, ray_directions: (n, 3), directions of any length. multiple_hits: whether all hits of a ray count,
        else the nearest. max_hits: the largest number of hits of a ray, None = all. Raises ValueError for arrays of
        different shapes, halfspace_native.ShapeError and NonFiniteError.
        """
        origins, directions = _rays(ray_origins, ray_directions)
        structure, frame = self._structure()
        most = None if multiple_hits else 1
        offsets, hits = structure.all_hits(*frame.rays(origins, directions), max_hits=most)
        rays = np.repeat(np.arange(len(origins)), np.diff(offsets))
        kept = _distinct(rays, hits.t, max_hits)
        rays, triangles = rays[kept], hits.triangle[kept].astype(np.int64)
        if not return_locations:
            return triangles, rays
        return triangles, rays, self._points(triangles, hits.u[kept], hits.v[kept])

    def intersects_first(self, ray_origins: npt.ArrayLike, ray_directions: npt.ArrayLike) -> Integers:
        """The nearest triangle of each ray: (n,) int64, -1 for a miss. Arguments and errors as for intersects_id()."""
        origins, directions = _rays(ray_origins, ray_directions)
        structure, frame = self._structure()
        return structure.closest(*frame.rays(origins, directions)).triangle.astype(np.int64)

    def intersects_any(self, ray_origins: npt.ArrayLike, ray_directions: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Whether each ray hits the mesh: (n,) bool. Arguments and errors as for intersects_id()."""
        origins, directions = _rays(ray_origins, ray_directions)
        structure, frame = self._structure()
        return structure.occluded(*frame.rays(origins, directions))

    def contains_points(self, points: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Whether the mesh, if it is closed, contains each point: (n,) bool, by trimesh's count of crossings."""
        from trimesh.ray.ray_util import contains_points

        found: npt.NDArray[np.bool_] = contains_points(self, points)
        return found

    def _structure(self) -> tuple[Structure, _Frame]:
        """The structure over the mesh in its frame, and the frame. Raises halfspace_native.ShapeError."""
        # trimesh hashes the content of a mesh; other objects are taken as constant.
        key = hash(self.mesh) if hasattr(self.mesh, "is_watertight") else 0
        if self._built is None or self._built[0] != key:
            vertices = np.asarray(self.mesh.vertices, np.float64).reshape(-1, 3)
            faces = _arrays.indices("faces", self.mesh.faces)
            frame = _Frame(vertices, faces)
            self._built = key, native.build(frame.points(vertices), faces, self.structure), frame
        return self._built[1:]

    def _points(self, triangles: Integers, u: npt.NDArray[Any], v: npt.NDArray[Any]) -> Floats:
        """The points with these weights of the second and third corner: they lie on their triangles."""
        corners = np.asarray(self.mesh.vertices, np.float64)[_arrays.indices("faces", self.mesh.faces)[triangles]]
        u, v = u.astype(np.float64)[:, None], v.astype(np.float64)[:, None]
        points: Floats = corners[:, 0] + u * (corners[:, 1] - corners[:, 0]) + v * (corners[:, 2] - corners[:, 0])
        return points

    def __getstate__(self) -> dict[str, Any]:
        """The state without the structure, which is built again."""
        return {**self.__dict__, "_built": None}

    def __copy__(self) -> RayMeshIntersector:
        """Another one over the same mesh."""
        return RayMeshIntersector(self.mesh, self.scale_to_box, structure=self.structure)

    def __deepcopy__(self, *_: Any) -> RayMeshIntersector:
        """Another one over the same mesh, as trimesh's own copies are."""
        return self.__copy__()


def _rays(origins: npt.ArrayLike, directions: npt.ArrayLike) -> tuple[Floats, Floats]:
    """Rays as arrays of float64. Raises ValueError if their shapes differ, and halfspace_native.NonFiniteError."""
    found = np.asarray(origins, np.float64), np.asarray(directions, np.float64)
    if found[0].shape != found[1].shape:
        raise ValueError(f"origins and directions differ in shape: {found[0].shape} and {found[1].shape}")
    for name, rows in (("ray_origins", found[0]), ("ray_directions", found[1])):
        wrong = np.flatnonzero(~np.isfinite(rows.reshape(-1, 3)).all(axis=1))
        if len(wrong):
            raise native.NonFiniteError(
                f"{name}[{wrong[0]}]: expected finite numbers, got {rows.reshape(-1, 3)[wrong[0]].tolist()}"
            )
    return found[0].reshape(-1, 3), found[1].reshape(-1, 3)


def _distinct(rays: Integers, t: npt.NDArray[Any], most: int | None) -> Integers:
    """The positions of the first `most` distances of each ray that differ from the one before, None = all.

    rays, t: (h,), grouped by ray and sorted by distance within.
    """
    kept = np.flatnonzero(np.r_[True, (np.diff(rays) != 0) | (np.diff(t) != 0)][: len(rays)])
    if most is None or not len(kept):
        return kept
    # Count the hits of each ray from its first.
    starts = np.flatnonzero(np.r_[True, np.diff(rays[kept]) != 0])
    rank = np.arange(len(kept)) - np.repeat(starts, np.diff(np.r_[starts, len(kept)]))
    few: Integers = kept[rank < most]
    return few


class _Frame:
    """The place and size of a mesh: around the centre of the finite vertices that faces use, which lie within distance
    2 in units of a power of two.
    """

    def __init__(self, vertices: Floats, faces: Integers) -> None:
        in_range = faces[((faces >= 0) & (faces < len(vertices))).all(axis=1)]
        used = vertices[in_range.ravel()]
        used = used[np.isfinite(used).all(axis=1)]
        low, high = (used.min(axis=0), used.max(axis=0)) if len(used) else (np.zeros(3), np.zeros(3))
        # Halve first: the sum may overflow.
        self.centre: Floats = low / 2 + high / 2
        self.exponent = int(np.frexp(np.abs(high / 2 - low / 2).max())[1])

    def points(self, points: Floats) -> npt.NDArray[np.float32]:
        """Points in this frame; what is beyond float32 becomes infinite."""
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            local: npt.NDArray[np.float32] = self._local(points).astype(np.float32)
        return local

    def rays(self, origins: Floats, directions: Floats) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        """Rays in this frame, of unit length, in float32. Those that begin far away begin before the mesh instead: a
        rounded origin far away would be another ray.
        """
        # Scale directions first: squares of their numbers overflow or vanish.
        largest = np.abs(directions).max(axis=1, keepdims=True, initial=0)
        scaled = np.divide(directions, largest, out=np.zeros_like(directions), where=largest > 0)
        length = np.linalg.norm(scaled, axis=1, keepdims=True)
        unit = np.divide(scaled, length, out=np.zeros_like(scaled), where=length > 0)
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            starts = self._local(origins)
            # The mesh lies within this distance of its centre, and no hit before the ball around it.
            ahead = -(starts * unit).sum(axis=1, keepdims=True) - RADIUS
            starts = starts + np.maximum(ahead, 0) * unit
            # What is still far away passes the ball or leaves it behind.
            is_near = (np.abs(starts) < 2 * RADIUS).all(axis=1, keepdims=True)
        return np.where(is_near, starts, 0).astype(np.float32), np.where(is_near, unit, 0).astype(np.float32)

    def _local(self, points: Floats) -> Floats:
        """Points in this frame, in float64."""
        local: Floats = np.ldexp(points - self.centre, -self.exponent)
        return local
