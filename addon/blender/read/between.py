# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes between two times, where only transforms differ: places are interpolated, everything else is shared."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...core.base.equality import same

if TYPE_CHECKING:
    from ...core.base.arrays import F64
    from .extract import Found
    from .meshes import Placement


def sharing(found: Found, other: Found) -> Found:
    """The second scene, with the meshes of the first where they are the same."""
    if len(found.placements) == len(other.placements):
        for here, there in zip(found.placements, other.placements, strict=True):
            if same(here.mesh, there.mesh):
                there.mesh = here.mesh
    return other


def differs_by_places(found: Found, other: Found) -> bool:
    """Whether two scenes differ in the transforms of their instances alone, or not at all."""
    if (found.layers, found.objects, found.apart) != (other.layers, other.objects, other.apart):
        return False
    pairs = zip(found.placements, other.placements, strict=False)
    return (
        len(found.placements) == len(other.placements)
        and same(found.scene, other.scene)
        and all(
            same((a.keys, a.names, a.materials, a.values, a.mesh), (b.keys, b.names, b.materials, b.values, b.mesh))
            for a, b in pairs
        )
    )


def interpolated(a: Found, b: Found, share: float) -> Found:
    """The scene at a share, 0 to 1, of the time from one to another that differs from it by places."""
    pairs = zip(a.placements, b.placements, strict=True)
    placements = [replace(one, transforms=transforms(one.matrices, other.matrices, share)) for one, other in pairs]
    return replace(a, placements=placements)


def transforms(a: F64, b: F64, share: float) -> F64:
    """Affine transforms (k, 4, 4) between two: position and stretch linearly, rotation at a steady rate about one axis.

    As in Cycles. The parts are those of the polar decomposition, which are unique (Shoemake and Duff 1992).
    """
    moving = (a != b).any(axis=(1, 2))
    out = a.copy()
    if not moving.any():
        return out
    a, b = a[moving], b[moving]
    (turn, stretch), (other_turn, other_stretch) = _parts(a[:, :3, :3]), _parts(b[:, :3, :3])
    # Rotate by a share of the angle about the axis of the rotation from one to the other.
    turned = _share_of(other_turn @ turn.transpose(0, 2, 1), share) @ turn
    between = a + (b - a) * share
    between[:, :3, :3] = turned @ (stretch + (other_stretch - stretch) * share)
    out[moving] = between
    return out


def farthest(a: Placement, b: Placement) -> F64:
    """The largest distance between the corners of the mesh's box in two sets of k places, (k,)."""
    box = a.mesh.bounds
    if box is None:
        return np.zeros(len(a.matrices))
    corners = np.stack(np.meshgrid(*box.T, indexing="ij"), axis=-1).reshape(-1, 3)
    moved = a.matrices - b.matrices
    by = corners @ moved[:, :3, :3].transpose(0, 2, 1) + moved[:, None, :3, 3]
    longest: F64 = np.sqrt((by * by).sum(axis=-1)).max(axis=1)
    return longest


def _parts(linear: F64) -> tuple[F64, F64]:
    """Rotations and symmetric stretches, (k, 3, 3) each, whose products these are; mirrored ones have negative
    stretches.
    """
    left, sizes, right = np.linalg.svd(linear)
    turn = left @ right
    sign = np.where(np.linalg.det(turn) < 0, -1.0, 1.0)[:, None, None]
    stretch = right.transpose(0, 2, 1) * sizes[:, None] @ right
    return turn * sign, stretch * sign


def _share_of(turn: F64, share: float) -> F64:
    """Rotations (k, 3, 3) by a share of the angle of each."""
    # Rodrigues' formula with the axis from the antisymmetric part, and for half turns from the symmetric one.
    twice = turn - turn.transpose(0, 2, 1)
    axis = np.stack([twice[:, 2, 1], twice[:, 0, 2], twice[:, 1, 0]], axis=1) / 2
    sine = np.linalg.norm(axis, axis=1)
    cosine = (np.trace(turn, axis1=1, axis2=2) - 1) / 2
    angle = np.arctan2(sine, cosine) * share
    half = (cosine < 0) & (sine < 1e-6)
    if half.any():
        squares = (turn[half] + np.eye(3)) / 2
        rows = squares[np.arange(len(squares)), np.diagonal(squares, axis1=1, axis2=2).argmax(axis=1)]
        axis[half] = rows
    length = np.linalg.norm(axis, axis=1, keepdims=True)
    x, y, z = (axis / np.where(length > 0, length, 1.0)).T
    zero = np.zeros_like(x)
    cross = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    sine, cosine = (part[:, None, None] for part in (np.sin(angle), np.cos(angle)))
    return np.eye(3) + cross * sine + cross @ cross * (1 - cosine)
