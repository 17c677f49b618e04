# SPDX-License-Identifier: GPL-3.0-or-later
"""Extraction of Blender's dependency graph into the arrays of `core.scene`, which keep no reference to
Blender's data.

The files that a vertex meets, in order: `instancing` yields the object that places it, `visibility.py` keeps it or not,
`object_meshes.py` gives the evaluated mesh, `meshes.py` its triangles, normals and place, `layers.py` UV maps and
attributes, `displacement` may move it, `core/scene/instances.py` chooses whether its mesh is instanced or flattened.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.base.arrays import F64
from ...core.base.notes import Notes
from ...core.base.steps import Steps, Stepwise
from ...core.scene.instances import TOPS, AnyGeometry, InstancedGeometry, Layout, choose
from ...core.scene.mattes import Mattes
from ...core.scene.scene import Geometry, Numbers, Scene
from . import lights, materials, meshes, remarks, view_layers, world
from .dicing import Dicer, Rate
from .displacement.applying import Displacer
from .identities import Identities
from .images import Gallery
from .instancing import Instancing
from .layers import width
from .linking import Linking
from .media import grids
from .object_meshes import MESH_TYPES, ObjectMeshes
from .object_values import DENSITY_SCALE, MASK, Instance, is_regular
from .remembered import Remembered
from .simplifying import Culling, texture_limit
from .standing import Standing, moves
from .strands.collecting import Collector
from .value_nodes.outputs import NOTHING, Wanted
from .visibility import Visibility

if TYPE_CHECKING:
    from ...core.scene.scene import Image, Light, World

CONVERTIBLE_TYPES = {"CURVE", "SURFACE", "FONT", "META"}
ROUND_TYPES = {"CURVES", "POINTCLOUD"}
SPLATS = "GAUSSIAN_SPLAT"

WAIT, LATER, NO_WORLD = "wait", "later", "no world"
"""Treatment of a Sky Texture that another Blender process must render first, see `find`."""


@dataclass(frozen=True)
class Found:
    """Everything read from the depsgraph, before meshes are placed.

    scene: without its geometry, and with lights in world space. layers, objects, apart: of `values.Layers`. made: lines
    on hair and points, which were made into triangles.
    """

    placements: list[meshes.Placement]
    scene: Scene
    layers: tuple[tuple[str, str], ...] = ()
    objects: bool = False
    apart: bool = False
    made: tuple[str, ...] = ()

    def layout(self, mode: str, *, integrator: str = "path", interactive: bool = False, times: int = 1) -> Layout:
        """Whether to keep instances, and the reason. times: number of places that each instance takes."""
        placed = [placement.mesh for placement in self.placements]
        sizes: dict[int, list[int]] = {}
        for placement in self.placements:
            triangles, places = len(placement.mesh.triangles), len(placement.names)
            sizes.setdefault(id(placement.mesh), [triangles, 0])[1] += places
        # Whitted's integrator flattens in any mode.
        if integrator == "whitted" and any(material.glows for material in self.scene.materials):
            why = "Whitted's integrator supports emissive meshes only without instancing"
            repeated = any(places > 1 for _, places in sizes.values())
            return Layout(two_level=False, reason=f"instances: flattened, since {why}" if repeated else "")
        # Count the numbers that a corner has: its normal and what materials read.
        smooth = any(mesh.normals is not None for mesh in placed)
        numbers = 3 * smooth + sum(width(placed, key) for key in self.layers)
        return choose(mode, [(a, b) for a, b in sizes.values()], numbers=numbers, interactive=interactive, times=times)

    def flattened(self, *, uvs: bool = False, origin: F64 | None = None) -> Scene:
        """The scene with every triangle of every instance. origin: that of the scene frame, if it is given."""
        return self._with(meshes.assemble(self.placements, uvs=uvs, **self._read(), origin=origin))

    def instanced(self, *, uvs: bool = False, origin: F64 | None = None, top: str = TOPS[0]) -> Scene:
        """The scene with every mesh once, and its instances. origin as for `flattened`, top: of `InstancedGeometry`."""
        return self._with(meshes.keep_instances(self.placements, uvs=uvs, **self._read(), origin=origin, top=top))

    def moved(self, scene: Scene) -> Scene:
        """A scene with its instances at these places; it has the same meshes and instances."""
        assert isinstance(scene.geometry, InstancedGeometry)
        return replace(scene, geometry=meshes.moved(self.placements, scene.geometry))

    def _read(self) -> dict[str, Any]:
        """Layers and objects that materials read."""
        return {"layers": self.layers, "objects": self.objects or self.apart}

    def _with(self, geometry: AnyGeometry) -> Scene:
        moved = tuple(lights.moved(light, geometry.origin) for light in self.scene.lights)
        return replace(self.scene, geometry=geometry, lights=moved)


def extract(depsgraph: Any, notes: Notes, *, uvs: bool = False, sky: str = "") -> Scene:
    """The scene as the depsgraph's mode (viewport or render) shows it, flattened.

    Reads as `find` does. Geometry is in the frame of `Scene.geometry.origin`.
    """
    return find(depsgraph, notes, uvs=uvs, sky=sky).flattened(uvs=uvs)


def find(
    depsgraph: Any,
    notes: Notes,
    *,
    uvs: bool = False,
    space: Any = None,
    sky: str = "",
    keep_going: Callable[[], bool] | None = None,
    wanted: Wanted = NOTHING,
) -> Found:
    """Read everything renderable that the depsgraph's mode shows, see `Reading`."""
    reading = Reading(depsgraph, notes, uvs=uvs, space=space, sky=sky, keep_going=keep_going, wanted=wanted)
    reading.advance(math.inf)
    return reading.found()


class Reading:
    """Reads everything renderable that the depsgraph's mode shows; with a 3D view (`space`), only what that view shows.

    Reads meshes, objects convertible to meshes (curves, surfaces, text, metaballs), hair, point clouds and lights, with
    all their instances, and the materials and the world of the view layer; unsupported objects are noted in `notes` by
    name.

    sky: WAIT for a Sky Texture, which takes seconds; start it now and use it LATER; or NO_WORLD, for triangles alone.
    By default renders wait and viewports do not. keep_going: polled meanwhile; if it returns False, raises Cancelled.
    wanted: what the picture needs.

    `advance` reads a part at a time from Blender. Between two calls the depsgraph must not be evaluated: what was being
    read is then freed, and only `close` is left. `found` makes the scene of the copies, on any thread.
    """

    def __init__(
        self,
        depsgraph: Any,
        notes: Notes,
        *,
        uvs: bool = False,
        space: Any = None,
        sky: str = "",
        keep_going: Callable[[], bool] | None = None,
        wanted: Wanted = NOTHING,
    ) -> None:
        self._notes, self._wanted, self._space = notes, wanted, space
        self._sky = sky or (WAIT if depsgraph.mode == "RENDER" else LATER)
        self._keep_going = keep_going
        self._reader = _Reader(notes, uvs, depsgraph, wanted)
        self._work = Stepwise(self._steps(depsgraph))

    @property
    def ended(self) -> bool:
        """Whether everything was read."""
        return self._work.ended

    def advance(self, seconds: float) -> bool:
        """Read for about this time, at least one step. Returns whether everything was read."""
        return self._work.advance(seconds)

    def close(self) -> None:
        """Break off, and drop all of Blender's data."""
        self._work.close()

    def found(self) -> Found:
        """The scene that was read. Once; needs nothing of Blender."""
        assert self.ended, "everything was read"
        reader, rest = self._reader, self._work.result
        placements = reader.placements()
        reader.note()
        self._notes.join(rest.notes)
        identities, palette = reader.identities, reader.palette
        scene = Scene(
            Geometry.empty(),
            palette.materials(),
            rest.lights,
            rest.world,
            Numbers(identities.indices, palette.pass_indices(), identities.groups),
            rest.images,
            tuple(reader.volumes.voxels),
            Mattes(identities.mattes, palette.names()) if self._wanted.mattes else None,
        )
        layers = palette.layers
        return Found(placements, scene, tuple(layers.keys), layers.objects, layers.apart, tuple(reader.strands.made))

    def _steps(self, depsgraph: Any) -> Steps[_Rest]:
        """Read all of Blender's data."""
        reader, space = self._reader, self._space
        yield from reader.begin()
        # Read everything from an instance at once: Blender reuses its memory for the next one.
        for instance in depsgraph.object_instances:
            if space is None or instance.object.visible_in_viewport_get(space):
                yield from reader.visit(instance)
            yield
        yield from reader.end()
        rest = Notes()
        yield from remarks.unread(depsgraph, rest)
        # Read the world after the materials, because both share the gallery of images.
        sky_world, wanted = view_layers.world(depsgraph), self._wanted
        background, shown, suns = world.read_world(
            sky_world if depsgraph.view_layer_eval.use_sky and self._sky != NO_WORLD else None,
            rest,
            reader.palette.gallery,
            wait=self._sky == WAIT,
            keep_going=self._keep_going,
            wanted=wanted.outputs,
        )
        group = 0 if sky_world is None else wanted.groups.get(sky_world.lightgroup, 0)
        yield
        images = yield from reader.palette.images(rest, shown | reader.lamps.images)
        lights = (*reader.lamps.found(), *(replace(sun, group=group) for sun in suns))
        return _Rest(lights, replace(background, group=group), images, rest)


@dataclass(frozen=True, eq=False)
class _Rest:
    """What a scene has besides its objects. notes: on it and on settings."""

    lights: tuple[Light, ...]
    world: World
    images: tuple[Image, ...]
    notes: Notes


@dataclass(frozen=True, eq=False)
class _Repeated:
    """A mesh that an instancer has placed. group: its placement. moves: whether it has motion blur."""

    group: meshes.Placement
    name: str
    moves: bool


def _repetition(item: Any, parent: Any) -> tuple[int, int, int]:
    """Equal for instances of the same mesh and object by the same instancer."""
    return item.data.as_pointer(), item.original.as_pointer(), parent.as_pointer()


class _Reader:
    """One pass over the depsgraph's instances, which gives each to the part that reads its kind.

    Call `begin`, `visit` for each instance, and `end`; then, on any thread, `placements` and `note`.
    """

    def __init__(self, notes: Notes, uvs: bool, depsgraph: Any, wanted: Wanted) -> None:
        layer, scene = depsgraph.view_layer_eval, depsgraph.scene_eval
        self._remembered = wanted.remembered or Remembered()
        self._remembered.begin(depsgraph)
        self.palette = materials.Palette(
            notes,
            layer.material_override,
            (layer, scene, scene.world),
            wanted.outputs,
            grids=grids.occur(depsgraph),
            gallery=Gallery(
                scene.frame_current,
                None if wanted.standing is None else wanted.standing.images,
                texture_limit(depsgraph),
            ),
        )
        self._linking = Linking(depsgraph, notes)
        self._notes, self._standing = notes, wanted.standing or Standing()
        self._culling, self._depsgraph, self._uvs = Culling(depsgraph), depsgraph, uvs
        self._visibility = Visibility(layer, self._linking)
        self._surfaces, self._hair, self._clouds = layer.use_solid, layer.use_strand, layer.use_volumes
        # Each part collects what it reads.
        self.identities = Identities(wanted.groups)
        self.lamps = lights.Lamps(notes, self.palette.gallery, self._linking, wanted.groups)
        self.strands = Collector(depsgraph, notes, self.palette, self._remembered, uvs=uvs)
        self.volumes = grids.Volumes(notes)
        self._meshes = ObjectMeshes(notes, self.palette.layers, self._standing, self._remembered, uvs=uvs)
        self._displacer = Displacer(self.palette, notes)
        self._dicer = Dicer(depsgraph, notes)
        self._rates: dict[int, Rate | None] = {}
        self._groups: dict[tuple[tuple[str, int], tuple[int, ...]], meshes.Placement] = {}
        self._repeated: dict[tuple[int, int, int], _Repeated] = {}
        self._given: set[int] = set()
        """Curves, text and the like whose mesh Blender also lists as an instance."""

    def begin(self) -> Steps[None]:
        """Read all materials, before what they read of objects."""
        yield from self.palette.read(self._depsgraph.ids)
        layers = self.palette.layers
        self._instancing = Instancing(self._depsgraph, layers.object_values)
        self._remembered.want((tuple(layers.keys), self._uvs))

    def visit(self, placed: Any) -> Steps[None]:
        """Read one instance of the depsgraph: an object at one place."""
        item, parent = placed.object, placed.parent if placed.is_instance else None
        if parent is not None and item.data is not None:
            repeated = self._repeated.get(_repetition(item, parent))
            if repeated is not None:
                self._repeat(repeated, item, parent, placed)
                return
        shown, kind = (placed.show_self, placed.show_particles), item.type
        # Find the place of the instance, unless it is culled.
        matrix = np.array(placed.matrix_world, np.float64)
        if kind != "LIGHT" and self._culling.leaves_out(item, matrix):
            return
        matrix = self._standing.place(item, parent, placed.persistent_id, matrix)
        given = self._instancing.of(placed)
        instance = Instance(item, parent, tuple(matrix[:3, 3].tolist()), placed.random_id & MASK, given=given)
        # Give the object to the part that reads its kind, and its particle hair in addition.
        if self._hair and shown[1] and kind in MESH_TYPES and len(item.particle_systems):
            yield from self._place_round(instance, matrix, self.strands.visit_hair, tube=True)
        if not shown[0]:
            return
        if kind in ROUND_TYPES:
            if getattr(item.data, "type", "") == SPLATS:
                self._notes.add("Gaussian splats are rendered as spheres", item.name_full)
            if self._hair or kind != "CURVES":
                yield from self._place_round(instance, matrix, self.strands.visit, tube=kind == "CURVES")
        elif kind in MESH_TYPES or kind in CONVERTIBLE_TYPES:
            if parent is not None and kind in MESH_TYPES and item.original.type in CONVERTIBLE_TYPES:
                self._given.add(item.original.as_pointer())
            if self._surfaces:
                yield from self._place(instance, matrix)
        elif kind == "LIGHT":
            self.lamps.visit(instance, matrix)
        elif kind == "VOLUME" and self._clouds:
            self._place_volume(instance, matrix)

    def _repeat(self, repeated: _Repeated, item: Any, parent: Any, placed: Any) -> None:
        """Read one more instance of a mesh that its instancer has placed: only its place and its values differ."""
        matrix = np.array(placed.matrix_world, np.float64)
        if self._culling.leaves_out(item, matrix):
            return
        if not repeated.moves:
            matrix = self._standing.place(item, parent, placed.persistent_id, matrix)
        number, keys, values = placed.random_id & MASK, self.palette.layers.object_values, ()
        if keys:
            given, location = self._instancing.of(placed), tuple(matrix[:3, 3].tolist())
            values = Instance(item, parent, location, number, given=given).values(keys)
        repeated.group.add(repeated.name, number, matrix, values)

    def end(self) -> Steps[None]:
        """Read what all instances together need."""
        for (mesh, _), group in self._groups.items():
            if mesh[0] != "volume":
                yield from self._displacer.read(group)
        self._remembered.end()

    def placements(self) -> list[meshes.Placement]:
        """The placements, by the names of their objects, those of hair and points last: where surfaces lie
        on each other, the order of triangles decides, and must not depend on that of Blender's lists.
        """
        for group in self._groups.values():
            group.keep_usable(self._notes)
            group.sort()
        # Displace the meshes of surfaces.
        found = []
        for (mesh, _), group in sorted(self._groups.items(), key=lambda item: item[1].keys[0]):
            if mesh[0] == "object" and mesh[1] in self._given:
                continue  # otherwise every triangle would occur twice
            if (rate := self._rates.get(id(group))) is not None:
                group.mesh = self._dicer.mesh(group.mesh, rate, group.transforms[0], group.names[0])
            if mesh[0] != "volume":
                group.mesh = self._displacer.mesh(group)
            found.append(group)
        return found + self.strands.placements()

    def note(self) -> None:
        """Note what is known once all instances were read."""
        self._meshes.note_layers(self.palette.readers(), self.strands.found)
        if any(material.catcher for material in self.palette.materials()):
            self.lamps.note_catchers()

    def _regular(self, item: Any, matrix: F64) -> F64 | None:
        """The transform of an instance, made regular; None, with a note, if it cannot be."""
        self.identities.add(item)
        return meshes.usable(matrix, item.name_full, self._notes)

    def _used(self, instance: Instance, *, tube: bool = False) -> tuple[int, ...]:
        """The materials of an instance's surface. tube: whether that is of tubes around hairs."""
        return self.palette.indices(instance.item, instance.item.data, *self._visibility.of(instance), tube=tube)

    def _place_round(
        self, instance: Instance, matrix: F64, visit: Callable[..., Steps[None]], *, tube: bool
    ) -> Steps[None]:
        """Give `visit` one instance of a point cloud, of hair curves, or of the object's particle hair."""
        sheet = self._regular(instance.item, matrix)
        if sheet is not None:
            yield from visit(instance, sheet, self._used(instance, tube=tube))

    def _place(self, instance: Instance, matrix: F64) -> Steps[None]:
        """Add one instance of the object's mesh, unless its transform is unusable."""
        sheet = self._regular(instance.item, matrix)
        if sheet is None:
            return
        key, mesh = yield from self._meshes.of(instance)
        if mesh is None:
            return
        used = self._used(instance)
        if len(mesh.triangles):
            group = self._add(key, used, mesh, instance, sheet)
            item, parent = instance.item, instance.parent
            if id(group) not in self._rates:
                self._rates[id(group)] = self._dicer.rate(item)
            if parent is not None and not len(item.particle_systems):
                self._repeated[_repetition(item, parent)] = _Repeated(group, item.name_full, moves(item, parent))

    def _place_volume(self, instance: Instance, matrix: F64) -> None:
        """Add the box around the grids of a volume object."""
        item, name = instance.item, instance.item.name_full
        self.identities.add(item)
        box, numbers = self.volumes.of(item)
        if box is None or not np.isfinite(matrix).all() or not is_regular(matrix):
            self._notes.add("Skipped, the volume is empty or has no size", name)
            return
        hidden, _, _ = self._visibility.of(instance)
        used = self.palette.indices(item, item.data, hidden)
        if all(self.palette.materials()[i].volume is None for i in used):
            self._notes.add("Skipped, the volume has no material with a volume shader", name)
            return
        scale = {DENSITY_SCALE: grids.density_scale(matrix, item.data)}
        self._add(("volume", item.data.as_pointer()), used, box, replace(instance, grids={**numbers, **scale}), matrix)

    def _add(
        self, key: tuple[str, int], used: tuple[int, ...], mesh: meshes.MeshArrays, instance: Instance, matrix: F64
    ) -> meshes.Placement:
        """Add an instance to the placement of its mesh with its materials, which is returned."""
        if (group := self._groups.get((key, used))) is None:
            group = self._groups[key, used] = meshes.Placement(mesh, np.array(used, np.int32))
        group.add(instance.item.name_full, instance.number, matrix, instance.values(self.palette.layers.object_values))
        return group
