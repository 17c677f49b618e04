# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of the nodes whose result depends on their inputs only: numbers, vectors, colours."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from mathutils import Euler, Matrix, Vector

from ..nodes import Place, Unsupported

if TYPE_CHECKING:
    from ....core.scene.scene import Operand
    from ..values import Values


TABLE = 256
"""Entries of a colour ramp or curve, as in Cycles."""


def _mix(values: Values, node: Place) -> Operand:
    item = node.node
    kind = item.data_type
    names = {"FLOAT": "Float", "VECTOR": "Vector", "RGBA": "Color"}
    if kind not in names:
        raise Unsupported(f"Mix ({kind.lower()})")
    # Select the sockets of the data type by their identifiers.
    sockets = {socket.identifier: node.beside(socket) for socket in item.inputs}
    uneven = kind == "VECTOR" and item.factor_mode == "NON_UNIFORM"
    factor = values.value(sockets["Factor_Vector" if uneven else "Factor_Float"])
    a, b = (values.value(sockets[f"{side}_{names[kind]}"]) for side in "AB")
    if uneven:
        if item.clamp_factor:
            factor = values.step("vector_math", factor, (0.0,) * 3, 0.0, kind="MAXIMUM")
            factor = values.step("vector_math", factor, (1.0,) * 3, 0.0, kind="MINIMUM")
        return values.step(
            "vector_math", values.step("vector_math", b, a, 0.0, kind="SUBTRACT"), factor, a, kind="MULTIPLY_ADD"
        )
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


def _vector_math(values: Values, node: Place) -> Operand:
    item = node.node
    args = [values.input(node, i) for i in range(3)]
    if item.operation == "SCALE":
        args[1] = values.input(node, "Scale")
    elif item.operation == "REFRACT":
        args[2] = values.input(node, "Scale")
    return values.step("vector_math", *args, kind=item.operation)


def _ramp(values: Values, node: Place) -> Operand:
    ramp = node.node.color_ramp
    table = [tuple(ramp.evaluate(i / (TABLE - 1))) for i in range(TABLE)]
    factor = values.input(node, 0)
    rgba = values.step("ramp", factor, table=table, smooth=ramp.interpolation != "CONSTANT")
    return values.step("alpha", rgba) if node.socket.name == "Alpha" else rgba


def _table(mapping: Any, curves: Sequence[Any], combined: Any = None) -> tuple[list[tuple[float, ...]], float, float]:
    """The values of three curves over their common range, and the ends of that range, as in Cycles."""
    mapping.initialize()
    points = [curve.points for curve in (*curves, *([] if combined is None else [combined]))]
    low = min(float(row[0].location[0]) for row in points)
    high = max(float(row[-1].location[0]) for row in points)
    high = high if high > low else low + 1.0

    def at(curve: Any, x: float) -> float:
        return float(mapping.evaluate(curve, x if combined is None else mapping.evaluate(combined, x)))

    return [(*(at(curve, float(x)) for curve in curves), 1.0) for x in np.linspace(low, high, TABLE)], low, high


def _mapped(values: Values, node: Place, value: Operand, curves: Sequence[Any], combined: Any = None) -> Operand:
    """A value through three curves, blended in by the node's factor."""
    mapping = node.node.mapping
    table, low, high = _table(mapping, curves, combined)
    place = value
    # Tables begin at 0 and end at 1.
    if (low, high) != (0.0, 1.0):
        scale = (1.0 / (high - low),) * 3
        place = values.step("vector_math", value, scale, (-low / (high - low),) * 3, kind="MULTIPLY_ADD")
    mapped = values.step("curves", place, 1.0, table=table, extend=mapping.extend == "EXTRAPOLATED")
    return values.step("mix", values.input(node, 0, 1.0), value, mapped, kind="MIX", clamp_factor=False)


def _curves(values: Values, node: Place) -> Operand:
    curves = node.node.mapping.curves
    return _mapped(values, node, values.input(node, "Color"), curves[:3], curves[3])


def _vector_curves(values: Values, node: Place) -> Operand:
    return _mapped(values, node, values.input(node, "Vector"), node.node.mapping.curves[:3])


def _float_curve(values: Values, node: Place) -> Operand:
    return _mapped(values, node, values.input(node, "Value"), [node.node.mapping.curves[0]] * 3)


def _mapping(values: Values, node: Place) -> Operand:
    kind, vector = node.node.vector_type, values.input(node, "Vector")
    shift, rotation = (values.input(node, name, (0.0, 0.0, 0.0)) for name in ("Location", "Rotation"))
    scale = values.input(node, "Scale")
    if any(isinstance(part, int) for part in (shift, rotation, scale)):
        return _computed_mapping(values, kind, vector, (shift, rotation, scale))
    # Compose the matrix in Blender's order for each kind of mapping.
    place, turn, size = (
        Vector(part[:3] if isinstance(part, tuple) else (part,) * 3) for part in (shift, rotation, scale)
    )
    turned = Euler(turn).to_matrix().to_4x4()
    grown = Matrix.Diagonal((*size, 1))
    shrunk = Matrix.Diagonal((*(1 / factor if factor else 0.0 for factor in size), 1))
    moved = Matrix.Translation(place)
    match kind:
        case "POINT":
            matrix = moved @ turned @ grown
        case "TEXTURE":
            matrix = shrunk @ (moved @ turned).inverted()
        case "VECTOR":
            matrix = turned @ grown
        case _:
            matrix = turned @ shrunk
    mapped = values.step("matrix", vector, matrix=[list(row) for row in matrix[:3]])
    return values.step("unit", mapped) if kind == "NORMAL" else mapped


def _computed_mapping(values: Values, kind: str, vector: Operand, parts: tuple[Operand, Operand, Operand]) -> Operand:
    """A mapping whose location, rotation or scale is computed."""
    shift, rotation, scale = parts

    def math(operation: str, a: Operand, b: Operand) -> Operand:
        return values.step("vector_math", a, b, 0.0, kind=operation)

    def turned(v: Operand, *, inverse: bool = False) -> Operand:
        return values.step("rotate_euler", v, 0.0, rotation, inverse=inverse)

    match kind:
        case "POINT":
            return math("ADD", turned(math("MULTIPLY", vector, scale)), shift)
        case "TEXTURE":
            return math("DIVIDE", turned(math("SUBTRACT", vector, shift), inverse=True), scale)
        case "VECTOR":
            return turned(math("MULTIPLY", vector, scale))
    return values.step("unit", turned(math("DIVIDE", vector, scale)))


def _vector_rotate(values: Values, node: Place) -> Operand:
    item = node.node
    vector, center = values.input(node, "Vector"), values.input(node, "Center")
    if item.rotation_type == "EULER_XYZ":
        return values.step("rotate_euler", vector, center, values.input(node, "Rotation"), inverse=item.invert)
    axes = {"X_AXIS": (1.0, 0.0, 0.0), "Y_AXIS": (0.0, 1.0, 0.0), "Z_AXIS": (0.0, 0.0, 1.0)}
    axis = axes.get(item.rotation_type)
    angle = values.input(node, "Angle")
    if item.invert:
        angle = values.step("math", angle, -1.0, 0.0, kind="MULTIPLY")
    return values.step("rotate_axis", vector, center, values.input(node, "Axis") if axis is None else axis, angle)


def _separate(values: Values, node: Place) -> Operand:
    item = node.node
    color, mode = values.input(node, 0), getattr(item, "mode", "RGB")
    if mode != "RGB":
        color = values.step("convert", color, model=mode)
    return values.step("channel", color, channel=list(item.outputs).index(node.socket))


def _combine(values: Values, node: Place) -> Operand:
    color, mode = values.step("combine", *(values.input(node, i) for i in range(3))), getattr(node.node, "mode", "RGB")
    return color if mode == "RGB" else values.step("convert", color, model=mode, inverse=True)


def _map_range(values: Values, node: Place) -> Operand:
    item = node.node
    vectors = item.data_type == "FLOAT_VECTOR"
    sockets = {socket.identifier: node.beside(socket) for socket in item.inputs}
    names = ["From Min", "From Max", "To Min", "To Max", "Steps"]
    if vectors:
        args = [values.value(sockets[f"{name.replace(' ', '_')}_FLOAT3"]) for name in names]
    else:
        args = [values.value(sockets[name]) for name in names]
    first = values.value(sockets["Vector" if vectors else "Value"])
    op = "map_range_vector" if vectors else "map_range"
    return values.step(op, first, *args, kind=item.interpolation_type, clamp=item.clamp)


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


def _squeeze(values: Values, node: Place) -> Operand:
    """A logistic curve around a centre, which EEVEE has and Cycles leaves out."""
    value, width, center = (values.input(node, name) for name in ("Value", "Width", "Center"))

    def math(operation: str, a: Operand, b: Operand) -> Operand:
        return values.step("math", a, b, 0.0, kind=operation)

    # Beyond these bounds the curve is 0 or 1 in f32.
    away = values.step("clamp", math("MULTIPLY", math("SUBTRACT", center, value), width), -80.0, 80.0)
    return math("DIVIDE", 1.0, math("ADD", math("EXPONENT", away, 0.0), 1.0))


def _simple(op: str, *names: str | int) -> Callable[[Values, Place], Operand]:
    return lambda values, node: values.step(op, *(values.input(node, name) for name in names))


NUMBERS: dict[str, Callable[[Values, Place], Operand]] = {
    "ShaderNodeMix": _mix,
    "ShaderNodeMixRGB": _mix_rgb,
    "ShaderNodeMath": _math,
    "ShaderNodeVectorMath": _vector_math,
    "ShaderNodeValToRGB": _ramp,
    "ShaderNodeRGBCurve": _curves,
    "ShaderNodeVectorCurve": _vector_curves,
    "ShaderNodeFloatCurve": _float_curve,
    "ShaderNodeMapping": _mapping,
    "ShaderNodeVectorRotate": _vector_rotate,
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
    "ShaderNodeSqueeze": _squeeze,
    "ShaderNodeFresnel": _simple("fresnel", "IOR"),
    "ShaderNodeBlackbody": _simple("blackbody", 0),
    "ShaderNodeWavelength": _simple("wavelength", 0),
}
"""Nodes by their type, in the form of `value_nodes.NODES`."""
