# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels in the View Layer, Camera, World, Object, Material and Light properties, where Blender's own show settings
that this engine does not read. Labels and places are those of Cycles.
"""

from __future__ import annotations

from typing import Any

import bpy

from ..read.camera import COEFFICIENTS
from ..read.nodes import active_tree, output_node
from .panels import EnginePanel, registered, rows, switched

SOLID = {"MESH", "CURVE", "SURFACE", "FONT", "META", "CURVES", "POINTCLOUD"}
"""Kinds of objects with surfaces."""

SEEN = SOLID | {"VOLUME", "LIGHT"}
"""Kinds of objects that rays meet."""

OF_PANORAMAS = {
    "EQUIRECTANGULAR": {
        "latitude_min": "Latitude Min",
        "latitude_max": "Max",
        "longitude_min": "Longitude Min",
        "longitude_max": "Max",
    },
    "FISHEYE_EQUIDISTANT": {"fisheye_fov": "Field of View"},
    "FISHEYE_EQUISOLID": {"fisheye_lens": "Lens", "fisheye_fov": "Field of View"},
    "FISHEYE_LENS_POLYNOMIAL": {
        "fisheye_fov": "Field of View",
        **{name: f"K{power}" for power, name in enumerate(COEFFICIENTS)},
    },
    "CENTRAL_CYLINDRICAL": {
        "central_cylindrical_range_v_min": "Height Min",
        "central_cylindrical_range_v_max": "Max",
        "central_cylindrical_range_u_min": "Longitude Min",
        "central_cylindrical_range_u_max": "Max",
        "central_cylindrical_radius": "Cylinder Radius",
    },
}
"""The settings of each kind of panorama that has any, with their labels."""


class HALFSPACE_PT_panorama(EnginePanel, bpy.types.Panel):
    """The projection of a panoramic camera."""

    bl_label = "Panorama"
    bl_parent_id = "DATA_PT_lens"
    bl_context = "data"
    block = "camera"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and context.camera.type == "PANO"

    def draw(self, context: Any) -> None:
        column = self.column()
        camera = context.camera
        column.prop(camera, "panorama_type")
        rows(column, camera, **OF_PANORAMAS.get(camera.panorama_type, {}))


class HALFSPACE_PT_filter(EnginePanel, bpy.types.Panel):
    """Contents of a view layer."""

    bl_label = "Filter"
    bl_context = "view_layer"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        column = self.column().column(heading="Include")
        labels = {"use_sky": "Environment", "use_solid": "Surfaces", "use_strand": "Curves", "use_volumes": "Volumes"}
        rows(column, context.view_layer, **labels, use_motion_blur="Motion Blur")
        if hasattr(context.view_layer, "cycles"):
            column.prop(context.view_layer.cycles, "use_denoising", text="Denoising")


class HALFSPACE_PT_override(EnginePanel, bpy.types.Panel):
    """Settings of the scene that a view layer overrides."""

    bl_label = "Override"
    bl_context = "view_layer"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        column = self.column()
        # Shorter than Blender's labels, which the default width cuts off.
        for name, text in (("material_override", "Material"), ("world_override", "World"), ("samples", "Samples")):
            if name in context.view_layer.bl_rna.properties:  # the second came after Blender 4.5.0
                column.prop(context.view_layer, name, text=text)


class _WorldPanel(EnginePanel):
    bl_context = "world"
    block = "world"


class HALFSPACE_PT_world_preview(_WorldPanel, bpy.types.Panel):
    """A picture of the world alone."""

    bl_label = "Preview"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        self.layout.template_preview(context.world)


class HALFSPACE_PT_world(_WorldPanel, bpy.types.Panel):
    """The inputs of the world's shader."""

    bl_label = "Surface"

    def draw(self, context: Any) -> None:
        _surface(self.layout, context.world, "color")


class HALFSPACE_PT_world_volume(_WorldPanel, bpy.types.Panel):
    """The inputs of the shader of the world's volume."""

    bl_label = "Volume"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and active_tree(context.world) is not None

    def draw(self, context: Any) -> None:
        _inputs(self.layout, context.world, "Volume")


class HALFSPACE_PT_world_mist(_WorldPanel, bpy.types.Panel):
    """Extent of the mist pass; only where a view layer has that pass."""

    bl_label = "Mist Pass"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and any(layer.use_pass_mist for layer in context.scene.view_layers)

    def draw(self, context: Any) -> None:
        rows(self.column(), context.world.mist_settings, "start", "depth", "falloff")


class HALFSPACE_PT_world_ray_visibility(_WorldPanel, bpy.types.Panel):
    """The rays that see the world. Cycles stores the switches."""

    bl_label = "Ray Visibility"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and hasattr(context.world, "cycles_visibility")

    def draw(self, context: Any) -> None:
        kinds = ("camera", "diffuse", "glossy", "transmission", "scatter")
        rows(self.column(), context.world.cycles_visibility, *kinds)


class HALFSPACE_PT_world_settings(_WorldPanel, bpy.types.Panel):
    """Limits of light samples of the world. Cycles stores the settings."""

    bl_label = "Settings"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and hasattr(context.world, "cycles")

    def draw(self, context: Any) -> None:
        column, cycles = self.column(), context.world.cycles
        column.prop(cycles, "max_bounces")
        if "use_shadows" in cycles.bl_rna.properties:  # since Blender 5.2
            column.prop(cycles, "use_shadows")


class HALFSPACE_PT_visibility(EnginePanel, bpy.types.Panel):
    """Where an object appears."""

    bl_label = "Visibility"
    bl_context = "object"
    bl_options = {"DEFAULT_CLOSED"}
    block = "object"

    def draw(self, context: Any) -> None:
        column = self.column()
        item = context.object
        column.prop(item, "hide_select", text="Selectable", invert_checkbox=True, toggle=False)
        if "hide_surface_pick" in item.bl_rna.properties:  # since Blender 5.0
            column.prop(item, "hide_surface_pick", text="Surface Picking", invert_checkbox=True, toggle=False)
        shown = column.column(heading="Show In")
        shown.prop(item, "hide_viewport", text="Viewports", invert_checkbox=True, toggle=False)
        shown.prop(item, "hide_render", text="Renders", invert_checkbox=True, toggle=False)
        if item.type in SOLID:
            rows(column.column(heading="Mask"), item, "is_shadow_catcher", "is_holdout")
            column.prop(item, "shadow_terminator_geometry_offset", text="Shadow Terminator")
        if (cycles := getattr(item, "cycles", None)) is not None:
            motion = column.column(heading="Motion Blur")
            rows(motion, cycles, use_motion_blur="Motion", use_deform_motion="Deformation")
            rows(column.column(heading="Culling"), cycles, "use_camera_cull", "use_distance_cull")


class HALFSPACE_PT_ray_visibility(EnginePanel, bpy.types.Panel):
    """The rays that see an object, a light or a collection's instances."""

    bl_label = "Ray Visibility"
    bl_parent_id = "HALFSPACE_PT_visibility"
    bl_context = "object"
    block = "object"

    @classmethod
    def poll(cls, context: Any) -> bool:
        if not super().poll(context):
            return False
        item = context.object
        return item.type in SEEN or (item.instance_type == "COLLECTION" and item.instance_collection)

    def draw(self, context: Any) -> None:
        column = self.column()
        for ray in ("camera", "diffuse", "glossy", "transmission"):
            column.prop(context.object, f"visible_{ray}", text=ray.capitalize())
        column.prop(context.object, "visible_volume_scatter", text="Volume Scatter")
        if context.object.type != "LIGHT":
            column.prop(context.object, "visible_shadow", text="Shadow")


class _MaterialPanel(EnginePanel):
    bl_context = "material"
    block = "material"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and not context.material.grease_pencil


class HALFSPACE_PT_material(_MaterialPanel, bpy.types.Panel):
    """The inputs of the material's shader."""

    bl_label = "Surface"

    def draw(self, context: Any) -> None:
        _surface(self.layout, context.material, "diffuse_color")


class _NodesPanel(_MaterialPanel):
    """The inputs of a socket of the material's output."""

    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and active_tree(context.material) is not None

    def draw(self, context: Any) -> None:
        _inputs(self.layout, context.material, self.bl_label)  # type: ignore[attr-defined]


class HALFSPACE_PT_material_volume(_NodesPanel, bpy.types.Panel):
    """The inputs of the material's volume shader."""

    bl_label = "Volume"


class HALFSPACE_PT_material_displacement(_NodesPanel, bpy.types.Panel):
    """The inputs of the material's displacement."""

    bl_label = "Displacement"


class HALFSPACE_PT_material_settings(_MaterialPanel, bpy.types.Panel):
    """The number of the material in its pass, and how it displaces."""

    bl_label = "Settings"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        column = self.column()
        column.prop(context.material, "pass_index")
        column.prop(context.material, "displacement_method", text="Displacement")
        column.prop(context.material, "use_transparent_shadow")


class _LightPanel(EnginePanel):
    bl_context = "data"
    block = "light"


class HALFSPACE_PT_light(_LightPanel, bpy.types.Panel):
    """Colour, power and size of a light."""

    bl_label = "Light"

    def draw(self, context: Any) -> None:
        light = context.light
        self.layout.row().prop(light, "type", expand=True)
        column = self.column()
        switched(column, light, "use_temperature", "temperature", "Temperature")
        column.prop(light, "color", text="Tint" if light.use_temperature else "Color")
        column.separator()
        rows(column, light, "energy", "exposure", "normalize")
        column.separator()
        _shape(column, light)
        column.separator()
        column.prop(light, "use_shadow", text="Cast Shadow")
        if hasattr(light, "cycles"):
            column.prop(light.cycles, "max_bounces")


class HALFSPACE_PT_light_beam_shape(_LightPanel, bpy.types.Panel):
    """The cone of a spot light, or those of the points of an area light."""

    bl_label = "Beam Shape"
    bl_parent_id = "HALFSPACE_PT_light"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and context.light.type in ("SPOT", "AREA")

    def draw(self, context: Any) -> None:
        column = self.column()
        if context.light.type == "AREA":
            column.prop(context.light, "spread", text="Spread")
            return
        column.prop(context.light, "spot_size", text="Angle")
        column.prop(context.light, "spot_blend", text="Blend", slider=True)
        column.prop(context.light, "show_cone")


class HALFSPACE_PT_light_nodes(_LightPanel, bpy.types.Panel):
    """The light's own nodes: an Emission node scales its power."""

    bl_label = "Nodes"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        _surface(self.layout, context.light, "")


def _shape(column: Any, light: Any) -> None:
    """Draw the size of a light."""
    match light.type:
        case "POINT" | "SPOT":
            column.prop(light, "shadow_soft_size", text="Radius")
            column.prop(light, "use_soft_falloff")
        case "SUN":
            column.prop(light, "angle")
        case "AREA":
            column.prop(light, "shape", text="Shape")
            sizes = column.column(align=True)
            if light.shape in ("RECTANGLE", "ELLIPSE"):
                rows(sizes, light, size="Size X", size_y="Y")
            else:
                sizes.prop(light, "size")


def _surface(layout: Any, block: Any, plain: str) -> None:
    """Draw the inputs of the shader at the output of a material, world or light.

    plain: the property of its colour without nodes, "" if another panel shows it.
    """
    layout.use_property_split = True
    if bpy.app.version < (5, 0):  # since then nodes are always used
        layout.prop(block, "use_nodes", icon="NODETREE")
    if not _inputs(layout, block, "Surface") and plain:
        layout.prop(block, plain)


def _inputs(layout: Any, block: Any, socket: str) -> bool:
    """Draw the nodes at a socket of the output of a material, world or light. Returns whether it has an output."""
    layout.use_property_split = True
    tree = active_tree(block)
    output = output_node(tree) if tree is not None else None
    if output is None:
        return False
    layout.template_node_view(tree, output, output.inputs[socket])
    return True


CLASSES = registered(globals())
