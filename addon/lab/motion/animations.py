# SPDX-License-Identifier: GPL-3.0-or-later
"""Animations made by script: an armature, a wave, rigid instances, an explosion, and objects that come and go."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from ...core.base.arrays import F32, F64, I32
from ...core.scene.workload import View

UP = np.array([0.0, 0.0, 1.0])

PERIOD = 60.0
"""Frames of one turn of all periodic motions."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """The triangles of one frame. vertices: (n, 3) float32. triangles: (m, 3) int32."""

    vertices: F32
    triangles: I32


@dataclass(frozen=True, eq=False)
class Animation:
    """Triangles over time. frame: returns those of a frame, which may have any number. view: the same in all frames."""

    name: str
    frame: Callable[[int], Mesh]
    view: View


def _grid(rows: int, columns: int) -> I32:
    """Two triangles for each cell of a grid of rows × columns cells, by the numbers of its points."""
    corner = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).reshape(-1)
    quads = corner[:, None] + np.array([0, 1, columns + 1, columns + 2])
    return np.ascontiguousarray(np.concatenate([quads[:, [0, 1, 2]], quads[:, [3, 2, 1]]]), np.int32)


def _turns(angles: F64) -> F64:
    """Rotations about the z axis: (n, 3, 3)."""
    found = np.zeros((len(angles), 3, 3))
    found[:, 0, 0] = found[:, 1, 1] = np.cos(angles)
    found[:, 1, 0] = np.sin(angles)
    found[:, 0, 1] = -found[:, 1, 0]
    found[:, 2, 2] = 1.0
    return found


def armature(frame: int, around: int = 64, along: int = 96, bones: int = 6) -> Mesh:
    """A tube that a chain of bones bends, each vertex weighted by the two nearest bones (linear blend skinning)."""
    angle, height = np.meshgrid(np.linspace(0, 2 * np.pi, around + 1), np.linspace(0, bones, along + 1), indexing="xy")
    rest = np.stack([0.4 * np.cos(angle), height, 0.4 * np.sin(angle)], -1).reshape(-1, 3)
    # Chain the rotations of the bones; each begins where the last one ends.
    bend = 0.5 * np.sin(2 * np.pi * frame / PERIOD + 0.7 * np.arange(bones))
    turns = _turns(np.cumsum(bend))
    joints = np.concatenate([np.zeros((1, 3)), np.cumsum(turns[:, :, 1], axis=0)])
    # Blend the places of both bones.
    place = rest[:, 1] - 0.5
    first = np.clip(np.floor(place), 0, bones - 1).astype(int)
    second = np.minimum(first + 1, bones - 1)
    weight = np.clip(place - first, 0, 1)[:, None]
    moved = [
        np.einsum("nij,nj->ni", turns[bone], rest - np.stack([0 * place, bone, 0 * place], -1)) + joints[bone]
        for bone in (first, second)
    ]
    return Mesh(((1 - weight) * moved[0] + weight * moved[1]).astype(np.float32), _grid(along, around))


def wave(frame: int, side: int = 80) -> Mesh:
    """A cloth of side × side cells over which waves run."""
    x, y = np.meshgrid(np.linspace(-3, 3, side + 1), np.linspace(-3, 3, side + 1), indexing="ij")
    phase = 2 * np.pi * frame / PERIOD
    z = 0.4 * np.sin(2 * x + phase) + 0.25 * np.sin(3 * y - phase) + 0.1 * np.sin(5 * (x + y) + 2 * phase)
    return Mesh(np.stack([x, y, z], -1).reshape(-1, 3).astype(np.float32), _grid(side, side))


@cache
def _rock() -> tuple[F64, I32]:
    """A small closed mesh of 12 triangles: points (8, 3) around the origin."""
    points = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    return points, np.array([part for a, b, c, d in quads for part in ((a, b, c), (a, c, d))], np.int32)


def instances(frame: int, count: int = 1000) -> Mesh:
    """1,000 rigid copies of a box, each of which turns about itself and circles about the middle."""
    random = np.random.default_rng(5)
    points, triangles = _rock()
    radius, speed, start, height = random.uniform((0.3, -2, 0, -1.5), (3, 2, 2 * np.pi, 1.5), (count, 4)).T
    time = 2 * np.pi * frame / PERIOD
    angle = start + speed * time
    centres = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], -1)
    sizes = random.uniform(0.02, 0.08, (count, 1, 3))
    placed = np.einsum("nij,npj->npi", _turns(3 * speed * time), sizes * points) + centres[:, None]
    offsets = len(points) * np.arange(count, dtype=np.int32)[:, None, None]
    return Mesh(placed.reshape(-1, 3).astype(np.float32), (triangles + offsets).reshape(-1, 3))


def explosion(frame: int, side: int = 44) -> Mesh:
    """A ball whose triangles fly apart, each on its own, faster and faster."""
    random = np.random.default_rng(6)
    polar, angle = np.meshgrid(np.linspace(0.02, np.pi - 0.02, side + 1), np.linspace(0, 2 * np.pi, 2 * side + 1))
    ball = np.stack([np.sin(polar) * np.cos(angle), np.sin(polar) * np.sin(angle), np.cos(polar)], -1).reshape(-1, 3)
    corners = ball[_grid(2 * side, side)]
    speeds = random.uniform(0.2, 1.0, (len(corners), 1, 1)) * corners.mean(1, keepdims=True)
    speeds = speeds + random.normal(0, 0.1, speeds.shape)
    moved = corners + speeds * (frame / 20) ** 2
    return Mesh(moved.reshape(-1, 3).astype(np.float32), np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3))


def appearing(frame: int, most: int = 300) -> Mesh:
    """Boxes that circle; every tenth frame their number changes, so the triangles of the frame before are others."""
    return instances(frame, most - 20 * (frame // 10 % 5))


_ALL: dict[str, tuple[Callable[[int], Mesh], View]] = {
    "armature": (
        armature,
        View(np.array([0.0, 3.0, 13.0]), np.array([0.0, 3.0, 0.0]), np.array([0.0, 1.0, 0.0]), 40.0),
    ),
    "wave": (wave, View(np.array([4.0, -6.0, 4.0]), np.zeros(3), UP, 40.0)),
    "instances": (instances, View(np.array([4.0, -6.0, 4.0]), np.zeros(3), UP, 45.0)),
    "explosion": (explosion, View(np.array([3.0, -9.0, 4.0]), np.zeros(3), UP, 45.0)),
    "appearing": (appearing, View(np.array([4.0, -6.0, 4.0]), np.zeros(3), UP, 45.0)),
}

NAMES = tuple(_ALL)
"""Names of the built-in animations that are measured if none is named."""

_LARGE: dict[str, tuple[Callable[[int], Mesh], View]] = {"cloth": (partial(wave, side=224), _ALL["wave"][1])}

LARGE = tuple(_LARGE)
"""Names of further ones, which take longer: the wave of 100,352 triangles."""


def built_in(name: str) -> Animation:
    """A built-in animation; its frames are numbered from 0."""
    frame, view = (_ALL | _LARGE)[name]
    return Animation(name, frame, view)
