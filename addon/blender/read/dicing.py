# SPDX-License-Identifier: GPL-3.0-or-later
"""Adaptive subdivision: edges of subdivision surfaces are halved until they are short in the picture.

Blender's modifier gives points of the surface, of its levels. Between them the surface is that of curved triangles
(Vlachos et al. 2001, "Curved PN Triangles"): the middle of an edge depends on its two ends alone, so that triangles
with different divisions meet without cracks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.base.arrays import F32, F64
from ...core.base.notes import Notes
from .camera import seen_by
from .displacement.applying import vertex_normals
from .meshes import MeshArrays

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...core.scene.scene import Camera

MOST_TRIANGLES = 1 << 24
"""Largest number of triangles of a mesh that are divided further (chosen: 1 GB of arrays)."""

WEIGHTS = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]])
"""The weights of a triangle's corners at its corners and at the middles of its edges."""

PARTS = (
    ((0, 1, 2),),
    ((0, 3, 2), (3, 1, 2)),
    ((0, 1, 4), (0, 4, 2)),
    ((3, 1, 4), (0, 3, 4), (0, 4, 2)),
    ((0, 1, 5), (5, 1, 2)),
    ((0, 3, 5), (3, 1, 2), (3, 2, 5)),
    ((4, 2, 5), (0, 1, 4), (0, 4, 5)),
    ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
)
"""The triangles, rows of `WEIGHTS`, into which one is divided, by the sum of 1, 2 and 4 for its halved edges."""


@dataclass(frozen=True)
class Rate:
    """How finely a mesh is diced. longest: length of an edge, in pixels or in object space. levels: most halvings of an
    edge. curved: whether the surface bends between the points of the modifier.
    """

    longest: float
    in_pixels: bool
    levels: int
    curved: bool


class Dicer:
    """Dices the meshes of one pass over the depsgraph's instances."""

    def __init__(self, depsgraph: Any, notes: Notes) -> None:
        scene = depsgraph.scene_eval
        self._notes, self._render = notes, depsgraph.mode == "RENDER"
        self._cycles = getattr(scene, "cycles", None)  # missing while that extension is disabled
        self._offscreen = float(getattr(self._cycles, "offscreen_dicing_scale", 1.0))
        self._view: Camera | None = None
        self._width = 1.0
        item = None if self._cycles is None else self._cycles.dicing_camera or scene.camera
        if item is None or item.type != "CAMERA":
            return
        self._view = seen_by(item.evaluated_get(depsgraph), depsgraph)
        # The width of a pixel at distance 1, or anywhere for a parallel camera.
        left, right = self._view.window[:2]
        around = 2 * np.pi if self._view.panorama else right - left
        self._width = around / max(scene.render.resolution_x * scene.render.resolution_percentage / 100, 1.0)

    def rate(self, item: Any) -> Rate | None:
        """How finely an evaluated object is diced; None if it is rendered with the levels of its modifier."""
        last = item.modifiers[-1] if self._cycles is not None and len(item.modifiers) else None
        if last is None or last.type != "SUBSURF" or not (last.show_render if self._render else last.show_viewport):
            return None
        scale = self._cycles.dicing_rate if self._render else self._cycles.preview_dicing_rate
        if hasattr(last, "use_adaptive_subdivision"):
            used, in_pixels = last.use_adaptive_subdivision, last.adaptive_space == "PIXEL"
            own = last.adaptive_pixel_size if in_pixels else last.adaptive_object_edge_length
        else:  # before Blender 5
            used = item.cycles.use_adaptive_subdivision and self._cycles.feature_set == "EXPERIMENTAL"
            in_pixels, own = True, item.cycles.dicing_rate
        if not used:
            return None
        if in_pixels and self._view is None:
            self._notes.add("Adaptive subdivision needs a camera, rendered with the modifier's levels", item.name_full)
            return None
        done = last.render_levels if self._render else last.levels
        levels = max(self._cycles.max_subdivisions - done, 0)
        return Rate(scale * own, in_pixels, levels, last.subdivision_type == "CATMULL_CLARK")

    def mesh(self, mesh: MeshArrays, rate: Rate, matrix: F64, name: str) -> MeshArrays:
        """The diced mesh of the object of this name. matrix: (4, 4), to the world. From any thread."""
        measure = partial(self._pixels, matrix=matrix) if rate.in_pixels else _lengths
        found = diced(mesh, measure, rate)
        if len(found.triangles) >= MOST_TRIANGLES:
            self._notes.add(f"Not divided any finer than {len(found.triangles):,} triangles", name)
        return found

    def _pixels(self, a: F64, b: F64, matrix: F64) -> F64:
        """The lengths of edges in pixels. Beyond the borders of the picture they shrink, up to the scene's scale."""
        assert self._view is not None, "pixels need a camera"
        view = self._view
        length = np.linalg.norm((b - a) @ matrix[:3, :3].T, axis=1)
        middles = 0.5 * (a + b) @ matrix[:3, :3].T + matrix[:3, 3]
        local = (middles - view.to_world[:3, 3]) @ view.to_world[:3, :3]
        distance = np.linalg.norm(local, axis=1)
        parallel = view.kind == "orthographic"
        pixels: F64 = length / (self._width * (1.0 if parallel else np.maximum(distance, view.clip_start)))
        if view.panorama:
            return pixels
        # The distance beyond the border, in halves of the picture; twice as far and behind the camera all is the same.
        left, right, bottom, top = view.window
        depth = np.maximum(-local[:, 2], 1e-6 * np.maximum(distance, 1e-30))
        place = local[:, :2] / (1.0 if parallel else depth[:, None])
        centre, half = np.array([left + right, bottom + top]) / 2, np.abs([right - left, top - bottom]) / 2
        beyond = np.clip((np.abs(place - centre) / half).max(axis=1) - 1, 0, 1)
        return pixels / (1 + (self._offscreen - 1) * beyond)


def _lengths(a: F64, b: F64) -> F64:
    length: F64 = np.linalg.norm(b - a, axis=1)
    return length


def diced(mesh: MeshArrays, measure: Callable[[F64, F64], F64], rate: Rate) -> MeshArrays:
    """The mesh with all edges halved that are longer than the rate's. measure: the lengths of edges between two arrays
    of points, (n, 3) each.
    """
    positions, triangles = mesh.positions.astype(np.float64), mesh.triangles.astype(np.int64)
    smooth = mesh.normals is not None and np.array_equal(mesh.normal_rows, mesh.triangles)
    normals = (
        mesh.normals.astype(np.float64)
        if smooth and mesh.normals is not None
        else vertex_normals(mesh.positions, mesh.triangles, weighted=True)
    )
    slots, corners = mesh.slots, _by_corner(mesh, smooth=smooth)
    for _ in range(rate.levels):
        # Find the long edges, each once.
        sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        keys, first, which = np.unique(sides @ [len(positions), 1], return_index=True, return_inverse=True)
        ends = sides[first]
        with np.errstate(invalid="ignore", over="ignore"):
            long = measure(*positions[ends].transpose(1, 0, 2)) > rate.longest
        if not long.any() or len(triangles) >= MOST_TRIANGLES:
            break
        # Halve them, and number their middles after the vertices.
        middle = np.full(len(keys), -1)
        middle[long] = len(positions) + np.arange(np.count_nonzero(long))
        points, directions = _middles(positions, normals, ends[long], curved=rate.curved)
        positions, normals = np.concatenate([positions, points]), np.concatenate([normals, directions])
        six = np.concatenate([triangles, middle[which].reshape(-1, 3)], axis=1)
        kind = (six[:, 3:] >= 0) @ [1, 2, 4]
        # Divide the triangles of each kind alike.
        groups = [(np.flatnonzero(kind == number), np.array(parts)) for number, parts in enumerate(PARTS)]
        triangles = np.concatenate([six[rows][:, parts].reshape(-1, 3) for rows, parts in groups])
        corners = {
            key: np.concatenate([_at(one[rows], parts) for rows, parts in groups]) for key, one in corners.items()
        }
        if slots is not None:
            slots = np.concatenate([np.repeat(slots[rows], len(parts)) for rows, parts in groups])
    return _made(mesh, positions, triangles, normals if smooth else None, slots, corners)


def _by_corner(mesh: MeshArrays, *, smooth: bool) -> dict[Any, F32]:
    """The values of the corners of triangles, (m, 3, n) each."""
    corners: dict[Any, F32] = dict(mesh.layers)
    if mesh.uvs is not None:
        corners["uvs"] = mesh.uvs
    if mesh.normals is not None and not smooth:
        corners["normals"] = mesh.normals[mesh.normal_rows]
    return corners


def _middles(positions: F64, normals: F64, ends: NDArray[np.int64], *, curved: bool) -> tuple[F64, F64]:
    """The points and unit normals in the middle of edges."""
    (a, b), (n, m) = positions[ends].transpose(1, 0, 2), normals[ends].transpose(1, 0, 2)
    points, directions = 0.5 * (a + b), n + m
    if curved:
        along = b - a
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            points += (np.sum(along * m, axis=1, keepdims=True) * m - np.sum(along * n, axis=1, keepdims=True) * n) / 8
            square = np.sum(along * along, axis=1, keepdims=True)
            directions -= 2 * np.nan_to_num(np.sum(along * directions, axis=1, keepdims=True) / square) * along
    return points, _unit(directions)


def _at(values: F32, parts: NDArray[np.int64]) -> F32:
    """The values of the corners of the parts of triangles, from those of their own, (s, 3, n)."""
    inner = np.einsum("tcj,sjk->stck", WEIGHTS[parts].astype(np.float32), values)
    return inner.reshape(-1, 3, values.shape[2])


def _unit(vectors: F64) -> F64:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    result: F64 = np.nan_to_num(vectors / np.where(length > 0, length, 1))
    return result


def _made(
    mesh: MeshArrays,
    positions: F64,
    triangles: NDArray[np.int64],
    smooth: F64 | None,
    slots: Any,
    corners: dict[Any, F32],
) -> MeshArrays:
    """The mesh of diced arrays. smooth: the normals of its vertices, if it is smooth everywhere."""
    numbers = triangles.astype(np.int32)
    normals, rows = None, None
    if smooth is not None:
        normals, rows = smooth.astype(np.float32), numbers
    elif "normals" in corners:
        normals = _unit(corners.pop("normals").reshape(-1, 3).astype(np.float64)).astype(np.float32)
        rows = np.arange(len(normals)).reshape(-1, 3)
    uvs = corners.pop("uvs", None)
    return replace(
        mesh,
        positions=positions.astype(np.float32),
        triangles=numbers,
        slots=slots,
        normals=normals,
        normal_rows=rows,
        uvs=uvs,
        layers=corners,
    )
