# SPDX-License-Identifier: GPL-3.0-or-later
"""Cost maps in the Image Editor: the cost of each pixel in one structure, or in two on a common scale."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
from bpy.props import IntProperty

from ...core.base import native
from ...core.base.arrays import F32
from ...core.base.notes import Notes
from ...core.choose import auto, choice
from ...core.measure import costmap
from ...core.measure.reference import Reference, affordable
from ...core.scene import rays
from ...core.scene.workload import Workload
from ...core.structures import catalogue
from ...core.structures.settings import memory_limit
from ...core.structures.specs import structure_of
from ..session import trees
from ..settings import properties
from . import lettering, workloads

IMAGE = "Halfspace Costs"
BACK = (0.09, 0.095, 0.11)
MARGIN, TEXT, BAR = 14, 15.0, 18
"""Pixels around and between maps, of the letters' height, and of the colour bar's height."""

log = logging.getLogger(__name__)


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
        except native.FAILURES as error:
            log.error("Halfspace could not draw the cost map", exc_info=error)
            self.report({"ERROR"}, " ".join(str(error).split()))
            return {"CANCELLED"}
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
    return compose(maps, costmap.quantity(group.cost))


def _reference(structure: Any, workload: Workload, size: tuple[int, int]) -> Reference:
    """Brute force's answers to a sample of the map's rays, because every time is shown with its errors."""
    sets = rays.make(workload, structure, size=size, seed=0, names=("primary",))[:1]
    wanted = min(auto.CHECKED, affordable(workload))
    return Reference(native.load(), workload, sets, wanted, seed=0)


def compose(maps: list[tuple[str, F32]], what: costmap.Quantity) -> F32:
    """Maps side by side under their titles, above one colour bar with numbers: (h, w, 3) display values."""
    height, width = maps[0][1].shape
    end = costmap.scale_end([values for _, values in maps])
    line = int(TEXT * 1.4)
    foot = MARGIN + line + BAR + MARGIN
    across = MARGIN + len(maps) * (width + MARGIN)
    picture = np.tile(np.array(BACK, np.float32), (foot + height + 2 * line + MARGIN, across, 1))
    words = []
    # Place the maps with their titles.
    for i, (title, values) in enumerate(maps):
        x = MARGIN + i * (width + MARGIN)
        picture[foot : foot + height, x : x + width] = costmap.coloured(values, end)
        words.append((title, x, foot + height + line + 5.0))
        words.append((f"{what.label} {what.unit}: {costmap.summary(values)}", x, foot + height + 8.0))
    # Draw the colour bar and its numbers.
    bar = across - 2 * MARGIN
    scale = np.linspace(0, end, bar, dtype=np.float32)
    picture[MARGIN + line : MARGIN + line + BAR, MARGIN : MARGIN + bar] = costmap.coloured(scale, end)
    for tick in costmap.ticks(end):
        text = costmap.number(tick) if tick < end else f"{costmap.number(tick)} {what.unit}"
        x = MARGIN + bar * tick / end - (lettering.width(text, TEXT) if tick else 0) / (1 if tick == end else 2)
        words.append((text, x, float(MARGIN)))
    lettering.write(picture, words, TEXT)
    return picture


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


def register() -> None:
    """Register the operator."""
    bpy.utils.register_class(HALFSPACE_OT_cost_map)


def unregister() -> None:
    """Undo `register`."""
    bpy.utils.unregister_class(HALFSPACE_OT_cost_map)
