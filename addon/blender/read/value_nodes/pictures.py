# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of the nodes that read images and skies."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from .. import sky
from ..images import associated
from ..nodes import Place, Unsupported

if TYPE_CHECKING:
    from ....core.scene.scene import Operand
    from ..values import Values


INTERPOLATIONS = {"Linear": "linear", "Closest": "closest", "Cubic": "cubic", "Smart": "cubic"}
"""By the settings of nodes; Cycles renders smart interpolation as cubic."""

PROJECTIONS = {
    "FLAT": "flat",
    "BOX": "box",
    "SPHERE": "sphere",
    "TUBE": "tube",
    "EQUIRECTANGULAR": "panorama",
    "MIRROR_BALL": "mirror_ball",
}


def _image(values: Values, node: Place) -> Operand:
    item = node.node
    if item.image is None:
        rgba: Operand = (1.0, 0.0, 1.0, 1.0)  # the pink of Cycles, as for a missing image
        return values.step("alpha", rgba) if node.socket.name == "Alpha" else rgba
    # Find the vector, and for a box the normal that chooses its sides.
    around = item.bl_idname == "ShaderNodeTexEnvironment"
    settings: dict[str, Any] = {"projection": PROJECTIONS[item.projection]}
    if around:
        place = node.input("Vector")
        linked = place is not None and place.source().socket.is_output
        fallback = "generated" if values.background else "position"
        where = [values.value(place) if linked and place is not None else values.coordinate(fallback)]
    else:
        where = [values.vector(node, "uv")]
    if item.projection == "BOX":
        where.append(values.coordinate("normal" if values.background else "object_normal"))
        settings["blend"] = float(item.projection_blend)
    # Sample the image once for both outputs of the node.
    number = values.gallery.number(item.image, item.image_user)
    values.images.add(number)
    rgba = values.once(
        ("image", tuple(g.as_pointer() for g in node.groups), item.as_pointer()),
        lambda: values.step(
            "image",
            *where,
            image=number,
            interpolation=INTERPOLATIONS[item.interpolation],
            extension="repeat" if around else item.extension.lower(),
            unassociate="Alpha" in item.outputs and item.outputs["Alpha"].is_linked and associated(item.image),
            **settings,
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
    rgb = values.step("image", where, image=number, interpolation="linear", extension="repeat", projection="panorama")
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


PICTURES = {
    "ShaderNodeTexImage": _image,
    "ShaderNodeTexEnvironment": _image,
    "ShaderNodeTexSky": _sky,
}
"""Nodes by their type, in the form of `value_nodes.NODES`."""
