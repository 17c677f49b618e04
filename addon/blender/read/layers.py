# SPDX-License-Identifier: GPL-3.0-or-later
"""Corner attributes that textures read (UV maps, colours, tangents), and the objects' frames for textures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.base.arrays import F32, F64, U32
from ...core.scene.scene import ObjectFrame
from .value_nodes import COLOR, ISLAND, POINTINESS, STRAND, TANGENT, UV
from .vertex_layers import islands, pointiness

if TYPE_CHECKING:
    from .meshes import Placement

Key = tuple[str, str]

BLOCK = 1 << 14
"""Number of triangles whose tangents are transformed at a time."""


def read_layers(mesh: Any, keys: Sequence[Key]) -> dict[Key, F32]:
    """Those of the layers that the mesh has, each (m, 3, 2 to 4) float32 by triangle and corner."""
    if not keys or not len(mesh.loop_triangles):
        return {}
    corners = np.empty(len(mesh.loop_triangles) * 3, np.uint32)
    mesh.loop_triangles.foreach_get("loops", corners)
    found = {}
    for kind, name in keys:
        values = READERS[kind](mesh, name, corners)
        if values is not None:
            found[kind, name] = np.ascontiguousarray(values.reshape(len(corners) // 3, 3, -1), np.float32)
    return found


def widths(mesh: Any, keys: Sequence[Key]) -> dict[Key, int]:
    """Numbers per corner of each of the layers that the mesh has, without a copy."""
    found = {key: _width(mesh, *key) for key in keys} if len(mesh.loop_triangles) else {}
    return {key: numbers for key, numbers in found.items() if numbers}


def _width(mesh: Any, kind: str, name: str) -> int:
    if kind == COLOR:
        attribute = _attribute(mesh, name)
        if attribute is None or unreadable(mesh, (kind, name)):
            return 0
        stored = TYPES[attribute.data_type][0]
        return 3 if stored == 1 else stored
    if kind in (ISLAND, POINTINESS):
        return 3
    if kind == STRAND:
        return 0
    if _uv_map(mesh, name) is None:
        return 0
    return 4 if kind == TANGENT else 2


def _uv_map(mesh: Any, name: str) -> Any:
    if name:
        return mesh.uv_layers.get(name)
    return next((layer for layer in mesh.uv_layers if layer.active_render), None)


def _uv(mesh: Any, name: str, corners: U32) -> F32 | None:
    uv_map = _uv_map(mesh, name)
    if uv_map is None:
        return None
    values = np.empty(len(mesh.loops) * 2, np.float32)
    uv_map.uv.foreach_get("vector", values)
    return values.reshape(-1, 2).take(corners, axis=0)


TYPES: dict[str, tuple[int, str, Any]] = {
    "FLOAT_COLOR": (4, "color", np.float32),
    "BYTE_COLOR": (4, "color", np.float32),
    "FLOAT_VECTOR": (3, "vector", np.float32),
    "FLOAT2": (2, "vector", np.float32),
    "FLOAT": (1, "value", np.float32),
    "INT": (1, "value", np.int32),
    "INT8": (1, "value", np.int8),
    "BOOLEAN": (1, "value", np.bool_),
}
"""The readable attribute types: numbers per element, the name of their field, and their type in Blender's memory."""

DOMAINS = ("POINT", "FACE", "CORNER")


def _attribute(mesh: Any, name: str) -> Any:
    """An attribute by name, without a name the active colour, or None."""
    if name:
        return mesh.attributes.get(name)
    colors = mesh.color_attributes
    index = colors.render_color_index
    return colors[index] if 0 <= index < len(colors) else None


def unreadable(mesh: Any, key: Key) -> str:
    """The reason why an existing layer of a mesh cannot be read, or ""."""
    attribute = _attribute(mesh, key[1]) if key[0] == COLOR else None
    if attribute is None:
        return ""
    if attribute.data_type not in TYPES:
        return f"type {attribute.data_type.lower()}"
    return "" if attribute.domain in DOMAINS else f"domain {attribute.domain.lower()}"


def _color(mesh: Any, name: str, corners: U32) -> F32 | None:
    """An attribute of numbers on points, faces or corners; without a name the active colour."""
    attribute = _attribute(mesh, name)
    if attribute is None or unreadable(mesh, (COLOR, name)):
        return None
    # Read the attribute in its stored type.
    width, field, stored = TYPES[attribute.data_type]
    values = np.empty(len(attribute.data) * width, stored)
    attribute.data.foreach_get(field, values)
    rows = values.reshape(-1, width).astype(np.float32, copy=False)
    if width == 1:
        rows = np.repeat(rows, 3, axis=1)
    # Distribute values from their domain to the corners of triangles.
    if attribute.domain == "CORNER":
        return rows.take(corners, axis=0)
    if attribute.domain == "POINT":
        vertices = np.empty(len(mesh.loops), np.int32)
        mesh.attributes[".corner_vert"].data.foreach_get("value", vertices)
        return rows.take(vertices.take(corners), axis=0)
    faces = np.empty(len(corners) // 3, np.int32)
    mesh.loop_triangle_polygons.foreach_get("value", faces)
    return np.repeat(rows.take(faces, axis=0), 3, axis=0)


def _tangents(mesh: Any, name: str, corners: U32) -> F32 | None:
    """Blender's own tangents (x, y, z) and the sign of the bitangent."""
    uv_map = _uv_map(mesh, name)
    if uv_map is None:
        return None
    try:
        mesh.calc_tangents(uvmap=uv_map.name)
    except RuntimeError:
        # Blender's tangents support only triangles and quads.
        return _triangle_tangents(mesh, name, corners)
    # Read tangents and signs per loop, then gather the triangles' corners.
    values = np.empty((len(mesh.loops), 4), np.float32)
    flat = np.empty(len(mesh.loops) * 3, np.float32)
    mesh.loops.foreach_get("tangent", flat)
    values[:, :3] = flat.reshape(-1, 3)
    sign = np.empty(len(mesh.loops), np.float32)
    mesh.loops.foreach_get("bitangent_sign", sign)
    values[:, 3] = sign
    mesh.free_tangents()
    return values.take(corners, axis=0)


def _triangle_tangents(mesh: Any, name: str, corners: U32) -> F32 | None:
    """The direction of increasing u on each triangle, for meshes with larger faces."""
    uv = _uv(mesh, name, corners)
    assert uv is not None
    positions = np.empty(len(mesh.vertices) * 3, np.float32)
    mesh.attributes["position"].data.foreach_get("vector", positions)
    vertices = np.empty(len(mesh.loops), np.int32)
    mesh.attributes[".corner_vert"].data.foreach_get("value", vertices)
    # Solve for the tangent from the edges in space and in uv.
    p = positions.reshape(-1, 3).take(vertices.take(corners), axis=0).reshape(-1, 3, 3).astype(np.float64)
    t = uv.reshape(-1, 3, 2).astype(np.float64)
    e1, e2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    d1, d2 = t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]
    area = d1[:, 0] * d2[:, 1] - d2[:, 0] * d1[:, 1]
    tangent = (e1 * d2[:, 1:] - e2 * d1[:, 1:]) * np.sign(area)[:, None]
    length = np.linalg.norm(tangent, axis=1, keepdims=True)
    tangent /= np.where(length > 0, length, 1)
    values = np.concatenate([tangent, np.where(area < 0, -1.0, 1.0)[:, None]], axis=1).astype(np.float32)
    return np.repeat(values, 3, axis=0)


READERS: dict[str, Callable[[Any, str, U32], F32 | None]] = {
    UV: _uv,
    COLOR: _color,
    TANGENT: _tangents,
    ISLAND: lambda mesh, _, corners: islands(mesh, corners),
    POINTINESS: lambda mesh, _, corners: pointiness(mesh, corners),
    STRAND: lambda *_: None,
}
"""The readers of layers by their kind: values of a mesh's layer at the corners of its triangles."""


def box(mesh: Any) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Offset and then scale that map positions of the mesh to its texture space, 0 to 1."""
    place, size = np.array(mesh.texspace_location), np.array(mesh.texspace_size)
    size = np.where(size == 0, 1.0, size)
    return tuple(size - place), tuple(0.5 / size)


def box_around(positions: F32) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Like `box`, around the finite ones of these (n, 3) positions: a mesh with others has no finite texture space."""
    finite = positions[np.isfinite(positions).all(axis=1)].astype(np.float64)
    if not len(finite):
        return (1.0, 1.0, 1.0), (0.5, 0.5, 0.5)
    low, high = finite.min(axis=0), finite.max(axis=0)
    size = np.where(high > low, (high - low) / 2, 1.0)
    return tuple(size - (low + high) / 2), tuple(0.5 / size)


def width(placements: Sequence[Placement], key: Key) -> int:
    """Numbers per corner of the layer, 0 if no mesh has it."""
    return max((p.mesh.layers[key].shape[2] for p in placements if key in p.mesh.layers), default=0)


def assemble_layers(placements: Sequence[Placement], keys: Sequence[Key], count: int) -> tuple[F32 | None, ...]:
    """Each layer over the `count` triangles of all placements in their order; None for one that no mesh has."""
    out: list[F32 | None] = []
    for key in keys:
        numbers = width(placements, key)
        if not numbers:
            out.append(None)
            continue
        layer = np.zeros((count, 3, numbers), np.float32)
        if layer.shape[2] == 4:
            layer[..., 3] = 1
        start = 0
        # Copy the mesh's values to all its instances; tangents are transformed, mirrored triangles flipped.
        for p in placements:
            places, triangles = len(p.names), len(p.mesh.triangles)
            rows = layer[start : start + places * triangles].reshape(places, triangles, 3, -1)
            values = p.mesh.layers.get(key)
            if values is not None:
                mirrored = np.linalg.det(p.matrices[:, :3, :3]) < 0
                if key[0] == TANGENT:
                    _turn(values[..., :3], p.matrices, out=rows[..., :3])
                    signs = np.where(mirrored, -1, 1).astype(np.float32)
                    np.multiply(signs[:, None, None], values[..., 3], out=rows[..., 3])
                else:
                    rows[..., : values.shape[2]] = values
                if mirrored.any():
                    rows[mirrored, :, 1:] = rows[mirrored, :, :0:-1]
            start += places * triangles
        out.append(layer)
    return tuple(out)


def _turn(tangents: F32, matrices: F64, *, out: F32) -> None:
    """Transform unit vectors (m, 3, 3) of a mesh into each of its instances, rounded once into `out` (k, m, 3, 3).

    In blocks: in f64 all of them together would take several times the memory accounted for the layer.
    """
    places = max(BLOCK // max(len(tangents), 1), 1)
    for m in range(0, len(tangents), BLOCK):
        part = tangents[m : m + BLOCK].astype(np.float64)
        for k in range(0, len(matrices), places):
            turned = np.einsum("kij,mcj->kmci", matrices[k : k + places, :3, :3], part)
            length = np.linalg.norm(turned, axis=-1, keepdims=True)
            out[k : k + places, m : m + BLOCK] = turned / np.where(length > 0, length, 1)


def assemble_objects(placements: Sequence[Placement], origin: F64) -> tuple[tuple[ObjectFrame, ...], U32]:
    """Every instance as an object frame, and the frame of each triangle, (m,) uint32."""
    frames = []
    counts = []
    shift = np.eye(4)
    shift[:3, 3] = origin
    for p in placements:
        add, scale = p.mesh.box
        for k, matrix in enumerate(np.linalg.inv(p.matrices) @ shift):
            rows = tuple(tuple(float(x) for x in row) for row in matrix[:3])
            frames.append(ObjectFrame(rows, (add, scale), p.values[k] if p.values else ()))
            counts.append(len(p.mesh.triangles))
    return tuple(frames), np.repeat(np.arange(len(frames), dtype=np.uint32), counts)
