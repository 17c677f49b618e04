# SPDX-License-Identifier: GPL-3.0-or-later
"""What each surface shader node means as one `core.scene.Material` of constant values."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

from ..core.scene import Material
from .nodes import Place, Remark, Unsupported, color, number, scaled

BLACK = Material("", base_color=(0.0, 0.0, 0.0), specular=0.0, roughness=1.0)
"""No surface shader at all: absorbs everything, emits nothing."""

IGNORED_LAYERS = {
    "Subsurface Weight": 0.0,
    "Coat Weight": 0.0,
    "Sheen Weight": 0.0,
    "Anisotropic": 0.0,
    "Thin Film Thickness": 0.0,
    "Diffuse Roughness": 0.0,
}
"""Inputs of the Principled BSDF that are not rendered, with the value at which they do nothing."""


@dataclass(frozen=True)
class Context:
    """What every node needs: the material as shown in the viewport, as last resort, and where remarks go."""

    viewport: Material
    remark: Remark


def surface(place: Place, context: Context) -> Material:
    """The material that an input of the shader kind receives. Raises Unsupported, naming the node."""
    source = place.source()
    if not source.socket.is_output:
        return replace(BLACK, name=context.viewport.name)
    meaning = SHADERS.get(source.node.bl_idname)
    if meaning is None:
        raise Unsupported(source.node.bl_label)
    return replace(meaning(source, context), name=context.viewport.name)


def _principled(node: Place, context: Context) -> Material:
    for name, idle in IGNORED_LAYERS.items():
        layer = node.input(name)
        if layer is not None and (layer.socket.is_linked or abs(layer.socket.default_value - idle) > 1e-6):
            context.remark(f"Principled BSDF: {name}")
    _bumps(node, context)
    strength = number(node.input("Emission Strength"), context.remark)
    emission = color(node.input("Emission Color"), context.remark) if strength else (0.0, 0.0, 0.0)
    return Material(
        "",
        base_color=color(node.input("Base Color"), context.remark, context.viewport.base_color),
        metallic=number(node.input("Metallic"), context.remark),
        roughness=number(node.input("Roughness"), context.remark),
        ior=number(node.input("IOR"), context.remark),
        transmission=number(node.input("Transmission Weight"), context.remark),
        specular=number(node.input("Specular IOR Level"), context.remark),
        emission=scaled(emission, strength),
        alpha=number(node.input("Alpha"), context.remark, absent=1.0),
    )


def _diffuse(node: Place, context: Context) -> Material:
    _bumps(node, context)
    return replace(BLACK, base_color=_color(node, context))


def _glossy(node: Place, context: Context) -> Material:
    _bumps(node, context)
    roughness = number(node.input("Roughness"), context.remark)
    return replace(BLACK, base_color=_color(node, context), metallic=1.0, roughness=roughness, specular=0.5)


def _glass(node: Place, context: Context) -> Material:
    _bumps(node, context)
    roughness = number(node.input("Roughness"), context.remark)
    ior = number(node.input("IOR"), context.remark)
    return replace(
        BLACK, base_color=_color(node, context), transmission=1.0, roughness=roughness, ior=ior, specular=0.5
    )


def _emission(node: Place, context: Context) -> Material:
    strength = number(node.input("Strength"), context.remark)
    return replace(BLACK, emission=scaled(_color(node, context), strength))


def _transparent(node: Place, context: Context) -> Material:
    tint = _color(node, context)
    if min(tint) < 0.999:
        context.remark("Transparent BSDF: coloured transparency")
    return replace(BLACK, alpha=0.0)


def _mix(node: Place, context: Context) -> Material:
    factor_socket, first, second = (Place(socket, node.groups) for socket in node.node.inputs[:3])
    factor = min(max(number(factor_socket, context.remark), 0.0), 1.0)
    return blend(surface(first, context), surface(second, context), factor)


def _add(node: Place, context: Context) -> Material:
    first, second = (surface(Place(socket, node.groups), context) for socket in node.node.inputs[:2])
    emission = tuple(a + b for a, b in zip(first.emission, second.emission, strict=True))
    # An emitter adds light to a surface; two surfaces would reflect more than they receive.
    if _only_emits(first):
        return replace(second, emission=emission)
    if not _only_emits(second):
        context.remark("Add Shader of two surfaces (the first one is rendered)")
    return replace(first, emission=emission)


SHADERS: dict[str, Callable[[Place, Context], Material]] = {
    "ShaderNodeBsdfPrincipled": _principled,
    "ShaderNodeBsdfDiffuse": _diffuse,
    "ShaderNodeBsdfAnisotropic": _glossy,
    "ShaderNodeBsdfGlossy": _glossy,
    "ShaderNodeBsdfMetallic": _glossy,
    "ShaderNodeBsdfGlass": _glass,
    "ShaderNodeEmission": _emission,
    "ShaderNodeBsdfTransparent": _transparent,
    "ShaderNodeMixShader": _mix,
    "ShaderNodeAddShader": _add,
}


def blend(first: Material, second: Material, factor: float) -> Material:
    """The material `factor` of the way from the first to the second, value by value.

    Exact for the ends, and for colours and emission of equal shaders; otherwise the nearest single material. What is
    invisible has no say in the look: beside a transparent shader only `alpha` is blended.
    """
    if factor in (0.0, 1.0):
        return second if factor else first
    alpha = first.alpha + (second.alpha - first.alpha) * factor
    if first.alpha == 0.0 or second.alpha == 0.0:
        return replace(second if first.alpha == 0.0 else first, alpha=alpha)
    values: dict[str, object] = {}
    for name in (field.name for field in fields(Material) if field.name != "name"):
        a, b = getattr(first, name), getattr(second, name)
        if isinstance(a, tuple):
            values[name] = tuple(x + (y - x) * factor for x, y in zip(a, b, strict=True))
        else:
            values[name] = a + (b - a) * factor
    return Material(first.name, **values)  # type: ignore[arg-type]


def _color(node: Place, context: Context) -> tuple[float, float, float]:
    place = node.input("Color") or node.input("Base Color")
    return color(place, context.remark, context.viewport.base_color)


def _bumps(node: Place, context: Context) -> None:
    normal = node.input("Normal")
    if normal is not None and normal.source().socket.is_output:
        context.remark(f"{normal.source().node.bl_label} for Normal")


def _only_emits(material: Material) -> bool:
    return max(material.base_color) == 0.0 and material.specular == 0.0 and material.alpha == 1.0
