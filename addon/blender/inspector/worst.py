# SPDX-License-Identifier: GPL-3.0-or-later
"""The worst camera, shadow and bounce rays of the camera's view through the last structure, one after another."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np
from bpy.props import IntProperty
from numpy.typing import NDArray

from ...core.base import native
from ...core.base.arrays import F64
from ...core.choose import auto
from ...core.inspector import beside, ray_costs, reasons
from ...core.inspector import replay as replays
from ...core.inspector.beside import Row
from ...core.inspector.csv_files import Times
from ...core.inspector.ray_costs import RayCosts
from ...core.measure import costmap
from ...core.measure.reference import Reference, affordable
from ...core.overlay import cells
from ...core.scene.workload import Workload
from ..measure import workloads
from ..overlay import framing, picking
from ..session import failures, trees
from ..state import Slot
from . import second

MOST = 1000
"""Number of rays of an order that can be visited."""


@dataclass(eq=False)
class Found:
    """The costs of the rays of a view through one tree.

    size: pixels of the view. camera: from `_camera`. orders: indices and values by set and key. times: by tree and
    set, once measured. place: of the ray that is shown in the order. lines: about that ray. beside: about that ray in
    the second structure, or None. again: costs in second structures, by tree and set.
    """

    tree: int
    size: tuple[int, int]
    camera: tuple[Any, ...]
    workload: Workload
    costs: dict[str, RayCosts]
    orders: dict[tuple[str, str], tuple[NDArray[np.int64], F64]] = field(default_factory=dict)
    times: dict[tuple[int, str], Times] = field(default_factory=dict)
    shown: tuple[str, str] = ("", "")
    place: int = 0
    lines: tuple[str, ...] = ()
    beside: Beside | None = None
    again: dict[tuple[int, str], RayCosts] = field(default_factory=dict)


@dataclass(frozen=True)
class Beside:
    """A ray in a second structure. spec: of that structure. rows: its numbers next to those of the first. lines: why it
    costs what it costs there.
    """

    spec: str
    rows: tuple[Row, ...]
    lines: tuple[str, ...]


FOUND: Slot[Found] = Slot()
"""Valid for the tree, size and camera that it names, see `known`."""


def known(scene: Any) -> Found | None:
    """The costs of rays through the scene's last tree, if they were measured."""
    found, tree = FOUND.of(scene), trees.last(scene)
    if found is None or tree is None:
        return None
    return found if (found.tree, found.size, found.camera) == (tree.number, _size(scene), _camera(scene)) else None


def _size(scene: Any) -> tuple[int, int]:
    """Pixels of the view with the scene's settings."""
    return costmap.shaped(scene.halfspace.inspector.width, (scene.render.resolution_x, scene.render.resolution_y))


def _camera(scene: Any) -> tuple[Any, ...]:
    """Key of the view apart from its size: position and frame of the camera."""
    item = scene.camera
    if item is None:
        return ()
    place = tuple(value for row in item.matrix_world for value in row)
    if item.type != "CAMERA":
        return place
    frame = item.data.view_frame(scene=scene)
    return (*place, item.data.type, *(value for corner in frame for value in corner))


def find(scene: Any, tree: trees.Tree) -> Found:
    """Count the rays of the camera's view, or return the known counts. Raises WorkloadError."""
    bpy.context.view_layer.update()  # moves the camera to where it was put
    found = known(scene)
    if found is not None:
        return found
    size = _size(scene)
    workload = workloads.of_tree(tree, scene.name, size)
    made = Found(tree.number, size, _camera(scene), workload, ray_costs.gather(tree.structure, workload, size))
    FOUND.keep(scene, made)
    return made


def order(found: Found, tree: trees.Tree, name: str, key: str) -> tuple[NDArray[np.int64], F64]:
    """Indices of the rays of a set from the worst on, and their steps, tests or nanoseconds."""
    if (name, key) not in found.orders:
        costs = found.costs[name]
        if key == "TIME":
            found.orders[name, key] = ray_costs.slowest(costs, times(found, tree, name).nanoseconds, MOST)
        else:
            indices = ray_costs.worst(costs, key, MOST)
            found.orders[name, key] = indices, costs.values(key)[indices].astype(np.float64)
    return found.orders[name, key]


def times(found: Found, tree: trees.Tree, name: str) -> Times:
    """Measure the times of the rays of a set, with the errors of the structure, or return the known ones."""
    if (tree.number, name) not in found.times:
        costs = found.costs[name]
        wanted = min(auto.CHECKED, affordable(found.workload))
        reference = Reference(native.load(), found.workload, [costs.rays], wanted, seed=0)
        measured = ray_costs.block_times(tree.structure, costs)
        found.times[tree.number, name] = Times(measured, reference.wrong(tree.structure), len(reference))
    return found.times[tree.number, name]


def show(scene: Any, tree: trees.Tree, found: Found, place: int) -> None:
    """Pick the ray at this place of the order, and state why it costs what it costs. Raises ValueError without rays."""
    settings = scene.halfspace.inspector
    name, key = settings.rays, settings.order
    indices, values = order(found, tree, name, key)
    if not len(indices):
        raise ValueError(f"No {ray_costs.SETS[name].lower()} ray: nothing is hit")
    place = place % len(indices)
    index, costs = int(indices[place]), found.costs[name]
    origin, direction = costs.rays.origins[index], costs.rays.directions[index]
    world = tuple(float(a) + float(b) for a, b in zip(origin, tree.origin, strict=True))
    t_max = float(costs.rays.t_max[index])
    ray = picking.Ray(world, tuple(map(float, direction)), t_max=t_max, any_hit=costs.rays.any_hit)
    picking.keep(scene, ray)
    # State the counts and the reasons.
    path = ray.path(tree)
    table = tree.table()
    lines = [f"{place + 1:,} of {len(indices):,} by {key.lower()}"]
    if key == "TIME":
        lines.append(f"{values[place]:,.0f} ns per ray of 64 neighbours; {found.times[tree.number, name].answers}")
    lines += reasons.summary(costs, index)
    lines += reasons.reasons(table, path, replays.replay(table, path), key)
    found.shown, found.place, found.lines = (name, key), place, tuple(lines)
    found.beside = _beside(scene, tree, found, index)
    _draw_ray(scene.halfspace.overlay)


def _beside(scene: Any, tree: trees.Tree, found: Found, index: int) -> Beside | None:
    """The shown ray in the second structure, if one is chosen. Raises what builds raise."""
    other, ray, (name, key) = second.find(scene, tree), picking.last(scene), found.shown
    if other is None or ray is None:
        return None
    costs = found.costs[name]
    if (other.number, name) not in found.again:
        found.again[other.number, name] = ray_costs.again(other.structure, costs)
    again = found.again[other.number, name]
    rows = beside.of_rays(costs, again, index)
    if key == "TIME":
        first, second_times = times(found, tree, name), times(found, other, name)
        rows += beside.of_times(first, second_times, index)
    path = ray.path(other)
    table = other.table()
    lines = reasons.reasons(table, path, replays.replay(table, path), key)
    return Beside(other.spec, tuple(rows), tuple(lines))


def _draw_ray(overlay: Any) -> None:
    """Draw the ray; alone if nothing was drawn before, because planes of the whole tree would hide it."""
    overlay.parts = overlay.parts | {"RAY"} if overlay.show else {"RAY"}
    overlay.show = True


def _look_from_the_side(context: Any, tree: trees.Tree) -> None:
    """Turn the 3D view to the picked ray, which is a dot in the camera's view."""
    ray = picking.last(context.scene)
    if ray is None:
        return
    path = ray.path(tree)
    points = np.array([path.origin + t * path.direction for t in cells.ends(path)]) + tree.origin
    framing.frame(getattr(context, "screen", None), points, framing.RAY_MARGIN, path.direction)


class HALFSPACE_OT_worst_ray(bpy.types.Operator):
    """Shows one of the worst rays."""

    bl_idname = "halfspace.worst_ray"
    bl_label = "Show Worst Ray"
    bl_description = (
        "Count all rays of the camera's view through the last structure, one by one, and show the worst with the "
        "reasons of its cost"
    )
    bl_options = {"UNDO"}  # without REGISTER: a repetition would go on from the place that Python keeps

    move: IntProperty(  # type: ignore[valid-type]
        name="Move", description="Places from the ray that is shown; 0 for the worst", options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        return native.problem() is None and context.scene is not None and trees.last(context.scene) is not None

    @classmethod
    def description(cls, context: Any, properties: Any) -> str:
        """The tooltip of each button."""
        words = {0: cls.bl_description, 1: "The next ray, less bad", -1: "The previous ray, worse"}
        return words.get(properties.move, cls.bl_description)

    def execute(self, context: Any) -> set[str]:
        scene = context.scene
        tree = trees.last(scene)
        assert tree is not None, "see poll"
        settings = scene.halfspace.inspector
        try:
            found = find(scene, tree)
            is_shown = found.shown == (settings.rays, settings.order)
            show(scene, tree, found, found.place + self.move if self.move and is_shown else 0)
            if settings.from_side:
                _look_from_the_side(context, tree)
        except BaseException as error:
            return failures.reported(self, error, "find the worst rays")
        return {"FINISHED"}


CLASSES = (HALFSPACE_OT_worst_ray,)
