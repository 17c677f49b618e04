# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes whose structures are drawn offscreen, the pictures, and where in them what is drawn should be."""

from collections.abc import Callable
from typing import Any

import bpy
import gpu
import numpy as np
import pytest
from mathutils import Euler, Matrix, Vector

from addon.blender.overlay import drawing as overlay
from addon.blender.session import trees
from addon.core.base import native
from addon.core.overlay import planes
from addon.core.structures import catalogue
from tests.blender.shapes import cube, grid, look, place

WIDTH, HEIGHT = 200, 150


def some_triangles() -> tuple[Any, Any]:
    """Corners and triangles, tilted."""
    rng = np.random.default_rng(3)
    corners = (rng.random((40, 1, 3)) * 4 + 0.4 * rng.standard_normal((40, 3, 3))).astype(np.float32)
    return corners.reshape(-1, 3), np.arange(120, dtype=np.int32).reshape(-1, 3)


def representatives() -> list[str]:
    """One structure for each way of looking: the kinds of planes that it draws over a few tilted triangles."""
    if native.problem() is not None:
        return []
    chosen: dict[frozenset[int], str] = {}
    for structure in catalogue.load().structures:
        tree = native.load().build(*some_triangles(), structure.id)
        chosen.setdefault(frozenset(tree.split_polygons()["kind"].tolist()), structure.id)
    return list(chosen.values())


STRUCTURES = representatives()


def boxes(add: Any, offset: tuple[float, float, float] = (0, 0, 0)) -> None:
    """Boxes of several sizes, parallel to the axes."""
    for i, (x, y, z) in enumerate([(-3, 0, 0), (0, 2, 1), (2.5, -1.5, 0.5), (1, 1, 3)]):
        place = (x + offset[0], y + offset[1], z + offset[2])
        add(f"Box {i}", cube(size=1.0 + 0.3 * i), location=place)


def tilted(add: Any) -> None:
    """Thin boxes, none of them parallel to an axis."""
    for i in range(6):
        turn = Euler((0.5 + 0.3 * i, 0.4 * i, 0.9 - 0.2 * i))
        add(f"Plate {i}", cube(), location=(1.6 * i - 4, (-1) ** i, 0.4 * i), scale=(1, 1, 0.05), rotation_euler=turn)


def far_away(add: Any) -> None:
    """A curved grid and a box, kilometres from the world's origin."""
    mesh = grid(12)
    points = np.array([vertex.co for vertex in mesh.vertices])
    points[:, 2] = np.sin(3 * points[:, 0]) * points[:, 1]
    mesh.vertices.foreach_set("co", points.astype(np.float32).reshape(-1))
    add("Sea", mesh, location=(4000, -3000, 500), scale=(3, 3, 1))
    boxes(add, (4000, -3000, 502))


def row(scene: Any, size: tuple[int, int]) -> Any:
    """Give the scene five boxes before a camera, and a picture of this size."""
    for i in range(5):
        place(f"Box {i}", cube(size=0.8), location=(1.1 * i - 2.5, 0.3 * i, 0))
    look(size, (0, 0, 12))
    return scene


def plates(scene: Any, add: Any) -> Any:
    """Give the scene tilted plates and boxes before a camera."""
    boxes(add)
    tilted(add)
    look((320, 160), (0, 0, 16))
    scene.halfspace.inspector.width = 64
    return scene


SCENES = [boxes, tilted, far_away]


def everywhere(test: Callable[..., None]) -> Callable[..., None]:
    """A test of every scene, which `make(add)` builds, with every `structure` of `STRUCTURES`."""
    scenes = pytest.mark.parametrize("make", SCENES)
    return pytest.mark.parametrize("structure", STRUCTURES)(scenes(test))


def build(scene: Any, structure: str, **settings: Any) -> trees.Tree:
    scene.halfspace.structure = structure
    for key, value in {"show": True, "auto_update": False, **settings}.items():
        setattr(scene.halfspace.overlay, key, value)
    assert bpy.ops.halfspace.build_structure() == {"FINISHED"}
    tree = trees.last(scene)
    assert tree is not None
    return tree


def camera(tree: trees.Tree) -> tuple[Any, Any]:
    """View and projection from outside, from which all planes are in front."""
    outwards = Vector((7.0, -17.0, 9.0))
    turn = (-outwards).to_track_quat("-Z", "Y").to_matrix().to_4x4()
    place = Matrix.Translation(Vector(tree.origin) + outwards) @ turn
    near, far, tangent = 0.5, 100.0, 0.42
    x, y = 1 / (tangent * WIDTH / HEIGHT), 1 / tangent
    depth = (-(far + near) / (far - near), -2 * far * near / (far - near))
    return place.inverted(), Matrix(((x, 0, 0, 0), (0, y, 0, 0), (0, 0, *depth), (0, 0, -1, 0)))


def picture(canvas: Any, scene: Any, view: Any, projection: Any) -> np.ndarray[Any, Any]:
    """(HEIGHT, WIDTH, 4) of the overlay over black."""
    with canvas.bind(), gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
        framebuffer = gpu.state.active_framebuffer_get()
        framebuffer.clear(color=(0, 0, 0, 0), depth=1.0)
        gpu.matrix.load_matrix(view)
        gpu.matrix.load_projection_matrix(projection)
        overlay.paint(scene, (WIDTH, HEIGHT))
        pixels = framebuffer.read_color(0, 0, WIDTH, HEIGHT, 4, 0, "FLOAT")
    return np.array(pixels.to_list(), np.float32).reshape(HEIGHT, WIDTH, 4)


def show(canvas: Any, scene: Any, structure: str, **settings: Any) -> tuple[trees.Tree, np.ndarray[Any, Any], Any, Any]:
    """Build, with these settings of the overlay: the tree, its picture as of `picture`, view and projection."""
    tree = build(scene, structure, **settings)
    view, projection = camera(tree)
    return tree, picture(canvas, scene, view, projection), view, projection


def pick_a_box(scene: Any, **settings: Any) -> tuple[Vector, Vector]:
    """Pick a ray towards one of the `boxes`. Its origin and its direction, which ends in the box."""
    box = next(item for item in scene.objects if item.name == "Box 3").location
    start = box + Vector((9.0, -7.0, 5.0))
    assert bpy.ops.halfspace.pick_ray(origin=start, direction=box - start, **settings) == {"FINISHED"}
    return start, box - start


def projected(tree: trees.Tree, view: Any, projection: Any, *, depth: int) -> list[tuple[int, np.ndarray[Any, Any]]]:
    """Kind and corners in pixels of each split polygon down to `depth`, planes of octants cut to the triangles' box."""
    found = planes.choose(tree.structure, (0, depth), planes.KINDS, 100_000)
    assert found.complete
    found = planes.within(found, tree.vertices, tree.triangles)
    world = found.vertices.astype(np.float64) + tree.origin
    clip = np.concatenate([world, np.ones((len(world), 1))], axis=1) @ (np.array(projection) @ np.array(view)).T
    assert (clip[:, 3] > 0).all()
    pixels = (clip[:, :2] / clip[:, 3:] + 1) / 2 * [WIDTH, HEIGHT]
    parts = np.split(pixels, found.offsets[1:-1]) if len(found) else []
    return list(zip(found.kind.tolist(), parts, strict=True))


def distances(polygons: list[np.ndarray[Any, Any]]) -> np.ndarray[Any, Any]:
    """From each pixel's centre to the nearest edge of these polygons, (HEIGHT, WIDTH)."""
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    nearest = np.full((HEIGHT, WIDTH), np.inf)
    for polygon in polygons:
        for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
            along, length = b - a, float((b - a) @ (b - a))
            t = np.clip(((x - a[0]) * along[0] + (y - a[1]) * along[1]) / length, 0, 1) if length else 0.0
            nearest = np.minimum(nearest, np.hypot(x - a[0] - t * along[0], y - a[1] - t * along[1]))
    return nearest


def inside(polygon: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Which pixels' centres lie in a convex polygon, whichever way round it is, (HEIGHT, WIDTH)."""
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    sides = [
        (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])
        for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True)
    ]
    return (np.min(sides, axis=0) > 0) | (np.max(sides, axis=0) < 0)


def pane(vertices: np.ndarray[Any, Any], view: Any, projection: Any) -> np.ndarray[Any, Any]:
    """Corners in pixels of points in the world."""
    clip = np.concatenate([vertices, np.ones((len(vertices), 1))], axis=1) @ (np.array(projection) @ np.array(view)).T
    return (clip[:, :2] / clip[:, 3:] + 1) / 2 * [WIDTH, HEIGHT]
