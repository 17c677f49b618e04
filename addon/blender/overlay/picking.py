# SPDX-License-Identifier: GPL-3.0-or-later
"""The ray whose path is shown: picked under the cursor in a 3D view."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from bpy.props import FloatProperty, FloatVectorProperty
from bpy_extras import view3d_utils

from ...core.base import native
from ...core.overlay import beams, cells, polygons
from ..session import building, trees
from ..state import Slot


@dataclass(frozen=True)
class Ray:
    """A picked ray. origin, direction: in world space, three numbers each.

    up: of the view in which it was picked. pixel: distance between the rays of neighbouring pixels there, of directions
    of length one, or of origins if `parallel`. any_hit: whether the ray ends at any hit, as shadow rays do.
    """

    origin: tuple[float, ...]
    direction: tuple[float, ...]
    up: tuple[float, ...] = (0.0, 0.0, 1.0)
    pixel: float = 1e-3
    parallel: bool = False
    t_max: float = math.inf
    any_hit: bool = False

    def within(self, origin: Any) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """The same ray in the frame with this origin in world space."""
        return tuple(float(a) - float(b) for a, b in zip(self.origin, origin, strict=True)), self.direction

    def path(self, tree: trees.Tree) -> cells.Path:
        """Its traversal of a tree."""
        return cells.follow(tree.structure, *self.within(tree.origin), self.t_max, any_hit=self.any_hit)

    def tile(self, origin: Any, spacing: float, side: int = beams.SIDE) -> tuple[Any, Any]:
        """The rays of a tile around it in that frame, 8 of them `spacing` pixels apart, or `side` in their place."""
        place, direction = (np.array(part, np.float64) for part in self.within(origin))
        spacing *= self.pixel
        return beams.tile(place, direction, np.array(self.up), spacing, parallel=self.parallel, side=side)

    def beam(self, tree: trees.Tree, spacing: float) -> beams.Beam | polygons.PolygonBeam:
        """The tile's traversal of a tree, as beams of polygons where camera rays go as such."""
        if not polygons.traces(tree.structure):
            return beams.follow(tree.structure, *self.tile(tree.origin, spacing))
        rays = self.tile(tree.origin, spacing, polygons.SIDE)
        return polygons.follow(tree.structure, *rays, tree.vertices, tree.triangles)


POLL_SECONDS = 0.2
"""Interval at which a build is observed, in seconds."""

RAY: Slot[Ray] = Slot()

last = RAY.of
"""The ray picked in a scene, or None."""


def keep(scene: Any, ray: Ray | None) -> None:
    """Show the path of this ray, or of none."""
    RAY.keep(scene, ray)
    trees.redraw()


def under(event: Any, screen: Any) -> Ray | None:
    """The ray through the pixel under the mouse, in any 3D view of the screen; None outside of them."""
    # Find the region under the mouse, then its rays through this pixel and its right neighbour.
    for area in screen.areas:
        if area.type != "VIEW_3D":
            continue
        for region in area.regions:
            x, y = event.mouse_x - region.x, event.mouse_y - region.y
            if region.type != "WINDOW" or not (0 <= x < region.width and 0 <= y < region.height):
                continue
            view = area.spaces.active.region_3d
            pixels = ((x, y), (x + 1, y))
            origin, next_origin = (view3d_utils.region_2d_to_origin_3d(region, view, at) for at in pixels)
            direction, next_direction = (view3d_utils.region_2d_to_vector_3d(region, view, at) for at in pixels)
            parallel = not view.is_perspective
            pixel = (next_origin - origin).length if parallel else (next_direction - direction).length
            up = view.view_matrix.inverted().col[1][:3]
            return Ray(tuple(origin), tuple(direction), tuple(up), pixel, parallel)
    return None


def _show_status(context: Any) -> None:
    """Show the effect of a click, and the progress of the structure's build, in the status bar."""
    missing = trees.last(context.scene) is None
    progress = f"Building the structure: {building.progress() or 0.0:.0%}   " if missing else ""
    context.workspace.status_text_set(f"{progress}Click: keep this ray   Esc: leave")


class HALFSPACE_OT_pick_ray(bpy.types.Operator):
    """Shows the path of the ray under the cursor."""

    bl_idname = "halfspace.pick_ray"
    bl_label = "Pick a Ray"
    bl_description = (
        "Follow the ray under the cursor through the structure: the cells it visits, the planes it crosses, "
        "the triangles it tests. Click to keep the ray, Esc to cancel"
    )
    bl_options = {"REGISTER", "UNDO"}

    origin: FloatVectorProperty(name="Origin", subtype="TRANSLATION", options={"SKIP_SAVE"})  # type: ignore[valid-type]
    direction: FloatVectorProperty(  # type: ignore[valid-type]
        name="Direction", subtype="DIRECTION", default=(0.0, 0.0, -1.0), options={"SKIP_SAVE"}
    )

    pixel: FloatProperty(  # type: ignore[valid-type]
        name="Pixel",
        description="Distance between the unit directions of neighbouring pixels, for the beam around the ray",
        default=1e-3,
        min=1e-6,
        max=1.0,
        options={"SKIP_SAVE"},
    )

    _before: tuple[Ray | None, bool, set[str]] = (None, False, set())
    """The ray and the overlay's settings before the operator."""

    _timer: Any = None

    @classmethod
    def poll(cls, context: Any) -> bool:
        return native.problem() is None and context.scene is not None

    def execute(self, context: Any) -> set[str]:
        """Follow the ray of the properties, for scripts."""
        for name in ("origin", "direction"):
            if not np.isfinite(getattr(self, name)).all():
                self.report({"ERROR"}, f"{name}: is not finite")
                return {"CANCELLED"}
        if not any(self.direction):
            self.report({"ERROR"}, "direction: is zero")
            return {"CANCELLED"}
        keep(context.scene, Ray(tuple(self.origin), tuple(self.direction), pixel=self.pixel))
        return {"FINISHED"}

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Start to follow the cursor; without a structure its build starts, too."""
        settings = context.scene.halfspace.overlay
        self._before = last(context.scene), settings.show, set(settings.parts)
        settings.show = True
        if not settings.parts & {"RAY", "BEAM"}:
            settings.parts |= {"RAY"}
        if trees.last(context.scene) is None:
            building.need(context.scene)
        context.window.cursor_modal_set("EYEDROPPER")
        self._timer = context.window_manager.event_timer_add(POLL_SECONDS, window=context.window)
        context.window_manager.modal_handler_add(self)
        _show_status(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Follow the mouse until a click."""
        if event.type in {"ESC", "RIGHTMOUSE"}:
            return self._leave(context)
        if event.type == "TIMER":
            if trees.last(context.scene) is None and (problem := building.problem()):
                self.report({"ERROR"}, problem)
                return self._leave(context)
            _show_status(context)
            return {"PASS_THROUGH"}  # events do not identify their timer
        if event.type in {"MOUSEMOVE", "LEFTMOUSE"}:
            ray = under(event, context.screen)
            if ray is not None:
                keep(context.scene, ray)
            if event.type == "LEFTMOUSE" and event.value == "PRESS":
                if ray is None:
                    return self._leave(context)
                # Store the ray in the properties, which the user may adjust after the operation.
                self.origin, self.direction = ray.origin, ray.direction
                self.pixel = self.pixel if ray.parallel else ray.pixel
                self._end(context)
                return {"FINISHED"}
            return {"RUNNING_MODAL"}
        return {"PASS_THROUGH"}

    def _leave(self, context: Any) -> set[str]:
        """Restore the ray and the settings."""
        settings = context.scene.halfspace.overlay
        ray, settings.show, settings.parts = self._before
        keep(context.scene, ray)
        self._end(context)
        return {"CANCELLED"}

    def _end(self, context: Any) -> None:
        context.window_manager.event_timer_remove(self._timer)
        context.window.cursor_modal_restore()
        context.workspace.status_text_set(None)


class HALFSPACE_OT_forget_ray(bpy.types.Operator):
    """Forgets the ray."""

    bl_idname = "halfspace.forget_ray"
    bl_label = "Forget the Ray"
    bl_description = "Show no ray"

    def execute(self, context: Any) -> set[str]:
        keep(context.scene, None)
        return {"FINISHED"}


CLASSES = (HALFSPACE_OT_pick_ray, HALFSPACE_OT_forget_ray)
