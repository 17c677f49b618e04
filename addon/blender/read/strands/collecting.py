# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair and point clouds of a scene, with all their instances, made into triangles once all instances are known."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from ....core.base.arrays import F32
from ....core.base.steps import Steps
from ....core.scene import spheres, tubes
from .. import layers as texture_layers
from ..meshes import UNBOUNDED, MeshArrays, Placement
from ..value_nodes import STRAND, UV
from . import detail, sources

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ....core.base.notes import Notes
    from ..materials import Palette
    from ..object_values import Instance, Value
    from ..remembered import Remembered

T = TypeVar("T")

MOST_TRIANGLES = 1 << 23
"""Triangles of one object's hair or points. A constant, so that the picture does not depend on the machine."""

MERGED = 1 << 18
"""Triangles up to which the spheres of a point cloud are one mesh; more are instances of one sphere."""

MOST_INSTANCED = 1 << 27
"""Triangles of the instances of one cloud's sphere, of which only one is stored."""

Key = tuple[str, str, int]
"""The kind of an object's data, where the data is, and the number of its particle system."""


NOTHING = MeshArrays(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32), None, None, None, None)
"""The mesh of a placement before the detail of its curves or points is known."""


@dataclass(frozen=True, eq=False)
class _Round:
    """Curves or points, whose radii are given. name: of the first object. part: every part-th hair was read. last:
    what was made of it last, by name and by what that depends on.
    """

    name: str
    strands: tubes.Strands | None
    points: tuple[F32, F32] | None
    values: sources.Values
    part: int = 1
    last: dict[str, tuple[Hashable, Any]] = field(default_factory=dict)

    def made(self, what: str, of: Hashable, make: Callable[[], T]) -> T:
        """The result of `make`, or its last one if that depends on the same."""
        if what not in self.last or self.last[what][0] != of:
            self.last[what] = of, make()
        return self.last[what][1]  # type: ignore[no-any-return]


class Collector:
    """Reads hair and point clouds during one pass over the depsgraph's instances."""

    def __init__(self, depsgraph: Any, notes: Notes, palette: Palette, remembered: Remembered, *, uvs: bool) -> None:
        """palette: its layers are complete. uvs: whether the active UV map is needed."""
        self._remembered = remembered
        self.made: list[str] = []
        self.found: set[texture_layers.Key] = set()
        self._mode, self._view = depsgraph.mode, detail.pixels(depsgraph)
        self._notes, self._palette, self._layers, self._uvs = notes, palette, palette.layers, uvs
        self._read: dict[Key, _Round] = {}
        self._groups: dict[tuple[Key, tuple[int, ...]], tuple[_Round, Placement]] = {}

    def visit(self, instance: Instance, matrix: NDArray[Any], materials: tuple[int, ...]) -> Steps[None]:
        """Add an instance of a hair curves object or a point cloud. matrix: its transform, regular."""
        data, name = instance.item.data, instance.item.name_full
        key: Key = (instance.item.type, str(data.as_pointer()), 0)

        def read() -> Steps[_Round]:
            if instance.item.type == "CURVES":
                strands, values = yield from sources.read_curves(data, self._keys())
                return _Round(name, strands, None, values)
            centres, radii, values = yield from sources.read_points(data, self._keys())
            return _Round(name, None, (centres, radii), values)

        if key not in self._read:
            self._read[key] = replace((yield from self._remembered.of(key, instance, read)), name=name)
        self._place(key, materials, instance, matrix)

    def visit_hair(self, instance: Instance, matrix: NDArray[Any], materials: tuple[int, ...]) -> Steps[None]:
        """Add an instance of an object's particle hair, whose settings choose one of the object's materials."""
        item = instance.item
        for number, (modifier, system) in enumerate(sources.hair_systems(item, self._mode)):
            key: Key = ("HAIR", str(item.original.as_pointer()), number)

            def read(modifier: Any = modifier) -> Steps[_Round]:
                most = MOST_TRIANGLES // (2 * tubes.COARSER[-1])
                hair = yield from sources.read_hair(item, modifier, self._keys(), self._mode, most)
                return _Round(item.name_full, hair.strands, None, hair.values, hair.part)

            if key not in self._read:
                kept = yield from self._remembered.of(key, instance, read)
                found = self._read[key] = replace(kept, name=item.name_full)
                if found.part > 1:
                    self._note_part("hairs", found.part, found.name, MOST_TRIANGLES)
            slot = min(max(system.settings.material - 1, 0), len(materials) - 1)
            self._place(key, (materials[slot],), instance, matrix)

    def placements(self) -> list[Placement]:
        """All placements, in order of appearance; adds a line for each object to `made`."""
        made: list[Placement] = []
        for read, group in self._groups.values():
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                made += self._tubes(read, group) if read.strands is not None else self._spheres(read, group)
        self.found.update(key for placement in made for key in placement.mesh.layers)
        return made

    def _keys(self) -> list[texture_layers.Key]:
        keys: list[texture_layers.Key] = list(self._layers.keys)
        return keys if not self._uvs or (UV, "") in keys else [*keys, (UV, "")]

    def _place(self, key: Key, materials: tuple[int, ...], instance: Instance, matrix: NDArray[Any]) -> None:
        if (key, materials) not in self._groups:
            self._groups[key, materials] = self._read[key], Placement(NOTHING, np.array(materials, np.int32))
        _, group = self._groups[key, materials]
        group.add(instance.item.name_full, instance.number, matrix, instance.values(self._layers.object_values))

    def _note_part(self, what: str, part: int, name: str, most: int) -> None:
        text = f"Only one in {part} {what} is rendered, all together have more than {most:,} triangles"
        self._notes.add(text, name)

    def _note_faults(self, what: str, name: str, broken: int, negative: int) -> None:
        if broken:
            self._notes.add(f"Left out {what} with coordinates or radii that are not finite", name, broken)
        if negative:
            self._notes.add(f"Negative radii are rendered as 0, of {what}", name, negative)

    def _tubes(self, read: _Round, group: Placement) -> list[Placement]:
        """The placements of curves: none if nothing of them can be seen."""
        curves = read.strands
        assert curves is not None
        strands, broken, negative = read.made("usable", None, lambda: tubes.usable(curves, float(UNBOUNDED)))
        self._note_faults("hairs", read.name, broken, negative)
        if not len(strands.counts):
            return []
        # Decide on the detail of each curve by the size of a pixel at its ends.
        ends = np.stack([strands.points[strands.first[:-1]], strands.points[strands.first[1:] - 1]], axis=1)
        pixels = detail.sizes_within(self._view, ends.astype(np.float64), group.matrices)
        thickest = np.maximum.reduceat(strands.radii, strands.first[:-1])
        sides = tubes.sides_of(thickest.astype(np.float64), pixels)
        deviations = read.made("deviations", None, lambda: tubes.deviations(strands))
        fitting = self._fitting(read.name, strands, sides, tubes.pieces_of(strands, deviations, pixels))
        strands, sides, pieces = fitting
        wanted = (STRAND, "Tangent") in self._keys()

        def make() -> MeshArrays:
            # Compute all curves of the same detail together.
            detailed = sides * (tubes.MOST_PIECES + 1) + pieces
            parts = []
            for both in np.unique(detailed).tolist():
                n, m = divmod(both, tubes.MOST_PIECES + 1)
                parts.append(tubes.tubes(strands.chosen(detailed == both), m, n, directions=wanted))
            made = tubes.joined(parts)
            return self._mesh(made.positions, made.normals, made.triangles, _curve_layers(read.values, made))

        # A move of the object or of the camera often leaves the detail as it is.
        mesh = read.made("tubes", (sides.tobytes(), pieces.tobytes()), make)
        total = len(mesh.triangles)
        self.made.append(
            f"{read.name}: {len(sides):,} hairs as {total:,} triangles, tubes of "
            f"{_span(sides)} sides, {_span(pieces)} to a segment"
        )
        return [replace(group, mesh=mesh)]

    def _fitting(
        self, name: str, strands: tubes.Strands, sides: NDArray[np.int64], pieces: NDArray[np.int64]
    ) -> tuple[tubes.Strands, NDArray[np.int64], NDArray[np.int64]]:
        """Curves, sides and pieces with less detail, or fewer curves, if there would be too many triangles."""
        segments = strands.counts - 1
        for fewer in tubes.COARSER:
            if (segments * sides * pieces).sum() * 2 <= MOST_TRIANGLES:
                return strands, sides, pieces
            sides = np.minimum(sides, fewer)
        # All tubes have the fewest sides now.
        fit = MOST_TRIANGLES // (2 * tubes.COARSER[-1])
        pieces = np.clip(pieces, 1, max(fit // strands.segments, 1))
        part = -(-int((segments * pieces).sum()) // fit)
        if part > 1:
            self._note_part("hairs", part, name, MOST_TRIANGLES)
            keep = np.arange(len(sides)) % part == 0
            strands, sides, pieces = strands.chosen(keep), sides[keep], pieces[keep]
        return strands, sides, pieces

    def _spheres(self, read: _Round, group: Placement) -> list[Placement]:
        """The placements of points: one mesh of all spheres, or one sphere with an instance for each point."""
        assert read.points is not None
        centres, radii = read.points
        bound = float(UNBOUNDED)
        sound = (np.abs(centres) < bound).all(axis=1) & (np.abs(radii) < bound)
        self._note_faults("points", read.name, int((~sound).sum()), int((sound & (radii < 0)).sum()))
        rows = np.flatnonzero(sound & (radii > 0))
        if not len(rows):
            return []
        # Decide on one detail for all points; the largest sphere seen needs most.
        pixels = detail.sizes_within(self._view, centres[rows].astype(np.float64), group.matrices)
        level = spheres.level_of(1.0, float((pixels / radii[rows]).min()))
        while level > 1 and len(rows) * 20 * 4**level > MOST_TRIANGLES:
            level -= 1
        part = -(-len(rows) * 20 * 4**level // MOST_INSTANCED)
        if part > 1:
            self._note_part("points", part, read.name, MOST_INSTANCED)
            rows = rows[::part]
        total = len(rows) * 20 * 4**level
        self.made.append(f"{read.name}: {len(rows):,} points as {total:,} triangles, {20 * 4**level} to a sphere")
        if total > MERGED:
            return [self._instances(read, group, rows, level)]

        def make() -> MeshArrays:
            positions, normals, triangles = spheres.spheres(centres[rows], radii[rows], level)
            corners = rows[triangles // (len(positions) // len(rows))]
            layers = {key: np.ascontiguousarray(values[corners]) for key, values in read.values.of_points.items()}
            return self._mesh(positions, normals, triangles, layers)

        return [replace(group, mesh=read.made("spheres", (level, part), make))]

    def _instances(self, read: _Round, group: Placement, rows: NDArray[Any], level: int) -> Placement:
        """One sphere with an instance for each point, whose attributes are values of that instance."""
        assert read.points is not None
        centres, radii = (part[rows].astype(np.float64) for part in read.points)
        local = np.zeros((len(rows), 4, 4))
        local[:, [0, 1, 2], [0, 1, 2]] = radii[:, None]
        local[:, :3, 3], local[:, 3, 3] = centres, 1
        placed = np.einsum("pij,njk->pnik", group.matrices, local).reshape(-1, 4, 4)

        def make() -> MeshArrays:
            positions, normals, triangles = spheres.sphere(level)
            mesh = self._mesh(positions.astype(np.float32), normals.astype(np.float32), triangles.copy(), {})
            # Its texture space is that of all points.
            ends = centres[:, None] + radii[:, None, None] * texture_layers.extremes(positions)
            return replace(mesh, box=texture_layers.box_around(ends.reshape(-1, 3).astype(np.float32)))

        # Rows that were left out change the box.
        mesh = read.made("sphere", (level, rows.tobytes()), make)
        materials, values = self._with_values(read, group, rows)
        names = np.repeat(np.array(group.names, object), len(rows)).tolist()
        return Placement(mesh, materials, names, np.ascontiguousarray(placed), values, frames=group.matrices)

    def _with_values(
        self, read: _Round, group: Placement, rows: NDArray[Any]
    ) -> tuple[NDArray[np.int32], list[tuple[Value, ...]]]:
        """Materials that read what the points in these rows have as values of their instances, and these values."""
        of_points, wanted = read.values.of_points, self._palette.layers_of(group.materials.tolist())
        self.found |= wanted & of_points.keys()
        keys = sorted(wanted & of_points.keys())
        if not keys:
            own = group.values if any(group.values) else []
            return group.materials, [values for values in own for _ in rows]
        materials = self._palette.with_values(group.materials.tolist(), keys)
        columns = [self._layers.object_value(key) for key in keys]
        # Columns of points are behind all others, which an object may lack at the end.
        first = min(columns)
        table = np.zeros((len(rows), max(columns) + 1 - first, 4), np.float32)
        table[..., 3] = 1
        for column, key in zip(columns, keys, strict=True):
            table[:, column - first, : of_points[key].shape[1]] = of_points[key][rows]
        table[~np.isfinite(table)] = 0
        added: list[tuple[Value, ...]] = [tuple(map(tuple, row)) for row in table.tolist()]
        own = [values + ((0.0,) * 4,) * (first - len(values)) for values in group.values]
        return np.array(materials, np.int32), [values + more for values in own for more in added]

    def _mesh(
        self, positions: F32, normals: F32, triangles: NDArray[np.int32], layers: dict[texture_layers.Key, F32]
    ) -> MeshArrays:
        uvs = layers.get((UV, "")) if self._uvs else None
        own = {key: values for key, values in layers.items() if key in self._layers.keys}
        box = texture_layers.box_around(positions)
        return MeshArrays(
            positions, triangles, None, normals, triangles, None if uvs is None else uvs[..., :2].copy(), own, box
        )


def _curve_layers(values: sources.Values, made: tubes.Tubes) -> dict[texture_layers.Key, F32]:
    """The layers at the corners of the tubes' triangles."""
    layers: dict[texture_layers.Key, F32] = {}
    if not (values.of_points or values.of_curves or len(made.along)):
        return layers
    polygons = made.polygon_of_corner()
    for key, rows in values.of_points.items():
        share = made.share[:, None]
        if key == (STRAND, "Tangent"):
            at_polygons = tubes.tangents(rows[made.before], rows[made.after], made.share)
        else:
            at_polygons = rows[made.before] * (1 - share) + rows[made.after] * share
        layers[key] = at_polygons.take(polygons, axis=0)
    for key, rows in values.of_curves.items():
        layers[key] = rows.take(made.numbers.take(polygons), axis=0)
    if len(made.along):
        layers[STRAND, "Tangent"] = made.along.take(polygons, axis=0)
    return layers


def _span(numbers: Sequence[int] | NDArray[Any]) -> str:
    low, high = int(np.min(numbers)), int(np.max(numbers))
    return str(low) if low == high else f"{low} to {high}"
