# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of the value nodes of shader trees: a function in NODES writes the steps of one of a node's outputs."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from mathutils import Euler, Matrix, Vector

from . import sky
from .images import associated
from .nodes import Place, Unsupported
from .textures import TEXTURES

if TYPE_CHECKING:
    from ...core.scene.scene import Operand
    from .values import Values

TABLE = 256
"""Entries of a colour ramp or curve, as in Cycles."""

FILTER_WIDTH = 0.1
"""Pixels between the heights of a bump in versions of Blender without that input."""

UV, COLOR, TANGENT = "uv", "color", "tangent"
"""Kinds of layers: a UV map, a colour attribute, the tangents of a UV map. The name "" is the active one."""


def is_constant(operand: Operand, value: float) -> bool:
    """Whether an operand is this number; an integer is the index of a step, also 0 and 1."""
    return isinstance(operand, float) and operand == value


def constant(socket: Any) -> Operand:
    """The value of an unlinked socket."""
    value = getattr(socket, "default_value", 0.0)
    if isinstance(value, (int, float)):
        return float(value)
    if isinstance(value, str):
        return 0.0
    return tuple(float(x) for x in value)


def _image(values: Values, node: Place) -> Operand:
    item = node.node
    if item.image is None:
        rgba: Operand = (1.0, 0.0, 1.0, 1.0)  # the pink of Cycles, as for a missing image
    else:
        # Find the texture coordinates, by the kind of projection.
        panorama = item.bl_idname == "ShaderNodeTexEnvironment"
        if panorama:
            if item.projection != "EQUIRECTANGULAR":
                raise Unsupported(f"{item.bl_label} ({item.projection.replace('_', ' ').lower()})")
            place = node.input("Vector")
            linked = place is not None and place.source().socket.is_output
            fallback = "generated" if values.background else "position"
            where = values.value(place) if linked and place is not None else values.coordinate(fallback)
        else:
            if item.projection != "FLAT":
                raise Unsupported(f"{item.bl_label} ({item.projection.lower()} projection)")
            where = values.vector(node, "uv")
        if item.interpolation in ("Cubic", "Smart"):
            values.remark("Cubic interpolation of images (linear is used)")
        # Sample the image once for both outputs of the node.
        number = values.gallery.number(item.image)
        values.images.add(number)
        rgba = values.once(
            ("image", tuple(g.as_pointer() for g in node.groups), item.as_pointer()),
            lambda: values.step(
                "image",
                where,
                image=number,
                interpolation="closest" if item.interpolation == "Closest" else "linear",
                extension="repeat" if panorama else item.extension.lower(),
                unassociate="Alpha" in item.outputs and item.outputs["Alpha"].is_linked and associated(item.image),
                panorama=panorama,
            ),
        )
    return values.step("alpha", rgba) if node.socket.name == "Alpha" else rgba


def _sky(values: Values, node: Place) -> Operand:
    if not values.background:
        raise Unsupported("Sky Texture outside of the world")
    try:
        found = sky.of_node(node.node, wait=values.wait, keep_going=values.keep_going)
    except sky.SkyError as error:
        raise Unsupported(f"Sky Texture ({error})") from None
    where = values.step("unit", values.vector(node, "generated"))
    number = values.gallery.add("Sky Texture", found.pixels)
    values.images.add(number)
    rgb = values.step("image", where, image=number, interpolation="linear", extension="repeat", panorama=True)
    # Add the sun's disc: as a light of its own, or as a step that tests the direction.
    if found.sun is None:
        return rgb
    if values.sun_strength is not None:
        values.suns.append(found.light(values.sun_strength))
        return rgb
    away = values.step("vector_math", where, found.direction, 0.0, kind="DISTANCE")
    inside = values.step("math", away, 2 * math.sin(found.angle / 4), 0.0, kind="LESS_THAN")
    disc = values.step("vector_math", inside, found.sun, 0.0, kind="MULTIPLY")
    return values.step("vector_math", rgb, disc, 0.0, kind="ADD")


def _texture_coordinate(values: Values, node: Place) -> Operand:
    name = node.socket.name
    if values.background and name in ("Generated", "Object", "Camera", "Window", "UV"):
        if name in ("Camera", "Window", "UV"):
            raise Unsupported(f"Texture Coordinate: {name}")
        return values.coordinate("generated")
    match name:
        case "UV":
            return values.layer(UV, "")
        case "Generated" | "Object":
            if name == "Object" and getattr(node.node, "object", None) is not None:
                raise Unsupported("Texture Coordinate: Object of another object")
            return values.coordinate(name.lower())
        case "Normal":
            return values.coordinate("object_normal")
        case "Reflection":
            return values.coordinate("reflection")
    raise Unsupported(f"Texture Coordinate: {name}")


def _geometry(values: Values, node: Place) -> Operand:
    kinds = {
        "Position": "position",
        "Normal": "normal",
        "True Normal": "true_normal",
        "Incoming": "incoming",
        "Backfacing": "backfacing",
    }
    if node.socket.name not in kinds:
        raise Unsupported(f"Geometry: {node.socket.name}")
    return values.coordinate(kinds[node.socket.name])


def _light_path(values: Values, node: Place) -> Operand:
    kinds = {
        "Is Camera Ray": "camera_ray",
        "Is Shadow Ray": "shadow_ray",
        "Is Diffuse Ray": "diffuse_ray",
        "Is Glossy Ray": "glossy_ray",
        "Is Transmission Ray": "transmission_ray",
        "Is Reflection Ray": "glossy_ray",
    }
    if node.socket.name not in kinds:
        raise Unsupported(f"Light Path: {node.socket.name}")
    return values.coordinate(kinds[node.socket.name])


def _color_attribute(values: Values, node: Place) -> Operand:
    rgba = values.layer(COLOR, node.node.layer_name)
    return values.step("alpha", rgba) if node.socket.name == "Alpha" else rgba


def _attribute(values: Values, node: Place) -> Operand:
    item = node.node
    if item.attribute_type != "GEOMETRY":
        raise Unsupported(f"Attribute of type {item.attribute_type.lower()}")
    rgba = values.layer(COLOR, item.attribute_name)
    match node.socket.name:
        case "Alpha":
            return values.step("alpha", rgba)
        case "Fac" | "Factor":
            return values.step("mean", rgba)
    return rgba


def _mix(values: Values, node: Place) -> Operand:
    item = node.node
    kind = item.data_type
    names = {"FLOAT": "Float", "VECTOR": "Vector", "RGBA": "Color"}
    if kind not in names:
        raise Unsupported(f"Mix ({kind.lower()})")
    # Select the sockets of the data type by their identifiers.
    sockets = {socket.identifier: node.beside(socket) for socket in item.inputs}
    uneven = kind == "VECTOR" and item.factor_mode == "NON_UNIFORM"
    if uneven:
        raise Unsupported("Mix (vector, non-uniform)")
    factor = values.value(sockets["Factor_Float"])
    a, b = (values.value(sockets[f"{side}_{names[kind]}"]) for side in "AB")
    return values.step(
        "mix",
        factor,
        a,
        b,
        kind=item.blend_type if kind == "RGBA" else "MIX",
        clamp_factor=item.clamp_factor,
        clamp=kind == "RGBA" and item.clamp_result,
    )


def _mix_rgb(values: Values, node: Place) -> Operand:
    a = [values.input(node, i) for i in range(3)]
    return values.step("mix", *a, kind=node.node.blend_type, clamp=node.node.use_clamp)


def _math(values: Values, node: Place) -> Operand:
    args = [values.input(node, i) if i < len(node.node.inputs) else 0.0 for i in range(3)]
    return values.step("math", *args, kind=node.node.operation, clamp=node.node.use_clamp)


VECTOR_MATH = frozenset(
    [
        "ADD",
        "SUBTRACT",
        "MULTIPLY",
        "DIVIDE",
        "MULTIPLY_ADD",
        "CROSS_PRODUCT",
        "PROJECT",
        "REFLECT",
        "DOT_PRODUCT",
        "DISTANCE",
        "LENGTH",
        "SCALE",
        "NORMALIZE",
        "ABSOLUTE",
        "MINIMUM",
        "MAXIMUM",
        "FLOOR",
        "CEIL",
        "FRACTION",
        "MODULO",
        "SINE",
        "COSINE",
        "TANGENT",
    ]
)


def _vector_math(values: Values, node: Place) -> Operand:
    item = node.node
    if item.operation not in VECTOR_MATH:
        raise Unsupported(f"Vector Math ({item.operation.replace('_', ' ').lower()})")
    args = [values.input(node, i) for i in range(3)]
    if item.operation == "SCALE":
        args[1] = values.input(node, "Scale")
    return values.step("vector_math", *args, kind=item.operation)


def _ramp(values: Values, node: Place) -> Operand:
    ramp = node.node.color_ramp
    table = [tuple(ramp.evaluate(i / (TABLE - 1))) for i in range(TABLE)]
    factor = values.input(node, 0)
    rgba = values.step("ramp", factor, table=table, smooth=ramp.interpolation != "CONSTANT")
    return values.step("alpha", rgba) if node.socket.name == "Alpha" else rgba


def _curves(values: Values, node: Place) -> Operand:
    mapping = node.node.mapping
    mapping.initialize()
    rgb, combined = mapping.curves[:3], mapping.curves[3]

    def at(curve: Any, x: float) -> float:
        return float(mapping.evaluate(curve, mapping.evaluate(combined, x)))

    places = np.linspace(0, 1, TABLE)
    table = [(*(at(curve, float(x)) for curve in rgb), 1.0) for x in places]
    return values.step("curves", values.input(node, "Color"), values.input(node, 0, 1.0), table=table)


def _float_curve(values: Values, node: Place) -> Operand:
    mapping = node.node.mapping
    mapping.initialize()
    table = [(*[float(mapping.evaluate(mapping.curves[0], i / (TABLE - 1)))] * 3, 1.0) for i in range(TABLE)]
    value, factor = values.input(node, "Value"), values.input(node, 0, 1.0)
    return values.step("mix", factor, value, values.step("ramp", value, table=table), kind="MIX")


def _mapping(values: Values, node: Place) -> Operand:
    kind = node.node.vector_type
    parts = {}
    for name in ("Location", "Rotation", "Scale"):
        place = node.input(name)
        if place is None:
            parts[name] = Vector((0, 0, 0))
        elif place.source().socket.is_output:
            raise Unsupported(f"Mapping with a linked {name}")
        else:
            value = values.value(place)
            parts[name] = Vector(value[:3] if isinstance(value, tuple) else (value,) * 3)
    # Compose the matrix in Blender's order for each kind of mapping.
    rotation = Euler(parts["Rotation"]).to_matrix().to_4x4()
    scale = Matrix.Diagonal((*parts["Scale"], 1))
    shrink = Matrix.Diagonal((*(1 / factor if factor else 0.0 for factor in parts["Scale"]), 1))
    shift = Matrix.Translation(parts["Location"])
    match kind:
        case "POINT":
            matrix = shift @ rotation @ scale
        case "TEXTURE":
            matrix = shrink @ (shift @ rotation).inverted()
        case "VECTOR":
            matrix = rotation @ scale
        case _:
            matrix = rotation @ shrink
    vector = values.input(node, "Vector")
    mapped = values.step("matrix", vector, matrix=[list(row) for row in matrix[:3]])
    return values.step("unit", mapped) if kind == "NORMAL" else mapped


def _separate(values: Values, node: Place) -> Operand:
    item = node.node
    if getattr(item, "mode", "RGB") != "RGB":
        raise Unsupported(f"{item.bl_label} ({item.mode})")
    channel = list(item.outputs).index(node.socket)
    return values.step("channel", values.input(node, 0), channel=channel)


def _combine(values: Values, node: Place) -> Operand:
    if getattr(node.node, "mode", "RGB") != "RGB":
        raise Unsupported(f"{node.node.bl_label} ({node.node.mode})")
    return values.step("combine", *(values.input(node, i) for i in range(3)))


def _map_range(values: Values, node: Place) -> Operand:
    item = node.node
    if item.data_type != "FLOAT" or item.interpolation_type == "STEPPED":
        raise Unsupported(f"Map Range ({item.data_type.lower()}, {item.interpolation_type.lower()})")
    args = [values.input(node, name) for name in ("Value", "From Min", "From Max", "To Min", "To Max")]
    return values.step("map_range", *args, kind=item.interpolation_type, clamp=item.clamp)


def _clamp(values: Values, node: Place) -> Operand:
    value, *ends = (values.input(node, i) for i in range(3))
    if node.node.clamp_type == "RANGE":  # the bounds may be in either order
        ends = [values.step("math", *ends, 0.0, kind=kind) for kind in ("MINIMUM", "MAXIMUM")]
    return values.step("clamp", value, *ends)


def _hue_saturation(values: Values, node: Place) -> Operand:
    factor = "Fac" if "Fac" in node.node.inputs else "Factor"
    return values.step(
        "hue_saturation", *(values.input(node, n) for n in ("Color", "Hue", "Saturation", "Value", factor))
    )


def _normal_map(values: Values, node: Place) -> Operand:
    item = node.node
    # Check this before reading its inputs: failures are not cached, and a chain of such nodes would double the reads at
    # each.
    if item.space not in ("TANGENT", "OBJECT", "WORLD"):
        raise Unsupported(f"Normal Map ({item.space.replace('_', ' ').lower()})")
    color, strength = values.input(node, "Color"), values.input(node, "Strength")
    if item.space == "TANGENT":
        layer = values.layers.number(TANGENT, item.uv_map)
        return values.step("normal_map", color, strength, layer=layer)
    values.layers.objects |= item.space == "OBJECT"
    return values.step("normal_map_space", color, strength, object=item.space == "OBJECT")


def _bump(values: Values, node: Place) -> Operand:
    if values.background or values.shifted:
        raise Unsupported("Bump within a height" if values.shifted else "Bump of a world")
    normal, height = node.input("Normal"), node.input("Height")
    linked = normal is not None and normal.source().socket.is_output
    base = values.value(normal) if linked and normal is not None else values.coordinate("normal")
    if height is None or not height.source().socket.is_output:
        return base
    # The heights at the point, and a small part of a pixel beside it.
    width = values.input(node, "Filter Width", FILTER_WIDTH)
    width = width if isinstance(width, float) and width > 0.0 else FILTER_WIDTH
    heights = [values.value(height)]
    for axis in "XY":
        with values.beside(axis, width):
            heights.append(values.value(height))
    strength, distance = values.input(node, "Strength", 1.0), values.input(node, "Distance", 1.0)
    return values.step("bump", *heights, strength, distance, base, width=width, invert=node.node.invert)


def _layer_weight(values: Values, node: Place) -> Operand:
    op = "layer_fresnel" if node.socket.name == "Fresnel" else "layer_facing"
    return values.step(op, values.input(node, "Blend"))


def _simple(op: str, *names: str | int) -> Callable[[Values, Place], Operand]:
    return lambda values, node: values.step(op, *(values.input(node, name) for name in names))


NODES: dict[str, Callable[[Values, Place], Operand]] = {
    **TEXTURES,
    "ShaderNodeRGB": lambda _, node: constant(node.socket),
    "ShaderNodeValue": lambda _, node: constant(node.socket),
    "ShaderNodeTexImage": _image,
    "ShaderNodeTexEnvironment": _image,
    "ShaderNodeTexSky": _sky,
    "ShaderNodeTexCoord": _texture_coordinate,
    "ShaderNodeUVMap": lambda values, node: values.layer(UV, node.node.uv_map),
    "ShaderNodeNewGeometry": _geometry,
    "ShaderNodeLightPath": _light_path,
    "ShaderNodeVertexColor": _color_attribute,
    "ShaderNodeAttribute": _attribute,
    "ShaderNodeMix": _mix,
    "ShaderNodeMixRGB": _mix_rgb,
    "ShaderNodeMath": _math,
    "ShaderNodeVectorMath": _vector_math,
    "ShaderNodeValToRGB": _ramp,
    "ShaderNodeRGBCurve": _curves,
    "ShaderNodeFloatCurve": _float_curve,
    "ShaderNodeMapping": _mapping,
    "ShaderNodeSeparateColor": _separate,
    "ShaderNodeSeparateXYZ": _separate,
    "ShaderNodeCombineColor": _combine,
    "ShaderNodeCombineXYZ": _combine,
    "ShaderNodeInvert": _simple("invert", 0, 1),
    "ShaderNodeGamma": _simple("gamma", 0, 1),
    "ShaderNodeBrightContrast": _simple("bright_contrast", 0, 1, 2),
    "ShaderNodeHueSaturation": _hue_saturation,
    "ShaderNodeRGBToBW": _simple("luminance", 0),
    "ShaderNodeMapRange": _map_range,
    "ShaderNodeClamp": _clamp,
    "ShaderNodeFresnel": _simple("fresnel", "IOR"),
    "ShaderNodeLayerWeight": _layer_weight,
    "ShaderNodeNormalMap": _normal_map,
    "ShaderNodeBump": _bump,
}
