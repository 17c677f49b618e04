# SPDX-License-Identifier: GPL-3.0-or-later
"""The reports: where each was made, what went wrong there, and the scene rebuilt from its text."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.base.arrays import F32, I32
from . import meshes

Truth = Literal["hit", "miss", "exact"]


@dataclass(frozen=True)
class Scene:
    """A mesh, rays, and what the report expects of all rays: a hit, a miss, or what exact arithmetic finds."""

    vertices: F32
    triangles: I32
    origins: F32
    directions: F32
    truth: Truth


def scene(mesh: meshes.Mesh, origins: ArrayLike, directions: ArrayLike, truth: Truth) -> Scene:
    """A scene in float32, rounded once. One origin or direction serves for all rays."""
    starts, ways = np.broadcast_arrays(
        np.atleast_2d(np.asarray(origins, np.float64)), np.atleast_2d(np.asarray(directions, np.float64))
    )
    rounded = (np.ascontiguousarray(array, np.float32) for array in (mesh[0], starts, ways))
    vertices, origins, directions = rounded
    return Scene(vertices, np.ascontiguousarray(mesh[1], np.int32), origins, directions, truth)


def grid(first: ArrayLike, second: ArrayLike) -> NDArray[np.float64]:
    """All pairs (n, 2) of two lists of numbers."""
    both = np.meshgrid(np.asarray(first, np.float64), np.asarray(second, np.float64), indexing="ij")
    return np.stack(both, axis=-1).reshape(-1, 2)


def start_on_triangle() -> Scene:
    """Rays that start at vertices, midpoints of edges and inside of one triangle, along both sides of its normal."""
    points: list[list[float]] = [
        [0, 0, 0],
        [1, 0, 0],
        [0, 1, 0],
        [0.5, 0, 0],
        [0, 0.5, 0],
        [0.5, 0.5, 0],
        [0.25, 0.25, 0],
    ]
    mesh = meshes.mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    return scene(mesh, points * 2, np.repeat([[0, 0, 1], [0, 0, -1]], 7, axis=0), "hit")


def nested_cylinders() -> Scene:
    """Eleven cylinders around each other, rays between the fifth and sixth at vertices of the sixth."""
    sides = 16
    tubes = [meshes.tube(float(radius), sides) for radius in range(1, 12)]
    targets = tubes[5][0][sides : 2 * sides]
    origins = np.concatenate([targets * [5.2 / 6, 5.2 / 6, 1] + [0, 0, z] for z in (0, 0.25)])
    return scene(meshes.joined(*tubes), origins, np.concatenate([targets, targets]) - origins, "hit")


def edges_of_box() -> Scene:
    """Rays through points of all edges and diagonals of a box, from its centre."""
    box = meshes.box([-1, -1, -1], [1, 1, 1])
    corners = box[0][box[1]]
    points = np.concatenate([corners[:, i] * (1 - s) + corners[:, i - 1] * s for i in range(3) for s in (0.25, 0.5)])
    return scene(box, [0, 0, 0], points, "hit")


def flat_quads() -> Scene:
    """A floor and a ceiling; rays from the floor straight up, edges and diagonals included."""
    square = [[-2, 0, -2], [2, 0, -2], [2, 0, 2], [-2, 0, 2]]
    floor, ceiling = (meshes.mesh(np.add(square, [0, y, 0]), [[0, 1, 2], [0, 2, 3]]) for y in (0, 3))
    ends = np.linspace(-2, 2, 17)
    x, z = grid(ends, ends).T
    return scene(meshes.joined(floor, ceiling), np.stack([x, np.full_like(x, 0.01), z], axis=1), [0, 1, 0], "hit")


def diagonal_of_square() -> Scene:
    """One ray through the diagonal that two triangles share."""
    square = meshes.mesh([[-1, -1, 0], [-1, 1, 0], [1, 1, 0], [1, -1, 0]], [[0, 1, 2], [2, 3, 0]])
    return scene(square, [0, 0, 1], [0, 0, -1], "hit")


def small_box_in_large() -> Scene:
    """Rays from the centre of a subdivided box to the vertices of another around it, through vertices and edges."""
    small = meshes.subdivided(meshes.box([-20] * 3, [20] * 3), 2)
    large = meshes.subdivided(meshes.box([-30] * 3, [30] * 3), 2)
    return scene(small, [0, 0, 0], large[0], "hit")


def corners_of_box() -> Scene:
    """Rays from the centre of a box to its vertices."""
    box = meshes.box([-0.5] * 3, [0.5] * 3)
    return scene(box, [0, 0, 0], box[0], "hit")


def columns_through_box() -> Scene:
    """Rays along z in a grid a little wider than a box."""
    ends = np.linspace(-0.52, 0.52, 27)
    x, y = grid(ends, ends).T
    return scene(meshes.box([-0.5] * 3, [0.5] * 3), np.stack([x, y, np.full_like(x, -100)], axis=1), [0, 0, 1], "exact")


def camera_at_box() -> Scene:
    """A grid of camera rays at a box of edge 2, with the columns through its edges."""
    ends = np.arange(-128, 129, 8)
    x, y = grid(ends, ends).T
    return scene(meshes.box([-1] * 3, [1] * 3), [0, 0, -15], np.stack([x, y, np.full_like(x, 1000)], axis=1), "exact")


def start_on_large_box() -> Scene:
    """A ray that starts on a face of a box of edge 10,000 and leaves through the other; the start counts."""
    return scene(meshes.box([-5000] * 3, [5000] * 3), [[0, 0, 5000], [0, 0, 0]], [0, 0, -1], "hit")


def cube_without_an_octant() -> Scene:
    """Rays both ways from points on edges of a cube that lacks an octant, in it and outside.

    The mesh of the test has its coordinates, in whole numbers: cube of edge 40, the octant of positive coordinates cut
    out. The direction is the one by which trimesh tells inside from outside.
    """
    steps = np.array([-20.0, 0.0, 20.0])
    corners = np.array([[x, y, z] for x in steps for y in steps for z in steps])
    # Make each face of four squares of edge 20; those of the octant lie at its inner side.
    quads = []
    for axis in range(3):
        across, up = (axis + 1) % 3, (axis + 2) % 3
        for side, i, j in np.ndindex(2, 2, 2):
            is_cut = side == i == j == 1
            place = np.zeros((4, 3), int)
            place[:, axis] = 1 if is_cut else 2 * side
            place[:, across], place[:, up] = i + np.array([0, 1, 1, 0]), j + np.array([0, 0, 1, 1])
            quads.append(place @ [9, 3, 1])
    mesh = meshes.mesh(corners, [[q[0], q[k], q[k + 1]] for q in quads for k in (1, 2)])
    points = np.array([[4.5, 0, -23], [4.5, 0, -2], [0, -1e-4, 0], [0, 0, -1]])
    way = np.array([0.4395064455, 0.617598629942, 0.652231566745])
    return scene(mesh, np.repeat(points, 2, axis=0), np.tile([way, -way], (4, 1)), "exact")


def shared_edge_at_angles() -> Scene:
    """Rays from all sides to the midpoint of an edge that two triangles share, all turned by 90° about (1, 1, 1)."""
    turn = meshes.rotation([1, 1, 1], 90)
    square = meshes.mesh(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]) @ turn.T, [[0, 1, 2], [1, 3, 2]])
    u, v = grid(np.linspace(0.05, 0.95, 32), np.linspace(0.05, 0.95, 32)).T
    ways = meshes.cosine_hemisphere(u, v)
    return scene(square, (np.array([0.5, 0.5, 0]) + ways) @ turn.T, -ways @ turn.T, "hit")


def cube_from_one_side() -> Scene:
    """Rays through a box from one side to the other, at edges, diagonals and between."""
    corners = [[14.4 if i >> axis & 1 else 1.6 for axis in range(3)] for i in range(8)]
    faces = [[2, 1, 0], [1, 2, 3], [4, 2, 0], [2, 4, 6], [1, 4, 0], [4, 1, 5]]
    faces += [[6, 5, 7], [5, 6, 4], [3, 6, 7], [6, 3, 2], [5, 3, 7], [3, 5, 1]]
    places = [4.5, 8, 11.5]
    y, z = grid(places, places).T
    return scene(meshes.mesh(corners, faces), np.stack([np.ones_like(y), y, z], axis=1), [1, 0, 0], "hit")


def start_on_second() -> Scene:
    """Two parallel triangles; a ray that starts on the second counts its start."""
    corners = [[-1, 0, 0], [1, 0, 0], [0, 2, 0], [-1, 0, 1], [1, 0, 1], [0, 2, 1]]
    return scene(meshes.mesh(corners, [[0, 1, 2], [3, 4, 5]]), [0, 1, 1], [0, 0, -1], "hit")


def libigl_box() -> Scene:
    """A ray through a unit box that meets two faces, and whose second hit was reported at a wrong distance."""
    corners = [[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)]
    faces = [[0, 6, 4], [0, 2, 6], [0, 3, 2], [0, 1, 3], [2, 7, 6], [2, 3, 7]]
    faces += [[4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [1, 5, 7], [1, 7, 3]]
    # The second ray starts behind the first hit.
    return scene(meshes.mesh(corners, faces), [[0.5, 0.1, 10], [0.5, 0.1, 0.75]], [0, 0, -1], "hit")


def rays_around_point() -> Scene:
    """Rays from a point next to a unit box to all directions of its plane y = 0.5 and of the sphere."""
    angles = 2 * np.pi * np.arange(360) / 360
    ring = np.stack([np.cos(angles), np.zeros(360), np.sin(angles)], axis=1)
    tilted = ring @ meshes.rotation([1, 0, 0], 30).T
    return scene(meshes.box([0] * 3, [1] * 3), [2, 0.5, 0.5], np.concatenate([ring, tilted]), "exact")


def slanted_bottom_edge() -> Scene:
    """Rays in the plane z = 8, in which the lowest edge of a triangle lies."""
    corners = [
        [-1.3836679458618164, -4.480311870574951, 10],
        [3.9273109436035156, 5.897944450378418, 8],
        [-1.3836679458618164, -4.480311870574951, 8],
    ]
    x, y = -0.028221702575683627, -2.5058889150619503
    origins = [[x, y, 8], [x, y - 0.001, 8]]
    way = [-0.16852837373762, 0.9856968028990217, 0]
    return scene(meshes.mesh(corners, [[0, 1, 2]]), origins, way, "exact")


def sphere_above_block() -> Scene:
    """Rays straight up from the vertices of a block into a coarse sphere, many through its edges and poles."""
    ends = -100 + 200 * np.arange(16) / 15
    tenths = -100 + 200 * np.arange(11) / 10
    x, z = np.concatenate([grid(ends, ends), grid(tenths, tenths)]).T
    origins = np.stack([x, np.full_like(x, -200), z], axis=1)
    return scene(meshes.three_sphere(70, 8, 6), origins, [0, 1, 0], "exact")


def pbrt_watertight() -> Scene:
    """Rays from inside a closed spiky sphere: in random directions, and at its vertices."""
    mesh = meshes.pbrt_sphere()
    origins, directions = [], []
    for i in range(100):
        random = meshes.Pcg32(i)
        start = 0.5 * random.on_sphere()
        way = random.on_sphere()
        target = mesh[0][random.below(len(mesh[0]))]
        origins += [start, start]
        # pbrt subtracts in float32, so the ray passes near the vertex and not always through it.
        directions += [way, np.float32(target) - np.float32(start)]
    return scene(mesh, np.array(origins), np.array(directions), "hit")


def pbrt_collinear() -> Scene:
    """A triangle whose corners lie on one line."""
    x, z = -1113.45459, -56.2431908
    corners = [[x, -79.049614, z], [x, -87.0922699, z], [x, -79.2090149, z]]
    start, way = [-1081.47925, 99.9999542, 87.7701111], [-32.1072998, -183.355865, -144.607635]
    return scene(meshes.mesh(corners, [[0, 1, 2]]), start, way, "miss")


@dataclass(frozen=True)
class Report:
    """A public report of a wrong answer.

    rebuild: makes the scene. missing: instead, why the scene cannot be rebuilt.
    """

    tracer: str
    url: str
    fault: str
    rebuild: Callable[[], Scene] | None = None
    missing: str = ""

    @property
    def name(self) -> str:
        """The tracer and the number of the report or the name of the test."""
        return f"{self.tracer} {self.url.rsplit('/', 1)[-1].rsplit('#', 1)[-1]}"


EMBREE = "https://github.com/RenderKit/embree/issues"
TRIMESH = "https://github.com/mikedh/trimesh/issues"
TRIMESH_TEST = "https://github.com/mikedh/trimesh/blob/main/tests/test_ray.py"
OPEN3D = "https://github.com/isl-org/Open3D/issues"
THREE_BVH = "https://github.com/gkjohnson/three-mesh-bvh/issues"
PBRT_TEST = "https://github.com/mmp/pbrt-v4/blob/master/src/pbrt/shapes_test.cpp"
FCPW = "https://github.com/rohan-sawhney/fcpw/issues"
ATTACHED = "the mesh is an attached file"
CUT = "its coordinates were not available"

REPORTS = (
    Report("Embree", f"{EMBREE}/133", "a ray that starts on a triangle misses it", start_on_triangle),
    Report("Embree", f"{EMBREE}/174", "rays miss a closed surface at vertices", missing=ATTACHED),
    Report("Embree", f"{EMBREE}/181", "a ray at a vertex of nested cylinders misses", nested_cylinders),
    Report("Embree", f"{EMBREE}/188", "an edge is hit twice or never", edges_of_box),
    Report("Embree", f"{EMBREE}/387", "a ray nearly in the plane hits at t = 12,291", missing=CUT),
    Report("Embree", f"{EMBREE}/423", "a distant triangle is hit", missing=CUT),
    Report("Embree", f"{EMBREE}/464", "flat quads are never hit", flat_quads),
    Report("trimesh", f"{TRIMESH}/1338", "a hit far from the triangle", missing=ATTACHED),
    Report("trimesh", f"{TRIMESH}/1496", "rays at vertices and edges miss", small_box_in_large),
    Report("trimesh", f"{TRIMESH}/1766", "a ray between two triangles misses", diagonal_of_square),
    Report("trimesh", f"{TRIMESH_TEST}#test_on_vertex", "regression test: rays at vertices", corners_of_box),
    Report("trimesh", f"{TRIMESH_TEST}#test_box", "regression test: columns through a box", columns_through_box),
    Report("trimesh", f"{TRIMESH_TEST}#test_multiple_hits", "regression test: camera at a box", camera_at_box),
    Report(
        "trimesh", f"{TRIMESH_TEST}#test_embree_duplicate_hits", "regression test: start on a face", start_on_large_box
    ),
    Report("trimesh", f"{TRIMESH_TEST}#test_on_edge", "regression test: points on edges", cube_without_an_octant),
    Report(
        "Mitsuba 3",
        "https://github.com/mitsuba-renderer/mitsuba3/issues/1149",
        "rays at a shared edge miss (scene of its regression test)",
        shared_edge_at_angles,
    ),
    Report("tinybvh", "https://github.com/jbikker/tinybvh/issues/168", "gaps in a closed mesh", missing=ATTACHED),
    Report("fcpw", f"{FCPW}/14", "a ray through a cube misses", cube_from_one_side),
    Report("fcpw", f"{FCPW}/18", "a ray that starts on a triangle hits another", start_on_second),
    Report(
        "libigl",
        "https://github.com/libigl/libigl-python-bindings/issues/78",
        "a wrong second distance",
        libigl_box,
    ),
    Report("Open3D", f"{OPEN3D}/5777", "distances with an error of 3e-5", missing=CUT),
    Report("Open3D", f"{OPEN3D}/6188", "rays around a point next to a box", rays_around_point),
    Report("three-mesh-bvh", f"{THREE_BVH}/112", "a hit is lost far from the origin", missing=ATTACHED),
    Report("three-mesh-bvh", f"{THREE_BVH}/169", "a ray at a vertex misses", missing=CUT),
    Report("three-mesh-bvh", f"{THREE_BVH}/684", "the bottom edge is missed for some origins", slanted_bottom_edge),
    Report(
        "three.js",
        "https://github.com/mrdoob/three.js/issues/11449",
        "rays from vertices of a block miss a sphere",
        sphere_above_block,
    ),
    Report(
        "pbrt-v4", f"{PBRT_TEST}#Watertight", "test that is switched off: rays leave a closed mesh", pbrt_watertight
    ),
    Report("pbrt-v4", f"{PBRT_TEST}#BadCases", "a triangle without area is hit", pbrt_collinear),
)
"""The reports, by tracer."""
