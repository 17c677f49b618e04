# SPDX-License-Identifier: GPL-3.0-or-later
"""One Blender mesh as arrays, and many placed meshes as one. No Python code runs per vertex or triangle.

`foreach_get` copies memory directly only if the array's type is the stored one (float32; int32 for attributes; uint32
for triangle corners) and the property is a plain array; otherwise it converts item by item, a hundred times slower.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.base import native
from ...core.base.arrays import F32, F64, I32
from ...core.base.steps import Steps
from ...core.scene.instances import TOPS, InstancedGeometry, Mesh
from ...core.scene.scene import Geometry, SceneError, Source
from . import layers as texture_layers
from .object_values import MASK, Value, are_regular, as_sheet

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...core.base.notes import Notes

MOST_TRIANGLES = 1 << 29
"""Largest number of triangles of a scene; most trees accept at most half of it."""

FEWER = "use fewer different attributes in materials"
"""Advice if the scene would fit into memory without the layers of its materials."""

BLOCK = 1 << 14
"""Number of vectors that are transformed at a time."""

UNBOUNDED = np.float32(2.0**63)
"""Coordinates from here on count as infinite. Derived: squared distances between them overflow float32, so their
triangles can neither be measured nor shaded. Blender's properties store infinity as the largest float, of which
modifiers make fractions.
"""

NORMALS_FLAT, NORMALS_VERTEX, NORMALS_CORNER = "FACE", "POINT", "CORNER"


@dataclass(frozen=True, eq=False)
class MeshArrays:
    """A mesh in its own space.

    positions: (n, 3) float32, infinite from UNBOUNDED on. triangles: (m, 3) int32 into positions. slots: (m,) int32
    material slots, or None if all are 0. normals: (k, 3) float32 as stored by Blender, one per vertex or per face
    corner, None for flat; normal_rows: (m, 3) integers into normals. uvs: (m, 3, 2) float32 or None. layers: see
    `layers.read_layers`. box: its texture space, see `layers.box`. lost: number of stored normals that were not finite,
    in whose place are those of the triangles.
    """

    positions: F32
    triangles: I32
    slots: I32 | None
    normals: F32 | None
    normal_rows: NDArray[Any] | None
    uvs: F32 | None
    layers: dict[texture_layers.Key, F32] = field(default_factory=dict)
    box: tuple[tuple[float, ...], tuple[float, ...]] = ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    lost: int = 0

    @cached_property
    def bounds(self) -> F64 | None:
        """The lowest and the highest finite coordinates, (2, 3); None without any."""
        box = texture_layers.extremes(self.positions)
        if np.isfinite(box).all():
            return box
        finite = self.positions[np.isfinite(self.positions).all(axis=1)]
        return texture_layers.extremes(finite) if len(finite) else None

    @cached_property
    def alone(self) -> Mesh:
        """The mesh without what materials read."""
        normals = None if self.normals is None else self.normals.take(self.normal_rows, axis=0, mode="clip")
        return Mesh(self.positions, np.ascontiguousarray(self.triangles, np.int32), self.slots, normals)


def read_mesh(mesh: Any, *, uvs: bool = False, layers: Sequence[texture_layers.Key] = ()) -> Steps[MeshArrays]:
    """Copy the render data of an evaluated `bpy.types.Mesh`, an attribute at a time; with `uvs` also the active render
    UV map.
    """
    positions = _positions(mesh).reshape(-1, 3)
    bounded = _bound(positions)
    yield
    corner_vertices = _attribute(mesh, ".corner_vert", np.int32, len(mesh.loops))
    yield
    corners = _read(mesh.loop_triangles, "loops", np.uint32, len(mesh.loop_triangles) * 3).astype(np.intp)
    yield
    triangles = corner_vertices.take(corners).reshape(-1, 3)
    yield

    # Read material slots; a mesh with slot 0 only needs none.
    slots = None
    if "material_index" in mesh.attributes:
        face_slots = _attribute(mesh, "material_index", np.int32, len(mesh.polygons))
        faces = _read(mesh.loop_triangle_polygons, "value", np.int32, len(triangles))
        slots = face_slots.take(faces) if face_slots.any() else None
        yield

    # Read normals where Blender's shading is smooth.
    normals, normal_rows = None, None
    if len(triangles) and mesh.normals_domain == NORMALS_VERTEX:
        normals = _read(mesh.vertex_normals, "vector", np.float32, len(mesh.vertices) * 3).reshape(-1, 3)
        normal_rows = triangles
    elif len(triangles) and mesh.normals_domain == NORMALS_CORNER:
        normals = _read(mesh.corner_normals, "vector", np.float32, len(mesh.loops) * 3).reshape(-1, 3)
        normal_rows = corners.reshape(-1, 3)
    yield

    lost = 0
    if normals is not None and normal_rows is not None and not np.isfinite(texture_layers.extremes(normals)).all():
        lost = _repair(normals, normal_rows, positions, triangles) if bounded else 0
        normals[~np.isfinite(normals).all(axis=1)] = 0

    # Read the UV map and the layers of materials.
    uv_map = next((layer for layer in mesh.uv_layers if layer.active_render), None) if uvs else None
    uv = None
    if uv_map is not None:
        by_corner = _read(uv_map.uv, "vector", np.float32, len(mesh.loops) * 2).reshape(-1, 2)
        uv = by_corner.take(corners, axis=0).reshape(-1, 3, 2)
        yield
    found = yield from texture_layers.read_layers(mesh, layers)
    box = texture_layers.box(mesh) if bounded else texture_layers.box_around(positions)
    return MeshArrays(positions, triangles, slots, normals, normal_rows, uv, found, box, lost)


def _repair(normals: F32, rows: NDArray[Any], positions: F32, triangles: I32) -> int:
    """Replace stored normals that are not finite by the mean of those of the triangles there. Returns their number."""
    bad = ~np.isfinite(normals).all(axis=1)
    around = bad[rows].any(axis=1)
    a, b, c = (positions[triangles[around, k]].astype(np.float64) for k in range(3))
    total = np.zeros((len(normals), 3))
    np.add.at(total, rows[around], np.cross(b - a, c - a)[:, None])
    normals[bad] = _unit(total[bad])
    return int(np.count_nonzero(bad))


def _positions(mesh: Any) -> NDArray[Any]:
    if not len(mesh.vertices):  # an empty mesh lacks even this attribute
        return np.zeros(0, np.float32)
    return _read(mesh.attributes["position"].data, "vector", np.float32, len(mesh.vertices) * 3)


def _bound(positions: F32) -> bool:
    """Make coordinates beyond UNBOUNDED infinite. Returns whether all were finite and below it."""
    if not len(positions) or (np.abs(texture_layers.extremes(positions)) < UNBOUNDED).all():
        return True
    beyond = np.abs(positions) >= UNBOUNDED
    positions[beyond] = np.copysign(np.inf, positions[beyond])
    return False


def _attribute(mesh: Any, name: str, dtype: Any, count: int) -> NDArray[Any]:
    if count == 0:  # a mesh without corners has no corner attributes
        return np.zeros(0, dtype)
    return _read(mesh.attributes[name].data, "value", dtype, count)


def _read(collection: Any, name: str, dtype: Any, count: int) -> NDArray[Any]:
    array = np.empty(count, dtype)
    if count:
        collection.foreach_get(name, array)
    return array


def usable(matrix: F64, name: str, notes: Notes) -> F64 | None:
    """The transform of an instance of the object of this name, made regular; None, with a note, if it cannot be."""
    if not np.isfinite(matrix).all():
        notes.add("Dropped, the transform is not finite", name)
        return None
    sheet = as_sheet(matrix)
    if sheet is None:
        notes.add("Dropped, the transform collapses the object to a line or a point (scale 0)", name)
    return sheet


@dataclass(eq=False)
class Placement:
    """A mesh and all its instances with the same materials.

    materials: (slots,) int32, the scene's material for each slot, at least one; slots beyond the last use the last, as
    in Blender. names: the k objects. transforms: k times (4, 4) float64, mesh to world, regular. values: for each
    object those that materials read, see `object_values`. keys: names and Blender's hashes of the instances, which do
    not depend on the order of its lists and stay over time. frames: (j, 4, 4) float64, the spaces of objects to the
    world, each of k / j successive instances; None if they are the transforms.
    """

    mesh: MeshArrays
    materials: I32
    names: list[str] = field(default_factory=list)
    transforms: list[F64] | F64 = field(default_factory=list)
    values: list[tuple[Value, ...]] = field(default_factory=list)
    keys: list[tuple[str, int]] = field(default_factory=list)
    frames: F64 | None = None

    def add(self, name: str, number: int, matrix: F64, values: tuple[Value, ...]) -> None:
        """Add an instance by the name of its object and its random number; the last one before `sort`, or the first use
        of `matrices`.
        """
        assert isinstance(self.transforms, list)
        self.names.append(name)
        self.transforms.append(matrix)
        self.values.append(values)
        self.keys.append((name, number & MASK))

    def keep_usable(self, notes: Notes) -> None:
        """Make all transforms regular, before `sort`; instances whose transform cannot be are dropped, with a note."""
        assert isinstance(self.transforms, list)
        for row in np.flatnonzero(~are_regular(np.stack(self.transforms)))[::-1].tolist():
            matrix = usable(self.transforms[row], self.names[row], notes)
            if matrix is not None:
                self.transforms[row] = matrix
                continue
            for each in (self.names, self.transforms, self.values, self.keys):
                del each[row]

    def sort(self) -> None:
        """Bring the instances into the order of their keys."""
        order = sorted(range(len(self.keys)), key=self.keys.__getitem__)
        for each in (self.names, self.transforms, self.values, self.keys):
            each[:] = [each[i] for i in order]

    @cached_property
    def matrices(self) -> F64:
        """The transforms, (k, 4, 4)."""
        return np.stack(self.transforms) if isinstance(self.transforms, list) else self.transforms


def assemble(
    placements: list[Placement],
    *,
    uvs: bool = False,
    layers: Sequence[texture_layers.Key] = (),
    objects: bool = False,
    origin: F64 | None = None,
) -> Geometry:
    """All placements as one geometry, with its origin at the centre of the box around the boxes of the placed meshes,
    unless it is given.

    layers: corner attributes that materials read. objects: whether materials need object frames. Raises SceneError.
    """
    placements = [placement for placement in placements if len(placement.mesh.triangles)]
    if not placements:
        return Geometry.empty()
    origin = _centre(placements) if origin is None else origin
    vertex_count = sum(len(p.names) * len(p.mesh.positions) for p in placements)
    triangle_count = sum(len(p.names) * len(p.mesh.triangles) for p in placements)
    smooth = any(p.mesh.normals is not None for p in placements)
    # A layer covers all triangles of the scene, even if only one mesh has it.
    read = 12 * sum(texture_layers.width((p.mesh for p in placements), key) for key in layers) * triangle_count
    plain = 12 * vertex_count + (16 + 36 * smooth + 24 * uvs) * triangle_count
    _check_room(triangle_count, plain, read, repeated=any(len(p.names) > 1 for p in placements))
    vertices = np.empty((vertex_count, 3), np.float32)
    triangles = np.empty((triangle_count, 3), np.int32)
    material_index = np.empty(triangle_count, np.int32)
    corner_normals = np.empty((triangle_count, 3, 3), np.float32) if smooth else None
    uv = np.full((triangle_count, 3, 2), np.nan, np.float32) if uvs else None

    sources, copies = [], []
    v = t = 0
    # Write all instances of each mesh into their rows of the common arrays.
    for placement in placements:
        mesh, places = placement.mesh, len(placement.names)
        n, m = len(mesh.positions), len(mesh.triangles)
        vertex_rows = slice(v, v + places * n)
        triangle_rows = slice(t, t + places * m)
        mirrored = np.linalg.det(placement.matrices[:, :3, :3]) < 0

        # Transform the vertices, and number the corners after those of earlier meshes.
        placed = vertices[vertex_rows].reshape(places, n, 3)
        _transform(mesh.positions, placement.matrices, origin, out=placed)
        corners = triangles[triangle_rows].reshape(places, m, 3)
        np.add(mesh.triangles, (v + n * np.arange(places, dtype=np.int32))[:, None, None], out=corners)
        _flip(corners, mirrored)
        material_index[triangle_rows].reshape(places, m)[:] = _materials(mesh, placement.materials)
        # Write shading normals: flat meshes get their face normals if any other mesh is smooth.
        if corner_normals is not None:
            placed_normals = corner_normals[triangle_rows].reshape(places, m, 3, 3)
            if mesh.normals is None:
                _face_normals(vertices, corners, out=placed_normals)
            else:
                _corner_normals(placement, mirrored, out=placed_normals)
        if uv is not None and mesh.uvs is not None:
            placed_uv = uv[triangle_rows].reshape(places, m, 3, 2)
            placed_uv[:] = mesh.uvs
            _flip(placed_uv, mirrored)

        # Record the mesh's place in the arrays.
        copies.append((mesh, mirrored))
        sources.append(Source(t, m, tuple(placement.names)))
        v, t = vertex_rows.stop, triangle_rows.stop
    sizes = [source.count for source in sources for _ in source.names]
    return Geometry(
        vertices,
        triangles,
        material_index,
        corner_normals,
        uv,
        texture_layers.assemble_layers(copies, layers),
        texture_layers.object_frames(placements, origin) if objects else (),
        np.repeat(np.arange(len(sizes), dtype=np.uint32), sizes) if objects else None,
        origin,
        tuple(sources),
    )


def _check_room(triangles: int, plain: int, read: int, *, repeated: bool) -> None:
    """Raise SceneError if the flattened triangles exceed the numbering of trees or the free memory.

    plain, read: bytes without and for the layers of materials. repeated: whether a mesh has several instances.
    """
    free = native.load().free_memory()
    if triangles <= MOST_TRIANGLES and plain + read <= free:
        return
    if triangles <= MOST_TRIANGLES and plain <= free:
        advice = FEWER
    else:
        advice = "keep the instances in two levels" if repeated else "use fewer triangles"
    raise SceneError(
        f"Every copy of every instance together: {triangles:,} triangles, {(plain + read) / 2**30:.1f} GiB, "
        f"do not fit; {advice}"
    )


def keep_instances(
    placements: list[Placement],
    *,
    uvs: bool = False,
    layers: Sequence[texture_layers.Key] = (),
    objects: bool = False,
    origin: F64 | None = None,
    top: str = TOPS[0],
) -> InstancedGeometry:
    """All placements with each mesh once, with the origin and the triangle order of `assemble`, and its options.

    top: of `InstancedGeometry`.
    """
    placements = [placement for placement in placements if len(placement.mesh.triangles)]
    if origin is None:
        origin = _centre(placements) if placements else np.zeros(3)
    numbers: dict[int, int] = {}
    kept: list[Mesh] = []
    once: list[tuple[MeshArrays, NDArray[np.bool_]]] = []
    for placement in placements:
        mesh = placement.mesh
        if id(mesh) not in numbers:
            numbers[id(mesh)] = len(kept)
            once.append((mesh, np.zeros(1, np.bool_)))
            kept.append(mesh.alone)
    size = sum(len(mesh.triangles) for mesh in kept)
    read = size * (24 * uvs + 12 * sum(texture_layers.width((mesh for mesh, _ in once), key) for key in layers))
    if read > native.load().free_memory():
        raise SceneError(f"What materials read of {size:,} triangles, {read / 2**30:.1f} GiB, does not fit; {FEWER}")
    # Repeat the data of each placement for all its instances.
    places = [len(placement.names) for placement in placements]
    mesh_numbers = np.array([numbers[id(placement.mesh)] for placement in placements], np.int32)
    slots = np.repeat([len(placement.materials) for placement in placements], places)
    return InstancedGeometry(
        meshes=tuple(kept),
        mesh=np.repeat(mesh_numbers, places),
        names=tuple(name for placement in placements for name in placement.names),
        materials=_stacked([np.tile(p.materials, n) for p, n in zip(placements, places, strict=True)], (), np.int32),
        first_material=np.concatenate([[0], np.cumsum(slots)]).astype(np.int32),
        origin=origin,
        uvs=_stacked([_uvs(mesh) for mesh, _ in once], (3, 2), np.float32) if uvs else None,
        layers=texture_layers.assemble_layers(once, layers),
        top=top,
        **_places(placements, origin, objects=objects),
    )


def moved(placements: list[Placement], geometry: InstancedGeometry) -> InstancedGeometry:
    """The geometry of the same instances at the places of these placements."""
    placements = [placement for placement in placements if len(placement.mesh.triangles)]
    return replace(geometry, **_places(placements, geometry.origin, objects=bool(geometry.objects)))


def _places(placements: list[Placement], origin: F64, *, objects: bool) -> dict[str, Any]:
    """The fields of an InstancedGeometry that depend on transforms."""
    turns = [_normal_matrices(placement.matrices[:, :3, :3]) for placement in placements]
    keeps_length = [np.full(len(turn), keeps) for turn, keeps in turns]
    matrices = _stacked([placement.matrices for placement in placements], (4, 4), np.float64)
    matrices[:, :3, 3] -= origin
    return {
        "matrices": matrices,
        "normal_matrices": _stacked([turn.transpose(0, 2, 1) for turn, _ in turns], (3, 3), np.float32),
        "keeps_length": _stacked(keeps_length, (), np.bool_),
        "objects": texture_layers.object_frames(placements, origin) if objects else (),
    }


def _uvs(mesh: MeshArrays) -> F32:
    """The UVs of a mesh; NaN if it has none."""
    return np.full((len(mesh.triangles), 3, 2), np.nan, np.float32) if mesh.uvs is None else mesh.uvs


def _stacked(parts: list[Any], shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
    """One C-ordered array of all parts, of which there may be none."""
    return np.ascontiguousarray(np.concatenate([np.zeros((0, *shape), dtype), *parts]), dtype)


def _centre(placements: list[Placement]) -> F64:
    """The centre of the box around all placed boxes; non-finite positions are ignored."""
    lows, highs = [], []
    for placement in placements:
        box = placement.mesh.bounds
        if box is None:
            continue
        corners = np.stack(np.meshgrid(*box.T, indexing="ij"), axis=-1).reshape(-1, 3)
        world = corners @ placement.matrices[:, :3, :3].transpose(0, 2, 1) + placement.matrices[:, None, :3, 3]
        lows.append(world.min(axis=(0, 1)))
        highs.append(world.max(axis=(0, 1)))
    if not lows:
        return np.zeros(3)
    return (np.min(lows, axis=0) + np.max(highs, axis=0)) / 2


def _transform(positions: F32, matrices: F64, origin: F64, *, out: F32) -> None:
    """Place (n, 3) positions k times in f64, relative to `origin`, and round once into `out` (k, n, 3)."""
    with np.errstate(over="ignore", invalid="ignore"):
        _multiply(positions, matrices[:, :3, :3].transpose(0, 2, 1), matrices[:, :3, 3] - origin, out=out)


def _products(vectors: F32, matrices: F32) -> F32:
    """Row vectors (n, 3) multiplied by each of (k, 3, 3) matrices, (k, n, 3)."""
    products = np.empty((len(matrices), len(vectors), 3), np.float32)
    _multiply(vectors, matrices, np.full((len(matrices), 3), -0.0, np.float32), out=products)
    return products


def _multiply(vectors: F32, matrices: NDArray[Any], offsets: NDArray[Any], *, out: F32) -> None:
    """Multiply row vectors (n, 3) by each of (k, 3, 3) matrices and add (k, 3) offsets, in the type of both, and round
    the sums into `out`, (k, n, 3).

    Written out, because `@` passes thin arrays to a threaded BLAS, which takes 1 to 200 ms for half a million rows
    depending on other load (measured); in blocks that fit into the processor's cache.
    """
    for start in range(0, len(vectors), BLOCK):
        x, y, z = np.ascontiguousarray(vectors[start : start + BLOCK].T)
        for column in range(3):
            sums = x * matrices[:, 0, column, None]
            sums += y * matrices[:, 1, column, None]
            sums += z * matrices[:, 2, column, None]
            sums += offsets[:, column, None]
            out[:, start : start + BLOCK, column] = sums


def _flip(corners: NDArray[Any], mirrored: NDArray[np.bool_]) -> None:
    """Swap the last two corners (axis 2) of the triangles in mirrored instances, which keeps their front side."""
    if mirrored.any():
        corners[mirrored, :, 1:] = corners[mirrored, :, :0:-1]


def _materials(mesh: MeshArrays, materials: I32) -> NDArray[Any]:
    if mesh.slots is None:
        return materials[0]
    return materials.take(mesh.slots, mode="clip")


def _face_normals(vertices: F32, corners: I32, *, out: F32) -> None:
    """The shading normals of flat triangles with these (k, m, 3) corners: the geometric ones, (k, m, 3, 3), unit
    length. Zero where a corner is not finite: no ray hits such a triangle.
    """
    a, b, c = (vertices[corners[..., i]].astype(np.float64) for i in range(3))
    with np.errstate(over="ignore", invalid="ignore"):
        normals = _unit(np.cross(b - a, c - a))
    normals[~np.isfinite(normals).all(axis=-1)] = 0
    out[:] = normals[:, :, None]


def _corner_normals(placement: Placement, mirrored: NDArray[np.bool_], *, out: F32) -> None:
    """The shading normals of a smooth mesh in all its instances, (k, m, 3, 3), unit length.

    Transformed as stored and gathered afterwards, because meshes have fewer normals than triangle corners.
    """
    assert placement.mesh.normals is not None
    assert placement.mesh.normal_rows is not None
    matrices, keeps_lengths = _normal_matrices(placement.matrices[:, :3, :3])
    world = _products(placement.mesh.normals, matrices)
    if not keeps_lengths:
        world = _unit(world)
    rows = placement.mesh.normal_rows[None]
    places, count = world.shape[:2]
    if places > 1:
        rows = rows + (count * np.arange(places))[:, None, None]
    if mirrored.any():
        rows = rows.copy()
        _flip(rows, mirrored)
    world.reshape(-1, 3).take(rows.reshape(-1), axis=0, out=out.reshape(-1, 3), mode="clip")


def _normal_matrices(linear: F64) -> tuple[F32, bool]:
    """Matrices for row vectors that are normals, (k, 3, 3), and whether all of them preserve lengths.

    A normal is a covector: it transforms by the inverse transpose, also in mirrored instances.
    """
    inverse = np.linalg.inv(linear)
    inverse /= np.linalg.norm(inverse, axis=1).max(axis=1)[:, None, None]
    # Rotated, mirrored and uniformly scaled objects, nearly all, preserve lengths.
    keeps_lengths = np.allclose(inverse @ inverse.transpose(0, 2, 1), np.eye(3), atol=1e-6)
    return inverse.astype(np.float32), bool(keeps_lengths)


def _unit(vectors: NDArray[Any]) -> F32:
    """Vectors of unit length as float32, computed in their own type; zero vectors stay."""
    # Written out in the order of the native module, which computes the same for instances bit for bit.
    x, y, z = (vectors[..., axis] for axis in range(3))
    squares = x * x
    squares += y * y
    squares += z * z
    squares[squares == 0] = 1
    return (vectors / np.sqrt(squares)[..., None]).astype(np.float32, copy=False)
