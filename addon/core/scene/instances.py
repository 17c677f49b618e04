# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry as Blender stores it: each mesh once, and its instances.

The alternative to `scene.Geometry`, which stores every triangle of every instance. Pictures are equal bit for bit;
memory grows with the meshes instead of the instances, and an edit rebuilds only the trees of the meshes it changed.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.arrays import F32, F64, I32
from .faulty import faulty
from .scene import Geometry, ObjectFrame, SceneError, check, check_range

if TYPE_CHECKING:
    from numpy.typing import NDArray

TREE_BYTES = 160
"""Approximate bytes of a structure per triangle: leaves reference a triangle two or three times, 40 bytes each."""

PLACE_BYTES = 600
"""Bytes of an instance, here and in the native module: its matrices, box and name."""

WORTH = 256 << 20
"""Saved bytes from which two levels are chosen for a picture: rays are slower through them."""

LARGE = 100_000
"""Triangles from which two levels are chosen in the viewport, where an edit then rebuilds only what it changed."""

MODES = ("auto", "flatten", "two-level")

TOPS = ("sah", "grid", "middle", "median")
"""Ways to build the tree over the instances, see `build_instances` of the native module; the first is the default."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A mesh in its own space.

    vertices: (n, 3) float32. triangles: (m, 3) int32. slots: (m,) int32, material slot of each triangle, None if all
    are 0. corner_normals: (m, 3, 3) float32, None for flat shading. Raises SceneError.
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
        check_range("triangles", self.triangles, len(self.vertices), "vertices")

    @cached_property
    def shape(self) -> bytes:
        """A digest of the arrays that a tree over the triangles depends on."""
        digest = hashlib.blake2b(digest_size=16)
        for array in (self.vertices, self.triangles):
            digest.update(str(array.shape).encode())
            digest.update(array.data if array.size else b"")
        return digest.digest()


@dataclass(frozen=True, eq=False)
class InstancedGeometry:
    """Instances of meshes, in the scene frame.

    mesh: (k,) int32, index of each instance's mesh. matrices: (k, 4, 4) float64, mesh to scene frame. names: of the k
    objects. materials: (s,) int32, indices into the scene's materials, the slots of one instance after another;
    first_material: (k + 1,) int32, first slot of each instance. normal_matrices: (k, 3, 3) float32, normals to the
    scene frame, row by row; keeps_length: (k,) bool, whether they preserve length. origin: as in `Geometry`; uvs and
    layers also, but over the triangles of the meshes, mesh after mesh; objects: the frame of each instance, or empty.
    top: how the tree over the instances is built, one of TOPS. Triangles are numbered as in the flattened geometry: all
    of the first instance, then all of the second. Raises SceneError.
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
    uvs: F32 | None = None
    layers: tuple[F32 | None, ...] = ()
    objects: tuple[ObjectFrame, ...] = ()
    top: str = TOPS[0]

    def __post_init__(self) -> None:
        count = len(self.names)
        check("mesh", self.mesh, np.int32, (count,))
        check("matrices", self.matrices, np.float64, (count, 4, 4))
        check("materials", self.materials, np.int32, (None,))
        check("first_material", self.first_material, np.int32, (count + 1,))
        check("normal_matrices", self.normal_matrices, np.float32, (count, 3, 3))
        check("keeps_length", self.keeps_length, np.bool_, (count,))
        check("origin", self.origin, np.float64, (3,))
        for name, rows, numbers in [("uvs", self.uvs, 2), *(("layers", layer, None) for layer in self.layers)]:
            if rows is not None:
                check(name, rows, np.float32, (self.size, 3, numbers))
        if len(self.objects) not in (0, count):
            raise SceneError(f"objects: expected one of each of {count} instances, got {len(self.objects)}")
        check_range("mesh", self.mesh, len(self.meshes), "meshes")

    @property
    def count(self) -> int:
        """Triangles of all instances together."""
        per_mesh = np.array([len(mesh.triangles) for mesh in self.meshes], np.int64)
        return int(per_mesh[self.mesh].sum()) if len(self.mesh) else 0

    def same_triangles(self, other: InstancedGeometry) -> bool:
        """Whether a tree over one geometry is also a tree over the other."""
        return (
            [mesh.shape for mesh in self.meshes] == [mesh.shape for mesh in other.meshes]
            and np.array_equal(self.mesh, other.mesh)
            and np.array_equal(self.matrices, other.matrices)
            and self.top == other.top
        )

    def runs(self) -> list[tuple[int, str]]:
        """Number of triangles and name of each instance, in order."""
        sizes = [len(mesh.triangles) for mesh in self.meshes]
        return [(sizes[mesh], name) for mesh, name in zip(self.mesh.tolist(), self.names, strict=True)]

    def faulty_triangles(self) -> dict[str, int]:
        """Number of degenerate triangles per object, which can never be hit."""
        per_mesh = [int(np.count_nonzero(faulty(mesh.vertices, mesh.triangles))) for mesh in self.meshes]
        counts: dict[str, int] = {}
        for name, mesh in zip(self.names, self.mesh, strict=True):
            if per_mesh[mesh]:
                counts[name] = counts.get(name, 0) + per_mesh[mesh]
        return counts

    @property
    def size(self) -> int:
        """Triangles that trees are built over: those of each mesh once."""
        return sum(len(mesh.triangles) for mesh in self.meshes)

    def surfaces(self) -> dict[str, Any]:
        """The shading data of the instances, as the arguments of `native.RenderScene`."""
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
    """Whether a scene keeps its instances, and the reason in one line; "" for a scene without any."""

    two_level: bool
    reason: str = ""


def choose(mode: str, meshes: list[tuple[int, int]], *, numbers: int, interactive: bool, times: int = 1) -> Layout:
    """Decide whether to flatten or to keep instances.

    mode: one of MODES. meshes: triangles and instances of each mesh. numbers: float32 that shading stores per corner of
    a triangle. interactive: for a viewport, whose scene is edited. times: number of places that each instance takes
    while the shutter is open; with flattened geometry each has a tree of its own.
    """
    # Count triangles with and without instancing.
    flat = sum(triangles * places for triangles, places in meshes)
    unique = sum(triangles for triangles, _ in meshes)
    places = sum(count for _, count in meshes)
    # Estimate the bytes saved: tree, two copies of indices, vertices, slots and corners, less the instances' own.
    each = TREE_BYTES + 2 * (12 + 6 + 4) + 2 * 12 * numbers
    saved = (times * flat - unique) * each - times * places * PLACE_BYTES
    repeated = any(count > 1 for _, count in meshes)
    if mode == "flatten" or not flat:
        return Layout(two_level=False, reason=f"instances: flattened, {flat:,} triangles" if repeated else "")
    mebibytes = f"{abs(saved) / 2**20:,.0f} MiB"
    moving = f" at {times:,} times" if times > 1 else ""
    sizes = f"{unique:,} triangles in {places:,} places{moving}"
    if mode == "two-level":
        return Layout(two_level=True, reason=f"two levels: as set, {sizes}")
    if saved >= WORTH:
        return Layout(two_level=True, reason=f"two levels: {sizes}, which saves {mebibytes}")
    if interactive and flat >= LARGE:
        return Layout(two_level=True, reason=f"two levels: {sizes}; an edit rebuilds only what it changes")
    if not repeated:
        return Layout(two_level=False)
    why = "two levels would save nothing" if saved <= 0 else f"two levels would save only {mebibytes}"
    return Layout(two_level=False, reason=f"instances: flattened, {flat:,} triangles, since {why} and rays are faster")
