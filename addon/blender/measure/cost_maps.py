# SPDX-License-Identifier: GPL-3.0-or-later
"""Cost maps in the Image Editor: the cost of each pixel in one structure, or in two on a common scale."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from bpy.props import IntProperty

from ...core.base import native
from ...core.base.arrays import F32, F64
from ...core.base.notes import Notes
from ...core.choose import auto, choice
from ...core.measure import costmap
from ...core.measure.reference import Reference, affordable
from ...core.scene import rays
from ...core.scene.workload import View, Workload
from ...core.structures import catalogue
from ...core.structures.settings import memory_limit
from ...core.structures.specs import structure_of
from ..session import failures, trees
from ..settings import properties, signals
from ..settings.inspector_settings import range_name
from ..state import Slot
from . import map_pictures, workloads
from .map_pictures import Look

IMAGE = "Halfspace Costs"


@dataclass(eq=False)
class Kept:
    """The last maps: title and numbers of each, what they measure, and the rays of their pixels.

    view: of the rays, in the scene frame whose origin is at `origin` in world space. cursor: column and row from the
    bottom, or None.
    """

    maps: list[tuple[str, F64]]
    what: costmap.Quantity
    view: View
    origin: F64
    cursor: tuple[int, int] | None = None

    def picture(self, scene: Any) -> F32:
        """The maps with their ranges of the scene's settings and the cursor."""
        looks = [
            Look(cursor=self.cursor) if own is None else Look(own.low / 100, own.high / 100, self.cursor)
            for own in self.ranges(scene)
        ]
        return map_pictures.compose(self.maps, self.what, looks)

    def ranges(self, scene: Any) -> list[Any]:
        """The range of each map in the scene's settings; None after an undo beyond the first map of its quantity."""
        known = scene.halfspace.inspector.ranges
        return [known.get(range_name(self.what.key, place)) for place in range(len(self.maps))]

    def add_ranges(self, scene: Any) -> None:
        """Add the ranges that the scene's settings lack."""
        for place, own in enumerate(self.ranges(scene)):
            if own is None:
                scene.halfspace.inspector.ranges.add().name = range_name(self.what.key, place)

    def ray(self, pixel: tuple[int, int]) -> tuple[F64, F64]:
        """Origin in world space and direction of the camera ray of a pixel."""
        height, width = self.maps[0][1].shape
        directions = rays.pinhole(self.view, (width, height), width / height)
        return self.view.eye + self.origin, directions[(height - 1 - pixel[1]) * width + pixel[0]]


KEPT: Slot[Kept] = Slot()
"""The maps that the picture shows: of one scene at most, because there is one picture."""


class HALFSPACE_OT_cost_map(bpy.types.Operator):
    """Makes the picture."""

    bl_idname = "halfspace.cost_map"
    bl_label = "Show Cost Map"
    bl_description = (
        "Trace one ray per pixel of the camera's view through the structure, and show the cost of each in the Image "
        "Editor. With a second structure, both on one scale"
    )
    bl_options = {"REGISTER", "UNDO"}

    width: IntProperty(name="Width", default=512, min=8, max=4096)  # type: ignore[valid-type]

    @classmethod
    def poll(cls, context: Any) -> bool:
        return native.problem() is None and context.scene is not None

    def execute(self, context: Any) -> set[str]:
        scene, window = context.scene, context.window
        if window is not None:
            window.cursor_set("WAIT")
        try:
            picture = draw(scene, self.width, lambda line: self.report({"WARNING"}, line))
        except BaseException as error:
            return failures.reported(self, error, "draw the cost map")
        finally:
            if window is not None:
                window.cursor_set("DEFAULT")
        show(context, keep(picture))
        return {"FINISHED"}


def draw(scene: Any, width: int, tell: Callable[[str], None] | None = None) -> F32:
    """The cost map with the scene's settings, (h, w, 3) display values. Raises the exceptions of extraction and builds.

    tell: called with each line about omissions.
    """
    group, render = scene.halfspace, scene.render
    size = costmap.shaped(width, (render.resolution_x, render.resolution_y))
    specs = [properties.spec(group)]
    if catalogue.load().get(group.second) is not None:
        specs.append(group.second)
    bpy.context.view_layer.update()  # first, because evaluation reports changes
    tree = next(filter(None, (trees.usable(scene, spec) for spec in specs)), None)
    # Measure both maps over the same triangles, those of the existing structure if there is one.
    workload = workloads.current(scene.name, size) if tree is None else workloads.of_tree(tree, scene.name, size)
    notes = Notes()
    properties.remark_unknown(group, notes)
    for line in (*notes.lines(), *workload.notes) if tell is not None else ():
        tell(line)
    module, limit = native.load(), memory_limit(group.memory_limit)
    maps = []
    reference: Reference | None = None
    # Measure each structure; the existing one is reused.
    for spec in specs:
        if tree is not None and tree.spec == spec:
            structure = tree.structure
        else:
            structure = module.build(workload.vertices, workload.triangles, spec, memory_limit=limit)
        label = catalogue.load()[structure_of(spec)].label
        if group.cost == "TIME":
            if reference is None:
                reference = _reference(structure, workload, size)
            label += f", {choice.Line(spec, wrong=reference.wrong(structure), checked=len(reference)).answers}"
        maps.append((label, costmap.measure(structure, workload, size, group.cost)))
    kept = Kept(maps, costmap.quantity(group.cost), workload.view, _origin(workload, tree))
    kept.add_ranges(scene)
    KEPT.keep_only(scene, kept)
    return kept.picture(scene)


def _origin(workload: Workload, tree: trees.Tree | None) -> F64:
    """World position of the origin of the workload's frame, which is the tree's if there is one."""
    if tree is not None:
        return tree.origin
    assert workload.render_scene is not None, "it was read from the open file"
    return workload.render_scene.geometry.origin


def recolour(scene: Any) -> None:
    """Draw the last maps of this scene again, after a change of their range or of the cursor."""
    kept = KEPT.of(scene)
    if kept is not None and bpy.data.images.get(IMAGE) is not None:
        keep(kept.picture(scene))


def _reference(structure: Any, workload: Workload, size: tuple[int, int]) -> Reference:
    """Brute force's answers to a sample of the map's rays, because every time is shown with its errors."""
    sets = rays.make(workload, structure, size=size, seed=0, names=("primary",))[:1]
    wanted = min(auto.CHECKED, affordable(workload))
    return Reference(native.load(), workload, sets, wanted, seed=0)


def keep(picture: F32) -> Any:
    """Blender's image of the picture, reused while the size is the same."""
    height, width = picture.shape[:2]
    image = bpy.data.images.get(IMAGE)
    if image is None or tuple(image.size) != (width, height):
        former, image = image, bpy.data.images.new(IMAGE, width, height)
        if former is not None:
            former.user_remap(image)  # editors go on to show it
            bpy.data.images.remove(former)
            image.name = IMAGE
    full = np.concatenate([picture, np.ones((height, width, 1), np.float32)], axis=2)
    image.pixels.foreach_set(full.reshape(-1))
    image.update()
    return image


def show(context: Any, image: Any) -> None:
    """Show the image in the editor that shows it already, else in one of this window, else in a new window."""
    if context.window is None:
        return
    # Editors of all windows, those of this window first.
    windows = sorted(context.window_manager.windows, key=lambda window: window != context.window)
    editors = [(w, a) for w in windows for a in w.screen.areas if a.type == "IMAGE_EDITOR"]
    area = next((a for _, a in editors if a.spaces.active.image == image), None)
    area = area or next((a for w, a in editors if w == context.window), None)
    if area is None:
        if not bpy.ops.wm.window_new.poll():
            return
        bpy.ops.wm.window_new()
        area = context.window_manager.windows[-1].screen.areas[0]
        area.type = "IMAGE_EDITOR"
    area.spaces.active.image = image


CLASSES = (HALFSPACE_OT_cost_map,)


def register() -> None:
    """Listen to the range."""
    signals.range_changed.connect(recolour)


def unregister() -> None:
    """Undo `register`."""
    signals.range_changed.disconnect(recolour)
