# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of Blender's lights to `core.scene.Light`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.base.arrays import F64
from ...core.scene.scene import RGB, Light, ObjectFrame
from .images import Gallery
from .nodes import Place, Unsupported, active_tree, output_node, scaled
from .object_values import is_regular
from .surfaces import Surface
from .values import Layers, Values
from .visibility import hidden_from

if TYPE_CHECKING:
    from ...core.base.notes import Notes
    from .linking import Linking
    from .object_values import Instance


EVEN = 1e-6
"""Relative difference below which scales are equal: rounding errors of a rotation."""

MOST_POWER, MOST_RADIANCE = 1e20, 1e37
"""Largest power of a light, and its largest power per squared extent: beyond them numbers overflow."""

MOST_BOUNCES = 1024
"""*Max Bounces* of a light or a world without a limit of its own."""

SLACK = 1e-5
"""Excess over a limit that is no remark: a half turn is larger in float32."""

EXTENTS = {
    **dict.fromkeys(("radius", "size", "size_y"), 1e18),
    **dict.fromkeys(("angle", "spot_size", "spread"), math.pi),
    "spot_blend": 1.0,
}
"""Fields of `Light` that must be at least 0, with their largest values."""

FLAT = 1e-12
"""Determinant below which axes of at most unit length are treated as coplanar."""


def read_light(
    instance: Instance, matrix: F64, notes: Notes, gallery: Gallery | None = None
) -> tuple[Light | None, frozenset[int]]:
    """A light object at one place in the world, None if it emits no light, and the numbers of the images it uses."""
    nothing: tuple[None, frozenset[int]] = (None, frozenset())
    data, name = instance.item.data, instance.item.name_full
    if data.type == "AREA" and getattr(getattr(data, "cycles", None), "is_portal", False):
        return nothing  # a portal only guides Cycles's sampling of the world
    if not np.isfinite(matrix).all():
        notes.add("Dropped, the transform is not finite", name)
        return nothing
    # Combine colour, energy, exposure, temperature and nodes to the power.
    to_world, scale = _without_scale(matrix)
    power = scaled(tuple(data.color), data.energy * 2.0**data.exposure)
    if data.use_temperature:
        power = _times(power, tuple(data.temperature_color))
    factor, program, images = _shaded(instance, matrix, notes, gallery or Gallery())
    power = _times(power, factor)
    if not all(map(math.isfinite, power)):
        notes.add("Dropped, the power is not finite", name)
        return nothing
    program |= {"casts_shadow": data.use_shadow, "max_bounces": max_bounces(data)}
    light = Light(data.type.lower(), to_world, power, name=name, **program)
    # Add the shape of each type.
    match data.type:
        case "POINT" | "SPOT":
            light = replace(light, radius=data.shadow_soft_size, sphere=not data.use_soft_falloff)
            if data.type == "SPOT":
                light = replace(light, spot_size=data.spot_size, spot_blend=data.spot_blend)
                if not _is_flat(matrix) and np.ptp(scale) > EVEN * scale.max():
                    light = replace(light, to_world=matrix.copy())  # as in Cycles, the scale squeezes the cone
        case "SUN":
            light = replace(light, angle=data.angle)
        case "AREA":
            size_y = data.size_y if data.shape in ("RECTANGLE", "ELLIPSE") else data.size
            shape = {"SQUARE": "RECTANGLE", "DISK": "ELLIPSE"}.get(data.shape, data.shape)
            light = replace(light, shape=shape, size=float(data.size * scale[0]), size_y=float(size_y * scale[1]))
            light = replace(light, spread=data.spread)
    if not data.normalize:
        light = replace(light, power=scaled(light.power, _extent(light)))
    light = _limited(light, notes)
    return (light, images) if any(light.power) else nothing


class Lamps:
    """Collects lights during one pass over the depsgraph's instances. images: numbers of those that they use."""

    def __init__(self, notes: Notes, gallery: Gallery, linking: Linking, groups: Mapping[str, int]) -> None:
        """groups: numbers of the light groups that the picture needs."""
        self.images: set[int] = set()
        self._notes, self._gallery, self._linking, self._groups = notes, gallery, linking, groups
        self._lights: list[Light] = []
        self._no_catchers: dict[str, None] = {}

    def visit(self, instance: Instance, matrix: F64) -> None:
        """Add an instance of a light object."""
        light, used = read_light(instance, matrix, self._notes, self._gallery)
        if light is None:
            return
        item = instance.item
        self.images |= used
        receivers, blockers = self._linking.of_light(item)
        hidden, group = hidden_from(item, instance.parent), self._groups.get(item.lightgroup, 0)
        light = replace(light, hidden_from=hidden, receivers=receivers, blockers=blockers, group=group)
        self._lights.append(light)
        if not item.is_shadow_catcher:
            self._no_catchers[item.name_full] = None

    def found(self) -> tuple[Light, ...]:
        """The lights in world space, in an order that does not depend on that of Blender's lists."""
        return tuple(sorted(self._lights, key=lambda light: (light.name, light.to_world.tobytes())))

    def note_catchers(self) -> None:
        """Note lights that shine on shadow catchers alone in Cycles, for a scene that has such objects."""
        for name in self._no_catchers:
            self._notes.add("Not a shadow catcher, but shines on shadow catchers alone, too", name)


def max_bounces(block: Any) -> int | None:
    """The number of bounces after which light samples do not see a light or a world, None without a limit.

    Cycles stores it with the data block, if it is enabled.
    """
    most = int(getattr(getattr(block, "cycles", None), "max_bounces", MOST_BOUNCES))
    return most if most < MOST_BOUNCES else None


def _limited(light: Light, notes: Notes) -> Light:
    """The light with the extents and the power that the native module takes, and a note if they are others."""
    extents = {key: getattr(light, key) for key in EXTENTS}
    within = {key: min(max(value, 0.0), EXTENTS[key]) if value == value else 0.0 for key, value in extents.items()}
    if any(not abs(extents[key] - value) < SLACK for key, value in within.items()):
        notes.add("A size that is negative, too large or not a number is limited, of light", light.name)
        light = replace(light, **within)
    # A small light has the larger radiance.
    least = min((within[key] for key in ("radius", "size", "size_y", "angle") if within[key] > 0), default=1.0)
    most, largest = min(MOST_POWER, MOST_RADIANCE * least**2), max(map(abs, light.power))
    if largest > most:
        notes.add("A power that is too large is limited, of light", light.name)
        light = replace(light, power=scaled(light.power, most / largest))
    return light


def moved(light: Light, origin: F64) -> Light:
    """The light in the frame with this origin."""
    to_world = light.to_world.copy()
    to_world[:3, 3] -= origin
    frames = tuple({**frame, "to_object": _shifted(frame["to_object"], origin)} for frame in light.frame)
    return replace(light, to_world=to_world, frame=frames)


def _shifted(rows: tuple[tuple[float, ...], ...], origin: F64) -> tuple[tuple[float, ...], ...]:
    """A transform from the world, (3, 4), as one from the frame with this origin."""
    return tuple((*row[:3], row[3] + float(np.dot(row[:3], origin))) for row in rows)


def _extent(light: Light) -> float:
    """The factor of a light that is not normalised: the emitting area, or the projected solid angle of the sun.

    Matches `Light.area` of the native module: the disk on the sphere of directions; points without size count as 4.
    """
    match light.kind:
        case "sun":
            return math.pi * math.sin(light.angle / 2) ** 2 if light.angle > 0 else 1.0
        case "area":
            round_ = light.shape in ("DISK", "ELLIPSE")
            return light.size * light.size_y * (math.pi / 4 if round_ else 1.0)
        case _:
            return 4.0 * math.pi * light.radius**2 if light.radius > 0 else 4.0


def _without_scale(matrix: F64) -> tuple[F64, F64]:
    """A transform with columns of unit length, and the removed lengths. Collapsed axes are replaced."""
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    to_world = matrix.copy()
    directions = matrix[:3, :3] / np.where(scale > 0, scale, 1.0)
    # A rotated child of a parent with zero scale along an axis also loses axes.
    to_world[:3, :3] = np.eye(3) if _is_flat(directions) else directions
    return to_world, scale


def _is_flat(matrix: F64) -> bool:
    """Whether a transform collapses an axis so far that directions are undefined."""
    axes = matrix[:3, :3] / max(np.abs(matrix[:3, :3]).max(), np.finfo(np.float64).tiny)
    return bool(abs(np.linalg.det(axes)) < FLAT)


def _shaded(
    instance: Instance, matrix: F64, notes: Notes, gallery: Gallery
) -> tuple[RGB, dict[str, Any], frozenset[int]]:
    """The factor of the light's own nodes, their program if it varies, as fields of `Light`, and its images."""
    data, name = instance.item.data, instance.item.name_full
    white, black = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
    tree = active_tree(data)
    if tree is None:
        return white, {}, frozenset()
    output = output_node(tree)
    if output is None:
        return black, {}, frozenset()

    def remark(what: str) -> None:
        notes.add(f"{what} is not supported yet in light", name)

    # Read the surface; everything unsupported leaves the light as it is without nodes.
    values = Values(Layers(), gallery, remark)
    values.lamp, values.far = True, data.type == "SUN"
    surface = Surface(values, white)
    try:
        surface.read(Place(output.inputs["Surface"]))
        total = surface.total()
    except Unsupported as unsupported:
        remark(str(unsupported))
        return white, {}, frozenset()
    if total is None:
        return black if not surface.closures else white, {}, frozenset()
    if not isinstance(total, int):
        r, g, b = total[:3]
        return (float(r), float(g), float(b)), {}, frozenset()
    # The light's own space includes its scale, unless that is 0.
    own = matrix if is_regular(matrix) else _without_scale(matrix)[0]
    rows = tuple(tuple(float(x) for x in row) for row in np.linalg.inv(own)[:3])
    frame = ObjectFrame(rows, ((0.0,) * 3, (1.0,) * 3), instance.values(values.layers.object_values))
    program = {"program": tuple(values.steps), "radiance": total, "frame": (asdict(frame),)}
    return white, program, frozenset(values.images)


def _times(a: RGB, b: RGB) -> RGB:
    return (a[0] * b[0], a[1] * b[1], a[2] * b[2])
