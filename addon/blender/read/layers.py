# SPDX-License-Identifier: GPL-3.0-or-later
"""Corner attributes that textures read (UV maps, colours, tangents), and the objects' frames for textures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import repeat
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.base.arrays import F32, F64, U32
from ...core.base.steps import Steps
from ...core.scene.scene import ObjectFrame
from .value_nodes import COLOR, ISLAND, POINTINESS, STRAND, TANGENT, UV
from .vertex_layers import islands, pointiness

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .meshes import MeshArrays, Placement

Key = tuple[str, str]


def read_layers(mesh: Any, keys: Sequence[Key]) -> Steps[dict[Key, F32]]:
    """Those of the layers that the mesh has, each (m, 3, 2 to 4) float32 by triangle and corner; one at a time."""
    if not keys or not len(mesh.loop_triangles):
        return {}
    corners = np.empty(len(mesh.loop_triangles) * 3, np.uint32)
    mesh.loop_triangles.foreach_get("loops", corners)
    found = {}
    for kind, name in keys:
        values = READERS[kind](mesh, name, corners)
        if values is not None:
            found[kind, name] = np.ascontiguousarray(values.reshape(len(corners) // 3, 3, -1), np.float32)
        yield
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
    if kind == TANGENT:
        return 4 if _has_tangents(mesh, name) else 0
    return 0 if _uv_map(mesh, name) is None else 2


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


def _has_tangents(mesh: Any, name: str) -> bool:
    """Whether a mesh has the tangents of a UV map: as in Cycles, a mesh without any has those of its coordinates."""
    return _uv_map(mesh, name) is not None or not (name or len(mesh.uv_layers))


def _tangents(mesh: Any, name: str, corners: U32) -> F32 | None:
    """Blender's own tangents (x, y, z) and the sign of the bitangent, in the space of the mesh."""
    if not _has_tangents(mesh, name):
        return None
    uv_map = _uv_map(mesh, name)
    if uv_map is None:
        return _smooth_tangents(mesh, None, corners)
    try:
        mesh.calc_tangents(uvmap=uv_map.name)
    except RuntimeError:
        # Blender's tangents support only triangles and quads.
        return _smooth_tangents(mesh, _uv(mesh, name, corners), corners)
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


def _smooth_tangents(mesh: Any, uv: F32 | None, corners: U32) -> F32:
    """The direction of increasing u at the corners of triangles, for meshes with larger faces or (None) without a UV
    map: u and v are then longitude and latitude around the mesh's origin.

    As Mikkelsen 2008, "Simulation of Wrinkled Surfaces Revisited", the mean of the triangles of one orientation around
    a vertex, weighted by their angles.
    """
    positions = np.empty(len(mesh.vertices) * 3, np.float32)
    mesh.attributes["position"].data.foreach_get("vector", positions)
    vertices = np.empty(len(mesh.loops), np.int32)
    mesh.attributes[".corner_vert"].data.foreach_get("value", vertices)
    normals = np.empty(len(mesh.loops) * 3, np.float32)
    mesh.corner_normals.foreach_get("vector", normals)
    vertex = vertices.take(corners)
    p = positions.reshape(-1, 3).take(vertex, axis=0).astype(np.float64)
    n = normals.reshape(-1, 3).take(corners, axis=0).astype(np.float64)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        t = _around(p) if uv is None else uv.reshape(-1, 3, 2).astype(np.float64)
        p = p.reshape(-1, 3, 3)
        # Solve for the tangents of the triangles from their edges in space and in uv.
        e1, e2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
        d1, d2 = t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]
        sign = np.where(d1[:, 0] * d2[:, 1] - d2[:, 0] * d1[:, 1] > 0, 1.0, -1.0)[:, None]
        along = np.repeat((e1 * d2[:, 1:] - e2 * d1[:, 1:]) * sign, 3, axis=0)
        # Add them up where vertex, normal and orientation are equal, each in the plane across the normal.
        signs = np.repeat(sign, 3, axis=0)
        to_next, to_last = ((p[:, order] - p).reshape(-1, 3) for order in ([1, 2, 0], [2, 0, 1]))
        cosine = (_across(n, to_next) * _across(n, to_last)).sum(axis=1)
        part = _across(n, along) * np.arccos(np.clip(cosine, -1, 1))[:, None]
        keys = np.column_stack([vertex, n, signs, *(() if uv is None else (uv,))])
        groups = np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)
        part = np.nan_to_num(part, posinf=0, neginf=0)
        total = np.column_stack([np.bincount(groups, part[:, axis])[groups] for axis in range(3)])
        values = np.concatenate([np.nan_to_num(_unit(total)), signs], axis=1)
    return values.astype(np.float32)


def _around(positions: F64) -> F64:
    """Longitude and latitude of the corners of triangles, positions (3 m, 3), in turns and half turns, (m, 3, 2). Where
    a triangle crosses the end of the longitudes, they continue beyond it, as in Cycles.
    """
    x, y, z = positions.T
    length = np.sqrt((positions**2).sum(axis=1))
    u = np.where((x == 0) & (y == 0), 0.0, 0.5 - np.arctan2(x, y) / (2 * np.pi))
    v = 1 - np.arccos(np.clip(z / length, -1, 1)) / np.pi
    u = np.where(length > 0, u, 0.0).reshape(-1, 3)
    u += (np.ptp(u, axis=1)[:, None] > 0.5) & (u < 0.5)
    return np.stack([u, np.where(length > 0, v, 0.0).reshape(-1, 3)], axis=-1)


def _across(normals: F64, vectors: F64) -> F64:
    """The parts of vectors across unit normals, each (n, 3), as unit vectors."""
    return _unit(vectors - normals * (normals * vectors).sum(axis=1, keepdims=True))


def _unit(vectors: F64) -> F64:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(length > 0, length, 1)


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
    if not len(positions):
        return (1.0, 1.0, 1.0), (0.5, 0.5, 0.5)
    if not np.isfinite(extremes(positions)).all():
        return box_around(positions[np.isfinite(positions).all(axis=1)])
    low, high = extremes(positions)
    size = np.where(high > low, (high - low) / 2, 1.0)
    return tuple(size - (low + high) / 2), tuple(0.5 / size)


def extremes(positions: F32) -> F64:
    """The lowest and the highest coordinates of at least one position, (2, 3); non-finite if any is.

    NumPy reduces rows of three one by one; folded into rows of 64 points they use vector instructions, ten times faster
    (measured).
    """
    whole = len(positions) // 64 * 64
    folded = positions[:whole].reshape(-1, 64 * 3)
    rows = (
        [positions[whole:], folded.min(axis=0).reshape(-1, 3), folded.max(axis=0).reshape(-1, 3)]
        if whole
        else [positions]
    )
    found = np.concatenate(rows)
    return np.stack([found.min(axis=0), found.max(axis=0)]).astype(np.float64)


def width(meshes: Iterable[MeshArrays], key: Key) -> int:
    """Numbers per corner of the layer, 0 if no mesh has it."""
    return max((mesh.layers[key].shape[2] for mesh in meshes if key in mesh.layers), default=0)


def assemble_layers(
    copies: Sequence[tuple[MeshArrays, NDArray[np.bool_]]], keys: Sequence[Key]
) -> tuple[F32 | None, ...]:
    """Each layer over all copies of meshes in their order; None for one that no mesh has. The triangles of a copy that
    is mirrored, (k,) bool, are flipped.
    """
    count = sum(len(mesh.triangles) * len(mirrored) for mesh, mirrored in copies)
    out: list[F32 | None] = []
    for key in keys:
        numbers = width((mesh for mesh, _ in copies), key)
        if not numbers:
            out.append(None)
            continue
        layer = np.zeros((count, 3, numbers), np.float32)
        if layer.shape[2] == 4:
            layer[..., 3] = 1
        start = 0
        # Write the mesh's values for each copy.
        for mesh, mirrored in copies:
            end = start + len(mirrored) * len(mesh.triangles)
            rows = layer[start:end].reshape(len(mirrored), len(mesh.triangles), 3, -1)
            values = mesh.layers.get(key)
            if values is not None:
                rows[..., : values.shape[2]] = values
                if mirrored.any():
                    rows[mirrored, :, 1:] = rows[mirrored, :, :0:-1]
            start = end
        out.append(layer)
    return tuple(out)


def object_frames(placements: Sequence[Placement], origin: F64) -> tuple[ObjectFrame, ...]:
    """The object frame of each instance."""
    frames = []
    shift = np.eye(4)
    shift[:3, 3] = origin
    for p in placements:
        matrices = p.matrices if p.frames is None else p.frames
        each = len(p.names) // max(len(matrices), 1)
        for k, matrix in enumerate(np.linalg.inv(matrices) @ shift):
            rows = tuple(tuple(float(x) for x in row) for row in matrix[:3])
            own = p.values[k * each : (k + 1) * each] or repeat((), each)
            frames += [ObjectFrame(rows, p.mesh.box, values) for values in own]
    return tuple(frames)
