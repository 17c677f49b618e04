# SPDX-License-Identifier: GPL-3.0-or-later
"""Layers that are computed from the connections of a mesh: random numbers of its islands, and pointiness."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.base.arrays import F32, F64, U32
from .object_values import hashed

if TYPE_CHECKING:
    from numpy.typing import NDArray


def islands(mesh: Any, corners: U32) -> F32:
    """A random number in [0, 1] for each connected part of the mesh, three times per corner."""
    numbers = hashed(lowest_neighbours(len(mesh.vertices), _edges(mesh))) / np.float32(0xFFFFFFFF)
    return _at_corners(mesh, numbers, corners)


def pointiness(mesh: Any, corners: U32) -> F32:
    """The pointiness of each vertex, three times per corner: 0.5 where the surface is flat, higher on ridges.

    As in Cycles: the angle between the normal and the mean direction of the edges, averaged over the neighbours;
    vertices at equal positions count as one.
    """
    positions = np.empty((len(mesh.vertices), 3), np.float32)
    mesh.attributes["position"].data.foreach_get("vector", positions.ravel())
    normals = np.empty_like(positions)
    mesh.vertex_normals.foreach_get("vector", normals.ravel())
    # Join vertices at equal positions, and edges between them.
    joined, vertex = _joined(positions)
    count = len(joined)
    low, high = np.sort(vertex[_edges(mesh)], axis=1).T
    edges = np.stack(np.divmod(np.unique((low * count + high)[low != high]), max(count, 1)), axis=1)
    normal = _unit(_summed(vertex, normals, count))
    # Measure the angle at each vertex.
    along = _unit(joined[edges[:, 1]].astype(np.float64) - joined[edges[:, 0]])
    ends = np.concatenate([edges[:, 0], edges[:, 1]])
    number = np.bincount(ends, minlength=count)
    mean = _summed(ends, np.concatenate([along, -along]), count) / np.maximum(number, 1)[:, None]
    angle = np.arccos(np.clip((normal * mean).sum(axis=1), -1, 1)) / np.pi
    raw = np.where(number > 0, angle, 0.0)
    # Average over the vertex and its neighbours.
    others = np.bincount(ends, raw[np.concatenate([edges[:, 1], edges[:, 0]])], minlength=count)
    return _at_corners(mesh, ((raw + others) / (number + 1))[vertex], corners)


def _joined(positions: F32) -> tuple[F32, NDArray[np.int64]]:
    """Different positions in ascending order, and the index of each one among them; `np.unique` takes several times as
    long for rows.
    """
    order = np.lexsort(positions.T[::-1])
    ranked = positions[order]
    first = np.ones(len(order), bool)
    first[1:] = (ranked[1:] != ranked[:-1]).any(axis=1)
    numbers = np.empty(len(order), np.int64)
    numbers[order] = np.cumsum(first) - 1
    return ranked[first], numbers


def _edges(mesh: Any) -> NDArray[Any]:
    """The vertices of each edge, (n, 2)."""
    edges = np.empty(len(mesh.edges) * 2, np.int32)
    if len(edges):
        mesh.attributes[".edge_verts"].data.foreach_get("value", edges)
    return edges.reshape(-1, 2)


def _at_corners(mesh: Any, numbers: Any, corners: U32) -> F32:
    """Numbers of the vertices, three times at each corner of the triangles."""
    vertices = np.empty(len(mesh.loops), np.int32)
    mesh.attributes[".corner_vert"].data.foreach_get("value", vertices)
    values = numbers.astype(np.float32).take(vertices.take(corners))
    return np.repeat(values[:, None], 3, axis=1)


def _summed(rows: NDArray[Any], vectors: NDArray[Any], count: int) -> F64:
    """The sums of the vectors of each of `count` rows."""
    return np.stack([np.bincount(rows, column, minlength=count) for column in vectors.T], axis=1)


def _unit(vectors: NDArray[Any]) -> F64:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1), np.float64)


def lowest_neighbours(count: int, edges: NDArray[Any]) -> NDArray[np.int64]:
    """The lowest vertex of each vertex's connected part, (count,). edges: (n, 2).

    Labels spread along edges and are then followed to their own labels, which halves long chains.
    """
    labels = np.arange(count, dtype=np.int64)
    while True:
        lowest = labels[edges].min(axis=1) if len(edges) else np.zeros(0, np.int64)
        # Hook the labels of both ends, so that whole parts are joined at once.
        new = labels.copy()
        for end in edges.T:
            np.minimum.at(new, labels[end], lowest)
            np.minimum.at(new, end, lowest)
        new = new[new]
        if (new == labels).all():
            return labels
        labels = new
