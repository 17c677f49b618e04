# SPDX-License-Identifier: GPL-3.0-or-later
"""One cursor over all cost maps of the Image Editor: the numbers of one pixel in each structure, and its ray."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import IntProperty

from ..measure import cost_maps, map_pictures
from ..overlay import picking


def under(event: Any, screen: Any) -> tuple[int, int] | None:
    """Column and row, from the bottom, of the map's pixel under the mouse in an Image Editor; None outside of them."""
    image = bpy.data.images.get(cost_maps.IMAGE)
    kept = next(iter(cost_maps.KEPT.all()), None)
    if image is None or kept is None:
        return None
    height, width = kept.maps[0][1].shape
    for area in screen.areas:
        if area.type != "IMAGE_EDITOR" or area.spaces.active.image != image:
            continue
        for region in area.regions:
            x, y = event.mouse_x - region.x, event.mouse_y - region.y
            if region.type == "WINDOW" and 0 <= x < region.width and 0 <= y < region.height:
                u, v = region.view2d.region_to_view(x, y)
                place = u * image.size[0], v * image.size[1]
                return map_pictures.pixel_at(*place, len(kept.maps), (width, height))
    return None


def place(scene: Any, pixel: tuple[int, int] | None) -> None:
    """Show the cursor at this pixel of all maps, and pick its camera ray; None takes the cursor away."""
    kept = cost_maps.KEPT.of(scene)
    assert kept is not None, "there are maps"
    kept.cursor = pixel
    cost_maps.recolour(scene)
    if pixel is not None:
        origin, direction = kept.ray(pixel)
        picking.keep(scene, picking.Ray(tuple(map(float, origin)), tuple(map(float, direction))))


class HALFSPACE_OT_map_cursor(bpy.types.Operator):
    """Reads a pixel of the cost maps."""

    bl_idname = "halfspace.map_cursor"
    bl_label = "Read a Pixel"
    bl_description = (
        "Move one cursor over all cost maps: the numbers of the pixel in each structure, and its camera ray in the 3D "
        "views. Click to keep it, Esc to take it away"
    )
    bl_options = {"REGISTER", "UNDO"}
    _before: picking.Ray | None = None

    column: IntProperty(name="Column", min=0, options={"SKIP_SAVE"})  # type: ignore[valid-type]
    row: IntProperty(name="Row", description="From the bottom", min=0, options={"SKIP_SAVE"})  # type: ignore[valid-type]

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.scene is not None and cost_maps.KEPT.of(context.scene) is not None

    def execute(self, context: Any) -> set[str]:
        """Read the pixel of the properties, for scripts."""
        kept = cost_maps.KEPT.of(context.scene)
        assert kept is not None, "see poll"
        height, width = kept.maps[0][1].shape
        if not (self.column < width and self.row < height):
            self.report({"ERROR"}, f"The maps have {width} × {height} pixels")
            return {"CANCELLED"}
        place(context.scene, (self.column, self.row))
        return {"FINISHED"}

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Start to follow the mouse."""
        self._before = picking.last(context.scene)
        context.window.cursor_modal_set("CROSSHAIR")
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Follow the mouse until a click."""
        kept = cost_maps.KEPT.of(context.scene)
        if kept is None or event.type in {"ESC", "RIGHTMOUSE"}:
            return self._cancel(context)
        if event.type not in {"MOUSEMOVE", "LEFTMOUSE"}:
            return {"PASS_THROUGH"}
        pixel = under(event, context.screen)
        if pixel is not None and pixel != kept.cursor:
            place(context.scene, pixel)
        if event.type == "LEFTMOUSE" and event.value == "PRESS":
            if pixel is None:
                return self._cancel(context)
            context.window.cursor_modal_restore()
            self.column, self.row = pixel
            return {"FINISHED"}
        return {"RUNNING_MODAL"}

    def _cancel(self, context: Any) -> set[str]:
        """Take the cursor away, and show the ray that was picked before."""
        if cost_maps.KEPT.of(context.scene) is not None:
            place(context.scene, None)
        picking.keep(context.scene, self._before)
        context.window.cursor_modal_restore()
        return {"CANCELLED"}


CLASSES = (HALFSPACE_OT_map_cursor,)
