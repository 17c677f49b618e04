# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of the shaders of hair, on tubes around hairs and on other surfaces."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..value_nodes import STRAND, is_constant

if TYPE_CHECKING:
    from ....core.scene.scene import Operand
    from ..nodes import Place
    from ..surfaces import Surface

LOBES = ("Reflection", "Transmission", "Secondary Reflection")
"""Factors of lobes that Huang's model has; they are 1 otherwise."""


def principled_hair(surface: Surface, node: Place, weight: Operand) -> None:
    """Convert a Principled Hair BSDF."""
    values, item = surface.values, node.node
    huang = getattr(item, "model", "CHIANG") == "HUANG"
    if huang:
        surface.remark(f"{item.bl_label}: Huang's model (rendered by Chiang's)")
        if any(not is_constant(values.input(node, lobe, 1.0), 1.0) for lobe in LOBES):
            surface.remark(f"{item.bl_label}: factors of single lobes")
    roughness = _randomised(surface, node, values.input(node, "Roughness"), "Random Roughness")
    radial = roughness
    if not huang:
        radial = _randomised(surface, node, values.input(node, "Radial Roughness"), "Random Roughness")
    pigments: dict[str, Operand]
    match item.parametrization:
        case "ABSORPTION":
            pigments = {"absorption": values.input(node, "Absorption Coefficient"), "color": 1.0}
        case "MELANIN":
            pigments = {
                "melanin": _randomised(surface, node, values.input(node, "Melanin"), "Random Color"),
                "redness": values.input(node, "Melanin Redness"),
                "color": values.input(node, "Tint"),
            }
        case _:
            pigments = {"color": surface.color(node)}
    surface.add(
        "hair",
        weight,
        node,
        roughness=roughness,
        radial_roughness=radial,
        coat_weight=0.0 if huang else values.input(node, "Coat"),
        ior=values.input(node, "IOR"),
        offset=values.input(node, "Offset"),
        tangent=_along(surface, "edge_u"),
        **pigments,
    )


def hair(surface: Surface, node: Place, weight: Operand) -> None:
    """Convert a Hair BSDF."""
    values = surface.values
    given = surface.vector(node, "Tangent")
    offset = values.input(node, "Offset")
    if given is None and not is_constant(offset, 0.0):
        # Without a tangent, other surfaces than hair have no offset, as in Cycles.
        offset = values.step("math", offset, _is_strand(surface), 0.0, kind="MULTIPLY")
    surface.add(
        "hair_transmission" if node.node.component == "Transmission" else "hair_reflection",
        weight,
        node,
        color=surface.color(node),
        roughness=values.input(node, "RoughnessU"),
        radial_roughness=values.input(node, "RoughnessV"),
        offset=offset,
        tangent=_along(surface, "edge_v") if given is None else given,
    )
    _is_strand(surface)


def _is_strand(surface: Surface) -> Operand:
    """1 on hair, 0 on other surfaces."""
    values = surface.values
    layer = values.layer(STRAND, "Is Strand")
    values.strands = values.layers.number(STRAND, "Is Strand")
    return values.step("mean", layer)


def _along(surface: Surface, edge: str) -> Operand:
    """The direction along the hair; on other surfaces an edge of the triangle, as in Cycles."""
    values = surface.values
    values.layers.objects = True
    raw = values.layer(STRAND, "Tangent")
    spaces = {"from": "OBJECT", "to": "WORLD"}
    tangent = values.step("transform", raw, vector="VECTOR", **spaces)
    return values.step("mix", _is_strand(surface), values.coordinate(edge), tangent, kind="MIX")


def _randomised(surface: Surface, node: Place, value: Operand, name: str) -> Operand:
    """A value multiplied by a random factor of each hair around 1, whose spread is the input `name`."""
    values = surface.values
    spread = values.input(node, name)
    if is_constant(spread, 0.0):
        return value
    place = node.input("Random")
    if place is not None and place.source() != place:
        random = values.value(place)
    else:
        random = values.step("mean", values.layer(STRAND, "Random"))
    about = values.step("math", random, 2.0, -1.0, kind="MULTIPLY_ADD")
    factor = values.step("math", about, spread, 1.0, kind="MULTIPLY_ADD")
    return values.step("math", value, factor, 0.0, kind="MULTIPLY")
