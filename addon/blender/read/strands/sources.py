# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair curves, particle hair and point clouds of Blender as arrays, with the values that materials read of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ....core.base.arrays import F32
from ....core.base.steps import Steps
from ....core.scene import tubes
from ..layers import TYPES, Key
from ..object_values import MASK, hashed
from ..value_nodes import COLOR, STRAND, UV

if TYPE_CHECKING:
    from numpy.typing import NDArray

HAIR_RADIUS, POINT_RADIUS = 0.005, 0.01
"""Radii where the data has none, as in Cycles."""

BLOCK = 64
"""Hairs that are read in one step: Blender gives points one by one."""

POLY = 1
"""The number of chains of straight lines among Blender's types of curves."""


@dataclass(frozen=True, eq=False)
class Values:
    """Values that materials read, each (n, 2 to 4) float32: one per point, or one per curve."""

    of_points: dict[Key, F32] = field(default_factory=dict)
    of_curves: dict[Key, F32] = field(default_factory=dict)


def read_curves(data: Any, keys: Sequence[Key]) -> Steps[tuple[tubes.Strands, Values]]:
    """The curves of a hair curves object, and those of the layers that it has; one at a time."""
    count = len(data.curves)
    first = np.zeros(count + 1, np.int32)
    if count:
        data.curve_offset_data.foreach_get("value", first)
    points, radii = _points(data, HAIR_RADIUS)
    yield
    kinds = data.attributes.get("curve_type")
    straight = count > 0 and kinds is not None and len(kinds.data) > 0 and kinds.data[0].value == POLY
    found = tubes.strands(points, radii, first, straight=straight)
    # Read attributes, by name or as the first UV map.
    values = Values()
    for key in keys:
        attribute = _attribute(data, key)
        if attribute is not None and attribute.data_type in TYPES and attribute.domain in ("POINT", "CURVE"):
            of = values.of_points if attribute.domain == "POINT" else values.of_curves
            of[key] = _rows(attribute)
            yield
    yield from _add_strand_values(found, keys, values)
    return found, values


def read_points(data: Any, keys: Sequence[Key]) -> Steps[tuple[F32, F32, Values]]:
    """Centres and radii of a point cloud, and those of the layers that it has; one at a time."""
    points, radii = _points(data, POINT_RADIUS)
    values = Values()
    for key in keys:
        attribute = _attribute(data, key)
        if attribute is not None and attribute.data_type in TYPES and attribute.domain == "POINT":
            values.of_points[key] = _rows(attribute)
        elif key == (STRAND, "Radius"):
            values.of_points[key] = _three(radii)
        elif key == (STRAND, "Position"):
            values.of_points[key] = points
        elif key == (STRAND, "Point Random"):
            values.of_points[key] = _random(len(points))
        yield
    return points, radii, values


def _points(data: Any, usual: float) -> tuple[F32, F32]:
    """Positions and radii of the points."""
    count = len(data.points)
    points, radii = np.zeros((count, 3), np.float32), np.full(count, usual, np.float32)
    if count:
        data.attributes["position"].data.foreach_get("vector", points.reshape(-1))
        stored = data.attributes.get("radius")
        if stored is not None and stored.data_type == "FLOAT" and stored.domain == "POINT":
            stored.data.foreach_get("value", radii)
    return points, radii


def _attribute(data: Any, key: Key) -> Any:
    """The attribute of a layer, or None; the first UV map of curves has no name of its own."""
    kind, name = key
    if kind not in (UV, COLOR):
        return None
    if name:
        return data.attributes.get(name)
    if kind == COLOR:
        return None
    maps = (one for one in data.attributes if one.data_type == "FLOAT2" and one.domain == "CURVE")
    return next(maps, None)


def _rows(attribute: Any) -> F32:
    width, name, stored = TYPES[attribute.data_type]
    values = np.empty(len(attribute.data) * width, stored)
    if len(values):
        attribute.data.foreach_get(name, values)
    rows: F32 = values.reshape(-1, width).astype(np.float32, copy=False)
    return _three(rows[:, 0]) if width == 1 else rows


def _three(numbers: NDArray[Any]) -> F32:
    """Numbers as grey colours."""
    return np.repeat(numbers.astype(np.float32)[:, None], 3, axis=1)


def _random(count: int) -> F32:
    """The random number of each curve or point, as in Cycles."""
    return _three(hashed(np.arange(count, dtype=np.int64)) / MASK)


def _add_strand_values(found: tubes.Strands, keys: Sequence[Key], values: Values) -> Steps[None]:
    """Compute the values of the node Curves Info that materials read, one at a time."""
    for name in (name for kind, name in keys if kind == STRAND):
        yield
        match name:
            case "Is Strand":
                values.of_points[STRAND, name] = np.ones((len(found.points), 3), np.float32)
            case "Intercept":
                values.of_points[STRAND, name] = _three(_along(found)[0])
            case "Length":
                values.of_curves[STRAND, name] = _three(_along(found)[1])
            case "Thickness":
                values.of_points[STRAND, name] = _three(2 * found.radii)
            case "Tangent":
                values.of_points[STRAND, name] = _slopes(found)
            case "Random":
                values.of_curves[STRAND, name] = _random(len(found.counts))


def _slopes(found: tubes.Strands) -> F32:
    """The position and the slope of the spline at each point, (n, 6), see `tubes.tangents`."""
    curve, row = found.curve_of_point(), np.arange(len(found.points))
    ahead = np.minimum(row + 1, found.first[curve + 1] - 1)
    behind = np.maximum(row - 1, found.first[curve])
    with np.errstate(over="ignore", invalid="ignore"):
        slopes = (found.points[ahead] - found.points[behind]) / np.float32(2)
    return np.concatenate([found.points, slopes], axis=1)


def _along(found: tubes.Strands) -> tuple[NDArray[Any], NDArray[Any]]:
    """The share of a curve's length before each point, and the length of each curve."""
    curve = found.curve_of_point()
    steps = np.zeros(len(found.points))
    with np.errstate(over="ignore", invalid="ignore"):
        steps[1:] = np.linalg.norm(np.diff(found.points.astype(np.float64), axis=0), axis=1)
    begins = found.first[:-1][found.counts > 0]
    steps[begins] = 0
    steps[~np.isfinite(steps)] = 0  # such curves are left out
    total = np.cumsum(steps)
    from_begin = total - np.repeat(total[begins], found.counts[found.counts > 0])
    length = np.bincount(curve, steps, minlength=len(found.counts))
    whole = length[curve]
    return from_begin / np.where(whole > 0, whole, 1), length


@dataclass(frozen=True, eq=False)
class Hair:
    """Particle hair. part: one in how many hairs was read."""

    strands: tubes.Strands
    values: Values
    part: int = 1


def hair_systems(item: Any, mode: str) -> list[tuple[Any, Any]]:
    """The modifiers and particle systems of an evaluated object that are rendered as hair. mode: of the depsgraph."""
    if item.mode in ("EDIT", "PARTICLE_EDIT"):
        return []
    shown = "show_render" if mode == "RENDER" else "show_viewport"
    return [
        (modifier, modifier.particle_system)
        for modifier in item.modifiers
        if modifier.type == "PARTICLE_SYSTEM"
        and getattr(modifier, shown)
        and modifier.particle_system.settings.type == "HAIR"
        and modifier.particle_system.settings.render_type == "PATH"
    ]


def read_hair(item: Any, modifier: Any, keys: Sequence[Key], mode: str, most: int) -> Steps[Hair]:
    """The hairs of one particle system of an evaluated object, in the object's space; some at a time.

    most: number of points that are read at most; of more hairs only one in several is read. Blender gives points one by
    one: reading takes about half a microsecond each.
    """
    system = modifier.particle_system
    settings, final = system.settings, mode == "RENDER"
    parents, children = len(system.particles), len(system.child_particles)
    if not final:
        children = int(children * settings.display_percentage / 100)
    steps = (1 << (settings.render_step if final else settings.display_step)) + 1
    if settings.kink == "SPIRAL":
        steps += settings.kink_extra_steps
    begin = parents if settings.child_type != "NONE" and children else 0
    part = max(-(-(parents + children - begin) * steps // most), 1)
    hairs = range(begin, parents + children, part) if parents else range(0)
    # Points beyond the end of a hair are returned as 0: they repeat its last one.
    locate, points = system.co_hair, np.empty((len(hairs), steps, 3))
    for row, number in enumerate(hairs):
        for step in range(steps):
            points[row, step] = locate(object=item, particle_no=number, step=step)
        if row % BLOCK == 0:
            yield
    for step in range(1, steps):
        beyond = ~points[:, step].any(axis=1)
        points[beyond, step] = points[beyond, step - 1]
    matrix = np.array(item.matrix_world, np.float64)
    points = (points - matrix[:3, 3]) @ np.linalg.pinv(matrix[:3, :3]).T if np.isfinite(matrix).all() else points
    first = np.arange(len(hairs) + 1, dtype=np.int64) * steps
    flat = points.reshape(-1, 3).astype(np.float32)
    found = tubes.strands(flat, np.zeros(len(flat), np.float32), first)
    share = _along(found)[0]
    radii = _radii(settings, share)
    if settings.use_close_tip and len(hairs):
        radii[first[1:] - 1] = 0
    found = tubes.strands(flat, radii, first)
    values = Values()
    for key in keys:
        rows = yield from _on_emitter(item, modifier, key, hairs)
        if rows is not None:
            values.of_curves[key] = rows
    yield from _add_strand_values(found, keys, values)
    return Hair(found, values, part)


def _radii(settings: Any, share: NDArray[Any]) -> F32:
    """The radius at each share of a hair's length, by the particle settings."""
    scale = settings.radius_scale / 2
    root, tip, shape = settings.root_radius * scale, settings.tip_radius * scale, settings.shape
    power = 1 + shape if shape < 0 else 1 / max(1 - shape, 1e-9)
    radii: F32 = (np.clip(1 - share, 0, 1) ** power * (root - tip) + tip).astype(np.float32)
    return radii


def _on_emitter(item: Any, modifier: Any, key: Key, hairs: range) -> Steps[F32 | None]:
    """The value of a layer of the emitter's mesh at the root of each hair; None if the mesh has no such layer."""
    kind, name = key
    if kind not in (UV, COLOR) or item.type != "MESH":
        return None
    layers = item.data.uv_layers if kind == UV else item.data.vertex_colors
    number = layers.find(name) if name else next((i for i, one in enumerate(layers) if one.active_render), -1)
    if number < 0:
        return None
    system = modifier.particle_system
    particles, last = system.particles, len(system.particles) - 1
    rows = np.empty((len(hairs), 2 if kind == UV else 3), np.float32)
    for row, hair in enumerate(hairs):
        at = {"modifier": modifier, "particle": particles[min(hair, last)], "particle_no": hair}
        if kind == UV:
            rows[row] = system.uv_on_emitter(**at, uv_no=number)
        else:
            rows[row] = system.mcol_on_emitter(**at, vcol_no=number)
        if row % BLOCK == 0:
            yield
    return _linear(rows) if kind == COLOR else rows


def _linear(encoded: F32) -> F32:
    """Colours of bytes, decoded from sRGB."""
    low, high = encoded / np.float32(12.92), ((np.maximum(encoded, 0) + 0.055) / 1.055) ** 2.4
    return np.where(encoded <= 0.04045, low, high).astype(np.float32)
