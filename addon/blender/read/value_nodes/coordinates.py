# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of the nodes that read the shaded point, its object, the ray and the camera."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..nodes import Place, Unsupported
from ..object_values import PARTICLE, PLACE
from .sockets import COLOR, ISLAND, POINTINESS, TANGENT, UV

if TYPE_CHECKING:
    from ....core.scene.scene import Operand
    from ..values import Values


_COORDINATES = {
    "Generated": "generated",
    "Object": "object",
    "Normal": "object_normal",
    "Reflection": "reflection",
    "Camera": "camera",
    "Window": "window",
}

_GEOMETRY = {
    "Position": "position",
    "Normal": "normal",
    "Tangent": "tangent_z",
    "True Normal": "true_normal",
    "Incoming": "incoming",
    "Parametric": "parametric",
    "Backfacing": "backfacing",
}

_RAYS = {
    "Is Camera Ray": "camera_ray",
    "Is Shadow Ray": "shadow_ray",
    "Is Diffuse Ray": "diffuse_ray",
    "Is Glossy Ray": "glossy_ray",
    "Is Transmission Ray": "transmission_ray",
    "Is Reflection Ray": "reflection_ray",
    "Is Singular Ray": "singular_ray",
    "Is Volume Scatter Ray": "volume_ray",
    "Ray Length": "ray_length",
    "Ray Depth": "ray_depth",
    "Diffuse Depth": "diffuse_depth",
    "Glossy Depth": "glossy_depth",
    "Transparent Depth": "transparent_depth",
    "Transmission Depth": "transmission_depth",
    "Portal Depth": "portal_depth",
}


def _texture_coordinate(values: Values, node: Place) -> Operand:
    name, other = node.socket.name, getattr(node.node, "object", None)
    if name == "Object" and other is not None:
        return values.object_space(other)
    if values.background:
        if name == "UV":
            return (0.0, 0.0, 0.0)
        if name in ("Camera", "Window"):
            raise Unsupported(f"Texture Coordinate: {name}")
        return values.coordinate("generated" if name in ("Generated", "Object") else _COORDINATES[name])
    if getattr(node.node, "from_instancer", False) and name in ("Generated", "UV"):
        return values.of_object(PLACE, name)
    return values.layer(UV, "") if name == "UV" else values.coordinate(_COORDINATES[name])


def _geometry(values: Values, node: Place) -> Operand:
    layer = {"Random Per Island": ISLAND, "Pointiness": POINTINESS}.get(node.socket.name)
    if layer is not None and values.background:
        raise Unsupported(f"Geometry: {node.socket.name}")
    if layer is not None:
        return values.layer(layer, "")
    return values.coordinate(_GEOMETRY[node.socket.name])


def _light_path(values: Values, node: Place) -> Operand:
    if node.socket.name not in _RAYS:
        raise Unsupported(f"Light Path: {node.socket.name}")
    return values.coordinate(_RAYS[node.socket.name])


def _color_attribute(values: Values, node: Place) -> Operand:
    rgba = values.layer(COLOR, node.node.layer_name)
    return values.step("alpha", rgba) if node.socket.name == "Alpha" else rgba


def _volume_info(values: Values, node: Place) -> Operand:
    return values.grid(node.socket.name.lower(), 0.0)


def _attribute(values: Values, node: Place) -> Operand:
    item = node.node
    match item.attribute_type:
        case "GEOMETRY":
            rgba: Operand = values.layer(COLOR, item.attribute_name)
        case "VIEW_LAYER":
            rgba = values.of_view_layer(item.attribute_name)
        case kind:
            rgba = values.of_object(kind, item.attribute_name)
    match node.socket.name:
        case "Alpha":
            return values.step("alpha", rgba)
        case "Fac" | "Factor":
            return values.step("mean", rgba)
    return rgba


def _object_info(values: Values, node: Place) -> Operand:
    name = node.socket.name
    if name == "Material Index":
        return values.material_index
    value = values.of_object("INFO", "Color" if name == "Alpha" else name)
    return values.step("alpha", value) if name == "Alpha" else value


def _particle_info(values: Values, node: Place) -> Operand:
    value = values.of_object(PARTICLE, node.socket.name)
    return value if node.socket.type == "VECTOR" else values.step("mean", value)


def _camera_data(values: Values, node: Place) -> Operand:
    kinds = {"View Vector": "view_vector", "View Z Depth": "view_depth", "View Distance": "view_distance"}
    if values.background:
        raise Unsupported("Camera Data of a world")
    return values.coordinate(kinds[node.socket.name])


def _vector_transform(values: Values, node: Place) -> Operand:
    item, vector = node.node, values.input(node, "Vector")
    spaces = {"from": item.convert_from, "to": item.convert_to}
    if values.background and len(set(spaces.values())) > 1:
        raise Unsupported("Vector Transform of a world")
    values.layers.objects |= "OBJECT" in spaces.values()
    return values.step("transform", vector, vector=item.vector_type, **spaces)


def _wireframe(values: Values, node: Place) -> Operand:
    if values.background:
        return 0.0
    return values.step("wireframe", values.input(node, "Size"), pixels=node.node.use_pixel_size)


def _tangent(values: Values, node: Place) -> Operand:
    item = node.node
    if item.direction_type == "RADIAL":
        return values.coordinate(f"tangent_{item.axis.lower()}")
    # The tangent of a UV map, perpendicular to the shading normal. As in Cycles it is transformed like a normal.
    raw, normal = values.layer(TANGENT, item.uv_map), values.coordinate("normal")
    values.layers.objects = True
    along = values.step("transform", raw, vector="NORMAL", **{"from": "OBJECT", "to": "WORLD"})
    side = values.step("unit", values.step("vector_math", along, normal, 0.0, kind="CROSS_PRODUCT"))
    return values.step("unit", values.step("vector_math", normal, side, 0.0, kind="CROSS_PRODUCT"))


COORDINATES = {
    "ShaderNodeTexCoord": _texture_coordinate,
    "ShaderNodeUVMap": lambda values, node: values.layer(UV, node.node.uv_map),
    "ShaderNodeNewGeometry": _geometry,
    "ShaderNodeLightPath": _light_path,
    "ShaderNodeVertexColor": _color_attribute,
    "ShaderNodeAttribute": _attribute,
    "ShaderNodeVolumeInfo": _volume_info,
    "ShaderNodeObjectInfo": _object_info,
    "ShaderNodeParticleInfo": _particle_info,
    "ShaderNodeCameraData": _camera_data,
    "ShaderNodeVectorTransform": _vector_transform,
    "ShaderNodeTangent": _tangent,
    "ShaderNodeWireframe": _wireframe,
}
"""Nodes by their type, in the form of `value_nodes.NODES`."""
