# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels in the Render properties. Drawing only reads; it never builds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import bpy
from bl_ui import properties_render

from ...core.base import native
from ...core.choose import choice
from ...core.structures.settings import BOUNCES
from ..measure import checking
from ..render.engine import ENGINE
from ..session import reports, trees
from ..settings import presets
from . import manual, structure
from .texts import fold, wrapped

STATISTICS = (
    ("Extraction", "extract_seconds", "{:.2f} s"),
    ("Build", "build_seconds", "{:.2f} s"),
    ("Render", "seconds", "{:.2f} s"),
    ("Rays", "mrays_s", "{:.2f} M/s"),
    ("Memory", "bytes", "{:,} bytes"),
    ("Peak of all memory", "peak_bytes", "{:,} bytes"),
    ("Nodes, axis", "nodes_axis", "{:,}"),
    ("Nodes, oblique", "nodes_oblique", "{:,}"),
    ("Leaves", "leaves", "{:,}"),
    ("Empty leaves", "leaves_empty", "{:,}"),
    ("References", "references", "{:,}"),
    ("Refs per triangle", "references_per_triangle", "{:.2f}"),
    ("Largest leaf", "leaf_max", "{:,} triangles"),
    ("Instances", "instances", "{:,}"),
    ("Meshes", "meshes", "{:,}"),
    ("Top", "top", "{}"),
    ("Depth, largest", "depth_max", "{:,}"),
    ("Depth, mean", "depth_mean", "{:.1f}"),
    ("Expected cost", "sah_cost", "{:.2f}"),
)
"""Lines of the statistics panel: label, key, format."""

ANSWER = 3
"""Number of reasons for an automatic choice that are always shown."""


def registered(names: Mapping[str, Any]) -> tuple[type, ...]:
    """The panels of a module, by its `globals()`, in the order of their definitions, which is that of registration."""
    values = [one for value in names.values() for one in (value if isinstance(value, tuple) else (value,))]
    kinds = [one for one in values if isinstance(one, type) and issubclass(one, bpy.types.Panel)]
    return tuple(kind for kind in kinds if kind.__module__ == names["__name__"])


def switched(column: Any, owner: Any, switch: str, value: str, heading: str) -> None:
    """Add a row with a check box and the value that has an effect with it; where the column has the dots of animation,
    that of the value.
    """
    moves = column.use_property_decorate
    row = column.row(align=True, heading=heading)
    row.use_property_decorate = False
    row.prop(owner, switch, text="")
    inner = row.row(align=True)
    inner.active = getattr(owner, switch)
    inner.prop(owner, value, text="")
    if moves:
        row.prop_decorator(owner, value)


def rows(layout: Any, owner: Any, *names: str, **labelled: str) -> None:
    """Add rows of these properties, with their own labels, then with those that are given."""
    for name in names:
        layout.prop(owner, name)
    for name, text in labelled.items():
        layout.prop(owner, name, text=text)


class EnginePanel:
    """A panel that appears only for this engine."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"

    section = ""
    """Heading of docs/manual.md that explains the panel."""

    presets = ""
    """The key of the presets of pictures that its header lists."""

    block = ""
    """Name in the context of the data that the panel shows; without that data it does not appear."""

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.engine == ENGINE and (not cls.block or getattr(context, cls.block) is not None)

    def draw_header_preset(self, context: Any) -> None:
        if self.presets:
            presets.draw_picture(self.layout, self.presets)  # type: ignore[attr-defined]
        help_button(self.layout, self.section)  # type: ignore[attr-defined]

    def column(self, *, moves: bool = True) -> Any:
        """A column with labels next to the values. moves: whether the properties have the dots of animation."""
        layout = self.layout  # type: ignore[attr-defined]
        layout.use_property_split = True
        layout.use_property_decorate = moves
        return layout.column()


class SidebarPanel:
    """A panel in the sidebar of 3D views that needs the native module."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Halfspace"

    section = ""
    """Heading of docs/manual.md that explains the panel."""

    @classmethod
    def poll(cls, context: Any) -> bool:
        return native.problem() is None

    def draw_header_preset(self, context: Any) -> None:
        help_button(self.layout, self.section)  # type: ignore[attr-defined]


class HALFSPACE_PT_sampling(EnginePanel, bpy.types.Panel):
    """The algorithm that computes the light. Its parts hold the number of samples."""

    bl_label = "Sampling"
    section = "Sampling"

    def draw(self, context: Any) -> None:
        column = self.column(moves=False)
        group = context.scene.halfspace
        column.prop(group, "integrator")
        if group.integrator == "ao":
            column.prop(group, "ambient_distance")
        self.layout.operator("halfspace.import_cycles", text="Import from Cycles", icon="IMPORT")


def _samples(column: Any, group: Any, prefix: str = "") -> Any:
    """Noise threshold and number of samples. prefix: of their properties. Returns the column of the numbers."""
    used = getattr(group, f"use_{prefix}adaptive")
    switched(column, group, f"use_{prefix}adaptive", f"{prefix}noise_threshold", "Noise Threshold")
    numbers = column.column(align=True)
    numbers.prop(group, f"{prefix}samples", text="Max Samples" if used else "Samples")
    if used:
        numbers.prop(group, f"{prefix}min_samples")
    return numbers


class HALFSPACE_PT_sampling_viewport(EnginePanel, bpy.types.Panel):
    """Samples of the rendered viewport."""

    bl_label = "Viewport"
    bl_parent_id = "HALFSPACE_PT_sampling"
    presets = "viewport_sampling"

    def draw(self, context: Any) -> None:
        _samples(self.column(moves=False), context.scene.halfspace, "preview_")


class HALFSPACE_PT_sampling_viewport_denoise(EnginePanel, bpy.types.Panel):
    """Removal of noise in the rendered viewport."""

    bl_label = "Denoise"
    bl_parent_id = "HALFSPACE_PT_sampling_viewport"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context: Any) -> None:
        self.layout.prop(context.scene.halfspace, "use_preview_denoising", text="")

    def draw(self, context: Any) -> None:
        column = self.column()
        group = context.scene.halfspace
        column.active = group.use_preview_denoising
        column.prop(group, "preview_denoising_start_sample", text="Start Sample")


class HALFSPACE_PT_sampling_render(EnginePanel, bpy.types.Panel):
    """Samples of final renders."""

    bl_label = "Render"
    bl_parent_id = "HALFSPACE_PT_sampling"
    presets = "sampling"

    def draw(self, context: Any) -> None:
        group = context.scene.halfspace
        _samples(self.column(moves=False), group).prop(group, "time_limit")


class HALFSPACE_PT_sampling_denoise(EnginePanel, bpy.types.Panel):
    """Removal of noise after a final render."""

    bl_label = "Denoise"
    bl_parent_id = "HALFSPACE_PT_sampling_render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context: Any) -> None:
        self.layout.prop(context.scene.halfspace, "use_denoising", text="")

    def draw(self, context: Any) -> None:
        wrapped(self.layout, "Open Image Denoise, guided by albedo and normal", icon="INFO")


class HALFSPACE_PT_sampling_advanced(EnginePanel, bpy.types.Panel):
    """The random numbers."""

    bl_label = "Advanced"
    bl_parent_id = "HALFSPACE_PT_sampling"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        row, group = self.column().row(align=True), context.scene.halfspace
        row.use_property_decorate = False
        row.prop(group, "render_seed")
        row.prop(group, "use_animated_seed", text="", icon="TIME")
        row.prop_decorator(group, "render_seed")


class HALFSPACE_PT_light_paths(EnginePanel, bpy.types.Panel):
    """Length of paths, and settings that trade exactness for less noise, in parts."""

    bl_label = "Light Paths"
    section = "Light Paths"
    presets = "light_paths"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and context.scene.halfspace.integrator != "ao"

    def draw(self, context: Any) -> None:
        column = self.column()
        group = context.scene.halfspace
        if group.integrator == "whitted":
            column.prop(group, "secondary_beams")


class HALFSPACE_PT_light_paths_max_bounces(EnginePanel, bpy.types.Panel):
    """Largest numbers of bounces, in all and by kind."""

    bl_label = "Max Bounces"
    bl_parent_id = "HALFSPACE_PT_light_paths"

    def draw(self, context: Any) -> None:
        column, group = self.column(), context.scene.halfspace
        column.prop(group, "max_bounces", text="Total")
        if group.integrator == "path":
            for name in BOUNCES[1:]:
                column.prop(group, name, text=name.partition("_")[0].capitalize())
        if hasattr(context.scene, "cycles"):
            column.prop(context.scene.cycles, "transparent_max_bounces", text="Transparent")


class HALFSPACE_PT_light_paths_clamping(EnginePanel, bpy.types.Panel):
    """Largest contributions of samples."""

    bl_label = "Clamping"
    bl_parent_id = "HALFSPACE_PT_light_paths"

    def draw(self, context: Any) -> None:
        labels = {"clamp_direct": "Direct Light", "clamp_indirect": "Indirect Light"}
        rows(self.column(), context.scene.halfspace, **labels)


class HALFSPACE_PT_light_paths_caustics(EnginePanel, bpy.types.Panel):
    """Light that is thrown by gloss and glass, which only path tracing finds."""

    bl_label = "Caustics"
    bl_parent_id = "HALFSPACE_PT_light_paths"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and context.scene.halfspace.integrator == "path"

    def draw(self, context: Any) -> None:
        column = self.column()
        group = context.scene.halfspace
        column.prop(group, "filter_glossy")
        labels = {"caustics_reflective": "Reflective", "caustics_refractive": "Refractive"}
        rows(column.column(heading="Caustics", align=True), group, **labels)


class HALFSPACE_PT_structure(EnginePanel, bpy.types.Panel):
    """The acceleration structure, or the reason why there is none. The sidebar of 3D views has its parameters."""

    bl_label = "Structure"
    section = "Structure"

    def draw(self, context: Any) -> None:
        column = self.column(moves=False)
        if problem := native.problem():
            wrapped(column, problem, icon="ERROR")
            return
        group = context.scene.halfspace
        # Next to a column of labels the check box would have no room for its own.
        row = column.row()
        row.use_property_split = False
        row.prop(group, "automatic")
        if group.automatic:
            wrapped(column, "The viewport and the overlay use:", icon="INFO")
        structure.draw_choice(column, group)
        wrapped(column, "More: sidebar (N)", icon="PREFERENCES")
        if (body := fold(column, "memory", "Memory")) is not None:
            body.prop(group, "instancing")
            structure.draw_top(body, context.scene)
            body.prop(group, "memory_limit")


def _of_blender(name: str, own: str, parent: str = "") -> type:
    """A panel of ours with the content of one of Blender's, whose own would be before those of all extensions."""
    theirs = getattr(properties_render, name)
    kept = ("bl_label", "bl_options", "draw", "draw_header")
    content = {key: getattr(theirs, key) for key in kept if hasattr(theirs, key)}
    if parent:
        content["bl_parent_id"] = parent
    return type(own, (EnginePanel, bpy.types.Panel), content)


SIMPLIFY = tuple(
    _of_blender(f"RENDER_PT_simplify{part}", f"HALFSPACE_PT_simplify{part}", "HALFSPACE_PT_simplify" if part else "")
    for part in ("", "_viewport", "_render", "_greasepencil")
)
"""Panels of Blender's *Simplify* that serve all engines."""


class SimplifyPanel(EnginePanel):
    """A part of *Simplify* whose settings Cycles stores."""

    bl_parent_id = "HALFSPACE_PT_simplify"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and hasattr(context.scene, "cycles")


class HALFSPACE_PT_simplify_culling(SimplifyPanel, bpy.types.Panel):
    """Objects that final renders leave out."""

    bl_label = "Culling"

    def draw(self, context: Any) -> None:
        column = self.column()
        column.active = context.scene.render.use_simplify
        for kind in ("camera", "distance"):
            rows(column, context.scene.cycles, f"use_{kind}_cull", f"{kind}_cull_margin")


class HALFSPACE_PT_simplify_textures(SimplifyPanel, bpy.types.Panel):
    """The largest textures."""

    bl_label = "Texture Size Limit"

    def draw(self, context: Any) -> None:
        column = self.column()
        column.active = context.scene.render.use_simplify
        column.prop(context.scene.cycles, "texture_limit", text="Viewport")
        column.prop(context.scene.cycles, "texture_limit_render", text="Render")


class HALFSPACE_PT_subdivision(EnginePanel, bpy.types.Panel):
    """How finely adaptive subdivision dices."""

    bl_label = "Subdivision"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and hasattr(context.scene, "cycles")

    def draw(self, context: Any) -> None:
        column = self.column()
        labels = {"dicing_rate": "Dicing Rate Render", "preview_dicing_rate": "Viewport"}
        cycles = context.scene.cycles
        rows(column, cycles, "max_subdivisions", "dicing_camera", **labels, offscreen_dicing_scale="Offscreen Scale")


class HALFSPACE_PT_motion_blur(EnginePanel, bpy.types.Panel):
    """The time in which the shutter is open."""

    bl_label = "Motion Blur"
    section = "Motion Blur"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context: Any) -> None:
        self.layout.prop(context.scene.render, "use_motion_blur", text="")

    def draw(self, context: Any) -> None:
        column = self.column()
        render = context.scene.render
        column.active = render.use_motion_blur
        rows(column, render, motion_blur_position="Position", motion_blur_shutter="Shutter")
        column.prop(context.scene.halfspace, "motion_steps")
        if (cycles := getattr(context.scene, "cycles", None)) is not None:
            column.prop(cycles, "rolling_shutter_type", text="Rolling Shutter")
            duration = column.column()
            duration.active = cycles.rolling_shutter_type != "NONE"
            duration.prop(cycles, "rolling_shutter_duration")


class HALFSPACE_PT_motion_blur_curve(EnginePanel, bpy.types.Panel):
    """How far the shutter is open over its time."""

    bl_label = "Shutter Curve"
    bl_parent_id = "HALFSPACE_PT_motion_blur"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        column = self.column(moves=False)
        column.active = context.scene.render.use_motion_blur
        column.template_curve_mapping(context.scene.render, "motion_blur_shutter_curve")
        row = column.row(align=True)
        for shape in ("SMOOTH", "ROUND", "ROOT", "SHARP", "LINE", "MAX"):
            icon = f"{'NO' if shape == 'MAX' else 'LIN' if shape == 'LINE' else shape}CURVE"
            row.operator("render.shutter_curve_preset", icon=icon, text="").shape = shape


class HALFSPACE_PT_film(EnginePanel, bpy.types.Panel):
    """Brightness, background and pixel filter."""

    bl_label = "Film"
    section = "Film"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        column = self.column()
        column.prop(context.scene.halfspace, "film_exposure")
        column.prop(context.scene.render, "film_transparent", text="Transparent")
        if (cycles := getattr(context.scene, "cycles", None)) is not None:
            glass = column.column()
            glass.active = context.scene.render.film_transparent
            labels = {
                "film_transparent_glass": "Transparent Glass",
                "film_transparent_roughness": "Roughness Threshold",
            }
            rows(glass, cycles, **labels)


class HALFSPACE_PT_film_pixel_filter(EnginePanel, bpy.types.Panel):
    """Shape and width of the pixel filter."""

    bl_label = "Pixel Filter"
    bl_parent_id = "HALFSPACE_PT_film"

    def draw(self, context: Any) -> None:
        column = self.column()
        group = context.scene.halfspace
        column.prop(group, "pixel_filter_type", text="Type")
        if group.pixel_filter_type != "BOX":
            column.prop(group, "filter_width", text="Width")


class HALFSPACE_PT_performance(EnginePanel, bpy.types.Panel):
    """Threads, and what is kept between the frames of an animation."""

    bl_label = "Performance"
    section = "Performance"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        column = self.column(moves=False)
        render = context.scene.render
        column.prop(render, "threads_mode")
        threads = column.column()
        threads.enabled = render.threads_mode == "FIXED"
        threads.prop(render, "threads")
        column.prop(render, "use_persistent_data", text="Persistent Data")


COMPOSITOR = tuple(
    _of_blender(f"RENDER_PT_eevee_performance_compositor{part}", f"HALFSPACE_PT_compositor{part}", parent)
    for part, parent in (("", "HALFSPACE_PT_performance"), ("_denoise_settings", "HALFSPACE_PT_compositor"))
)
"""How Blender's compositor works on the pictures of all engines."""


class HALFSPACE_PT_statistics(EnginePanel, bpy.types.Panel):
    """Costs, omissions and notes of the last picture."""

    bl_label = "Statistics"
    section = "Statistics"

    def draw(self, context: Any) -> None:
        layout = self.layout
        report, tree = reports.last(context.scene), trees.last(context.scene)
        if report is None:
            layout.label(text="Nothing rendered yet")
            of_tree(layout, tree)
            return
        layout.label(text=report.label)
        layout.label(text=f"{report.triangles:,} triangles")
        statistics(layout, {**report.statistics, "extract_seconds": report.extract_seconds}, report.triangles)
        if report.instances:
            wrapped(layout, report.instances[0].upper() + report.instances[1:], icon="INFO")
        if tree is not None and tree.number != report.tree and tree.check is not None:
            layout.label(text=f"The picture: {report.answers}", icon="INFO")
        answers(layout, tree, report.answers)
        for title, lines, icon in (
            ("Not supported", report.warnings, "ERROR"),
            ("Made into triangles", report.made, "INFO"),
            ("Why this structure", report.reasons[:ANSWER], "SHADERFX"),
            ("Left out, at no cost", report.left_out, "INFO"),
        ):
            if lines:
                box = layout.box()
                box.label(text=title, icon=icon)
                for line in lines:
                    wrapped(box, line)
        more = report.reasons[ANSWER:]
        if more and (body := fold(layout, "reasons", "More on this choice")) is not None:
            for line in more:
                wrapped(body, line)
        if tree is not None and tree.number != report.tree:
            layout.label(text=f"Built since: {tree.label}")
            statistics(layout, tree.structure.statistics, tree.count)


def of_tree(layout: Any, tree: trees.Tree | None) -> None:
    """Draw the costs of the last structure, and the check of its answers."""
    if tree is not None:
        statistics(layout, tree.structure.statistics, tree.count)
        for line in tree.structure.statistics["left_out"]:
            wrapped(layout, f"Left out: {line}")
    answers(layout, tree)


def help_button(layout: Any, section: str) -> None:
    """Add a button that opens the manual at this heading."""
    if section:
        layout.operator(manual.HALFSPACE_OT_manual.bl_idname, text="", icon="HELP", emboss=False).section = section


def statistics(layout: Any, numbers: Mapping[str, Any], triangles: int) -> None:
    """Draw a table of the known statistics."""
    values = dict(numbers)
    if "references" in values:
        values["references_per_triangle"] = values["references"] / max(triangles, 1)
    grid = layout.grid_flow(row_major=True, columns=2, even_columns=True)
    for label, key, form in STATISTICS:
        if key in values:
            grid.label(text=label)
            grid.label(text=form.format(values[key]))


def answers(layout: Any, tree: trees.Tree | None, known: str = "") -> None:
    """Draw the result of the last check of the structure, and the button that checks it. known: text
    without a check.
    """
    layout.operator(checking.HALFSPACE_OT_check.bl_idname, icon="VIEWZOOM")
    found = None if tree is None else tree.check
    if tree is None or found is None:
        if known or tree is not None:
            text = known or choice.NOT_COMPARED
            layout.label(text=text[0].upper() + text[1:], icon="INFO")
        return
    # State the errors, then the speeds of each ray set.
    errors, what = found.errors, f"{found.errors.rays:,} answers of {tree.label}"
    if found.right:
        wrapped(layout, f"{what} are those of brute force, bit for bit", icon="CHECKMARK")
    else:
        kinds = f"{errors.false_miss} hits lost, {errors.false_hit} invented, {errors.wrong_triangle} other triangles"
        wrong = f"{errors.wrong} of {what} differ from brute force"
        wrapped(layout, f"{wrong}: {kinds}, the others in t, u or v", icon="ERROR")
    grid = layout.grid_flow(row_major=True, columns=4, even_columns=False)
    for text in ("Rays", "Mray/s", "Steps", "Tests"):
        grid.label(text=text)
    for name, speed in found.mrays_s.items():
        for text in (name, f"{speed:.2f}", f"{found.steps[name]:.1f}", f"{found.tests[name]:.1f}"):
            grid.label(text=text)


CLASSES = registered(globals())
