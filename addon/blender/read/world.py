# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of Blender's world to `core.scene.World`: a colour, or a program over the direction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ...core.scene.scene import Light, World
from .images import Gallery
from .lights import max_bounces
from .media.volumes import Volume, varies
from .nodes import Place, Unsupported, active_tree, output_node
from .surfaces import Surface
from .value_nodes import outputs
from .values import Layers, Values

if TYPE_CHECKING:
    from ...core.base.notes import Notes


MOST_RADIANCE = 1e20
"""Largest radiance of a world of one colour: beyond it numbers overflow."""

RAYS = {
    "camera": "camera",
    "diffuse": "diffuse",
    "glossy": "glossy",
    "transmission": "transmission",
    "volume": "scatter",
}
"""The kinds of rays that a world can be hidden from, with Cycles' settings."""


def read_world(
    world: Any,
    notes: Notes,
    gallery: Gallery | None = None,
    *,
    wait: bool = True,
    keep_going: Callable[[], bool] | None = None,
    wanted: outputs.Outputs | None = None,
) -> tuple[World, set[int], list[Light]]:
    """The background, the numbers of the images it uses, and those of its suns that are lights.

    wait: whether to wait for a Sky Texture. keep_going: polled meanwhile; if it returns False, raises Cancelled.
    wanted: the passes that worlds write.

    Unsupported nodes are noted in `notes` and replaced by their defaults.
    """
    found, images, suns = _read(world, notes, gallery, wait, keep_going, wanted or {})
    # Cycles stores these with the world, if it is enabled.
    flags = getattr(world, "cycles_visibility", None)
    hidden = tuple(ray for ray, flag in RAYS.items() if not getattr(flags, flag, True))
    suns = [replace(sun, hidden_from=hidden) for sun in suns]
    found = replace(found, hidden_from=hidden)
    # A world that Cycles does not sample has no light samples that these concern.
    cycles = getattr(world, "cycles", None)
    if getattr(cycles, "sampling_method", "NONE") != "NONE":
        found = replace(found, max_bounces=max_bounces(world), casts_shadow=getattr(cycles, "use_shadows", True))
    return found, images, suns


def _read(
    world: Any,
    notes: Notes,
    gallery: Gallery | None,
    wait: bool,
    keep_going: Callable[[], bool] | None,
    wanted: outputs.Outputs,
) -> tuple[World, set[int], list[Light]]:
    nothing: tuple[set[int], list[Light]] = (set(), [])
    if world is None:
        return World(), *nothing
    plain = World(_rgb(world.color))
    tree = active_tree(world)
    if tree is None:
        return plain, *nothing

    def remark(what: str) -> None:
        notes.add(f"{what} is not supported yet in world", world.name)

    # Read the surface; everything unsupported leaves the plain colour.
    output = output_node(tree)
    if output is None:
        return World(), *nothing
    values = Values(Layers(), gallery or Gallery(), remark, background=True, wait=wait, keep_going=keep_going)
    surface = Surface(values, plain.color)
    volume = _volume(output, values)
    values.sun_strength = _sky_strength(output)
    try:
        surface.read(Place(output.inputs["Surface"]))
        total = surface.total()
    except Unsupported as unsupported:
        remark(str(unsupported))
        return replace(plain, volume=volume), *nothing
    # Turn a constant sum into a colour, and keep a program otherwise.
    written = outputs.read(tree, values, wanted) if wanted else ()
    program = tuple(values.steps) if written or isinstance(total, int) else ()
    shown = World(program=program, outputs=written, volume=volume)
    if isinstance(total, int):
        shown = replace(shown, radiance=total)
    elif total is not None:
        color = _rgb(total)
        limited = tuple(min(max(c, -MOST_RADIANCE), MOST_RADIANCE) for c in color)
        if limited != color:
            notes.add("A radiance that is too large is limited, of world", world.name)
        shown = replace(shown, color=_rgb(limited))
    return shown, values.images, values.suns


def _volume(output: Any, values: Values) -> Any:
    """The medium everywhere outside; None if there is none or it varies."""
    if not output.inputs["Volume"].is_linked:
        return None
    volume = Volume(values.inner())
    try:
        volume.read(Place(output.inputs["Volume"]))
        if varies(volume.values.steps):
            raise Unsupported("A volume that varies")
    except Unsupported as unsupported:
        values.remark(str(unsupported))
        return None
    return volume.as_dict()


def _sky_strength(output: Any) -> float | None:
    """The strength of a background whose colour is an unrotated Sky Texture; None for any other world."""
    try:
        shader = Place(output.inputs["Surface"]).source()
        if shader.node.bl_idname != "ShaderNodeBackground":
            return None
        color, strength = (shader.beside(shader.node.inputs[name]).source() for name in ("Color", "Strength"))
        if color.node.bl_idname != "ShaderNodeTexSky" or strength.socket.is_output:
            return None
        vector = color.input("Vector")
        turned = vector is not None and vector.source().socket.is_output
        return None if turned else max(float(strength.socket.default_value), 0.0)
    except Unsupported:
        return None


def _rgb(color: Any) -> tuple[float, float, float]:
    r, g, b = (float(c) for c in color[:3])
    return (r, g, b)
