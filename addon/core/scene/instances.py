# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry as Blender has it: each mesh once, and the places where it stands.

The alternative to `scene.Geometry`, which has every triangle in its place. Pictures are the same, bit for bit; memory
goes with the meshes instead of with the places, and an edit rebuilds only the trees of the meshes that it changed.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.arrays import F32, F64, I32
from .scene import Geometry, SceneError, check, faulty

if TYPE_CHECKING:
    from numpy.typing import NDArray

TREE_BYTES = 160
"""What a structure takes per triangle, roughly: leaves name a triangle two or three times, 40 bytes each."""

PLACE_BYTES = 600
"""What an instance takes, here and in the native module: its matrices, box and name."""

WORTH = 256 << 20
"""Two levels are chosen for a picture when they save this many bytes: rays are slower through them."""

LARGE = 100_000
"""In the viewport they are chosen from this many triangles on, because an edit rebuilds only what it changed."""

MODES = ("auto", "flatten", "two-level")


@dataclass(frozen=True, eq=False)
class Mesh:
    """A mesh in its own space.

    vertices: (n, 3) float32. triangles: (m, 3) int32. slots: (m,) int32, the material slot of each triangle, None when
    all are 0. corner_normals: (m, 3, 3) float32, None for flat. Raises SceneError.
    """

    vertices: F32
    triangles: I32
    slots: I32 | None = None
    corner_normals: F32 | None = None

    def __post_init__(self) -> None:
        count = len(self.triangles)
        check("vertices", self.vertices, np.float32, (None, 3))
        check("triangles", self.triangles, np.int32, (None, 3))
        if self.slots is not None:
            check("slots", self.slots, np.int32, (count,))
        if self.corner_normals is not None:
            check("corner_normals", self.corner_normals, np.float32, (count, 3, 3))
        if count and not 0 <= int(self.triangles.min()) <= int(self.triangles.max()) < len(self.vertices):
            raise SceneError(f"triangles: an index is out of range for {len(self.vertices)} vertices")

    @cached_property
    def shape(self) -> bytes:
        """A digest of what a tree over the triangles depends on."""
        digest = hashlib.blake2b(digest_size=16)
        for array in (self.vertices, self.triangles):
            digest.update(str(array.shape).encode())
            digest.update(array.data if array.size else b"")
        return digest.digest()


@dataclass(frozen=True, eq=False)
class InstancedGeometry:
    """Meshes in places, in the scene frame.

    mesh: (k,) int32, which mesh stands there. matrices: (k, 4, 4) float64, mesh to scene frame. names: of the k
    objects. materials: (s,) int32 into the scene's, the slots of one instance after another; first_material: (k + 1,)
    int32, where each instance's begin. normal_matrices: (k, 3, 3) float32, what turns normals to the scene, row by row;
    keeps_length: (k,) bool, whether they stay unit vectors. origin: as in `Geometry`. Triangles are numbered as in the
    flattened geometry: all of the first instance, then all of the second. Raises SceneError.
    """

    meshes: tuple[Mesh, ...]
    mesh: I32
    matrices: F64
    names: tuple[str, ...]
    materials: I32
    first_material: I32
    normal_matrices: F32
    keeps_length: NDArray[np.bool_]
    origin: F64 = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        count = len(self.names)
        check("mesh", self.mesh, np.int32, (count,))
        check("matrices", self.matrices, np.float64, (count, 4, 4))
        check("materials", self.materials, np.int32, (None,))
        check("first_material", self.first_material, np.int32, (count + 1,))
        check("normal_matrices", self.normal_matrices, np.float32, (count, 3, 3))
        check("keeps_length", self.keeps_length, np.bool_, (count,))
        check("origin", self.origin, np.float64, (3,))
        if count and not 0 <= int(self.mesh.min()) <= int(self.mesh.max()) < len(self.meshes):
            raise SceneError(f"mesh: an index is out of range for {len(self.meshes)} meshes")

    @property
    def count(self) -> int:
        """Triangles of all instances together."""
        per_mesh = np.array([len(mesh.triangles) for mesh in self.meshes], np.int64)
        return int(per_mesh[self.mesh].sum()) if len(self.mesh) else 0

    def same_triangles(self, other: InstancedGeometry) -> bool:
        """Whether a tree over the one is a tree over the other."""
        return (
            [mesh.shape for mesh in self.meshes] == [mesh.shape for mesh in other.meshes]
            and np.array_equal(self.mesh, other.mesh)
            and np.array_equal(self.matrices, other.matrices)
        )

    def runs(self) -> list[tuple[int, str]]:
        """How many triangles come from which object, in order."""
        sizes = [len(mesh.triangles) for mesh in self.meshes]
        return [(sizes[mesh], name) for mesh, name in zip(self.mesh.tolist(), self.names, strict=True)]

    def faulty_triangles(self) -> dict[str, int]:
        """How many triangles of each object can never be hit, as its mesh has them."""
        per_mesh = [int(np.count_nonzero(faulty(mesh.vertices, mesh.triangles))) for mesh in self.meshes]
        counts: dict[str, int] = {}
        for name, mesh in zip(self.names, self.mesh, strict=True):
            if per_mesh[mesh]:
                counts[name] = counts.get(name, 0) + per_mesh[mesh]
        return counts

    @property
    def size(self) -> int:
        """Triangles that trees have to be built over: those of each mesh once."""
        return sum(len(mesh.triangles) for mesh in self.meshes)

    def surfaces(self) -> dict[str, Any]:
        """What the renderer needs to know of them, as `native.RenderScene` takes it."""
        return {
            "meshes": [{"material_index": mesh.slots, "corner_normals": mesh.corner_normals} for mesh in self.meshes],
            "materials": self.materials,
            "first_material": self.first_material,
            "normal_matrix": self.normal_matrices,
            "keeps_length": self.keeps_length,
        }


AnyGeometry = Geometry | InstancedGeometry


@dataclass(frozen=True)
class Layout:
    """Whether a scene keeps its instances, and why, in one line."""

    two_level: bool
    reason: str


def choose(mode: str, meshes: list[tuple[int, int]], *, smooth: bool, interactive: bool) -> Layout:
    """Flatten or keep instances.

    mode: one of MODES. meshes: triangles and instances of each. smooth: whether normals are kept. interactive: for a
    viewport, whose scenes are edited.
    """
    flat = sum(triangles * places for triangles, places in meshes)
    unique = sum(triangles for triangles, _ in meshes)
    places = sum(count for _, count in meshes)
    each = TREE_BYTES + 2 * (12 + 6 + 4) + (2 * 36 if smooth else 0)
    saved = (flat - unique) * each - places * PLACE_BYTES
    if mode == "flatten" or not flat:
        return Layout(two_level=False, reason=f"instances: flattened, {flat:,} triangles")
    mebibytes = f"{abs(saved) / 2**20:,.0f} MiB"
    sizes = f"{unique:,} triangles in {places:,} places"
    if mode == "two-level":
        return Layout(two_level=True, reason=f"two levels: as set, {sizes}")
    if saved >= WORTH:
        return Layout(two_level=True, reason=f"two levels: {sizes}, which saves {mebibytes}")
    if interactive and flat >= LARGE:
        return Layout(two_level=True, reason=f"two levels: {sizes}; an edit rebuilds only what it changes")
    why = "two levels would save nothing" if saved <= 0 else f"two levels would save only {mebibytes}"
    return Layout(two_level=False, reason=f"instances: flattened, {flat:,} triangles, since {why} and rays are faster")
