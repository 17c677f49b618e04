# SPDX-License-Identifier: GPL-3.0-or-later
"""Extraction of Blender's dependency graph into the arrays of `core.scene`, which keep no reference to
Blender's data.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.base.arrays import F64
from ...core.scene.instances import AnyGeometry, Layout, choose
from ...core.scene.mattes import Mattes
from ...core.scene.scene import Geometry, Hidden, Image, Light, Numbers, Scene, Voxels
from . import layers as texture_layers
from . import lights, materials, meshes, remarks, view_layers, world
from .displacement import applying
from .instancing import Instancing
from .linking import Linking, Sets
from .media import grids
from .object_values import DENSITY_SCALE, MASK, Instance, as_sheet, is_regular
from .simplifying import Culling
from .standing import Standing
from .strands.collecting import Collector
from .value_nodes import STRAND
from .value_nodes.outputs import NOTHING, Wanted

if TYPE_CHECKING:
    from ...core.base.notes import Notes

MESH_TYPES = {"MESH"}
CONVERTIBLE_TYPES = {"CURVE", "SURFACE", "FONT", "META"}
ROUND_TYPES = {"CURVES", "POINTCLOUD"}

WAIT, LATER, NO_WORLD = "wait", "later", "no world"
"""Treatment of a Sky Texture that another Blender process must render first, see `find`."""

RAYS = {
    "camera": "visible_camera",
    "shadow": "visible_shadow",
    "diffuse": "visible_diffuse",
    "glossy": "visible_glossy",
    "transmission": "visible_transmission",
    "volume": "visible_volume_scatter",
    "raycast": "visible_raycast",
}
"""The kinds of rays that an object can be hidden from, with Blender's settings; before 5.1 without the last."""


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

    def layout(self, mode: str, *, integrator: str = "path", interactive: bool = False) -> Layout:
        """Whether to keep instances, and the reason."""
        sizes: dict[int, list[int]] = {}
        for placement in self.placements:
            triangles, places = len(placement.mesh.triangles), len(placement.names)
            sizes.setdefault(id(placement.mesh), [triangles, 0])[1] += places
        # Some scenes are flattened in any mode.
        why = ""
        if integrator == "whitted" and any(material.glows for material in self.scene.materials):
            why = "Whitted's integrator supports emissive meshes only without instancing"
        elif self.layers or self.objects:
            why = "these textures need attributes that only flattened triangles have"
        if why:
            repeated = any(places > 1 for _, places in sizes.values())
            return Layout(two_level=False, reason=f"instances: flattened, since {why}" if repeated else "")
        smooth = any(placement.mesh.normals is not None for placement in self.placements)
        return choose(mode, [(a, b) for a, b in sizes.values()], smooth=smooth, interactive=interactive)

    def flattened(self, *, uvs: bool = False, origin: F64 | None = None) -> Scene:
        """The scene with every triangle of every instance. origin: that of the scene frame, if it is given."""
        objects = self.objects or self.apart
        return self._with(meshes.assemble(self.placements, uvs=uvs, layers=self.layers, objects=objects, origin=origin))

    def instanced(self, origin: F64 | None = None) -> Scene:
        """The scene with every mesh once, and its instances. origin: as for `flattened`."""
        return self._with(meshes.keep_instances(self.placements, origin))

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
    """Read everything renderable that the depsgraph's mode shows; with a 3D view (`space`), only what that view shows.

    Reads meshes, objects convertible to meshes (curves, surfaces, text, metaballs), hair, point clouds and lights, with
    all their instances, and the materials and the world of the view layer; unsupported objects are noted in `notes` by
    name.

    sky: WAIT for a Sky Texture, which takes seconds; start it now and use it LATER; or NO_WORLD, for triangles alone.
    By default renders wait and viewports do not. keep_going: polled meanwhile; if it returns False, raises Cancelled.
    wanted: what the picture needs.
    """
    layer = depsgraph.view_layer_eval
    reader = _Reader(notes, uvs, depsgraph, wanted)
    # Read everything from an instance at once: Blender reuses its memory for the next one.
    for instance in depsgraph.object_instances:
        if space is None or instance.object.visible_in_viewport_get(space):
            reader.visit(instance)
    placements = reader.placements()
    reader.note_layers()
    reader.note_lights()
    remarks.unread(depsgraph, notes)
    # Read the world after the materials, because both share the gallery of images.
    sky = sky or (WAIT if depsgraph.mode == "RENDER" else LATER)
    sky_world = view_layers.world(depsgraph)
    background, shown, suns = world.read_world(
        sky_world if layer.use_sky and sky != NO_WORLD else None,
        notes,
        reader.palette.gallery,
        wait=sky == WAIT,
        keep_going=keep_going,
        wanted=wanted.outputs,
    )
    group = 0 if sky_world is None else wanted.groups.get(sky_world.lightgroup, 0)
    scene = Scene(
        Geometry.empty(),
        reader.palette.materials(),
        (*sorted(reader.lights, key=_light_key), *(replace(sun, group=group) for sun in suns)),
        replace(background, group=group),
        Numbers(reader.object_numbers, reader.palette.pass_indices(), reader.object_groups),
        reader.palette.images(shown | reader.light_images),
        tuple(reader.grids),
        Mattes(reader.matte_names, reader.palette.names()) if wanted.mattes else None,
    )
    layers = reader.palette.layers
    return Found(placements, scene, tuple(layers.keys), layers.objects, layers.apart, tuple(reader.strands.made))


def _light_key(light: Light) -> tuple[str, bytes]:
    """A key that does not depend on the order in which Blender lists lights."""
    return light.name, light.to_world.tobytes()


class _Reader:
    """The state of one pass over the depsgraph's instances."""

    def __init__(self, notes: Notes, uvs: bool, depsgraph: Any, wanted: Wanted) -> None:
        self.notes = notes
        self.uvs = uvs
        layer, scene = depsgraph.view_layer_eval, depsgraph.scene_eval
        owners = (layer, scene, scene.world)
        volumes = grids.occur(depsgraph)
        self.palette = materials.Palette(
            notes, depsgraph.ids, layer.material_override, owners, wanted.outputs, grids=volumes
        )
        self._standing = wanted.standing or Standing()
        self._culling = Culling(depsgraph)
        self.instancing = Instancing(depsgraph, self.palette.layers.object_values)
        self.lights: list[Light] = []
        self.light_images: set[int] = set()
        self.object_numbers: dict[str, float] = {}
        self.object_groups: dict[str, int] = {}
        self._group_numbers = wanted.groups
        self.matte_names: dict[str, tuple[str, str]] = {}
        self._meshes: dict[tuple[str, int], meshes.MeshArrays] = {}
        self._room = meshes.LayerRoom()
        self._groups: dict[tuple[tuple[str, int], tuple[int, ...]], meshes.Placement] = {}
        self._checked: set[str] = set()
        self._linked: dict[str, None] = {}  # glowing objects with light linking
        self._made: dict[str, None] = {}  # lights that are no shadow catchers
        self._unreadable: set[texture_layers.Key] = set()
        self.strands = Collector(depsgraph, notes, self.palette.layers, uvs=uvs)
        self._volumes: dict[tuple[str, int], grids.Grids] = {}
        self._grid_numbers: dict[tuple[str, int], dict[str, float]] = {}
        self.grids: list[Voxels] = []
        self._surfaces, self._strands, self._clouds = layer.use_solid, layer.use_strand, layer.use_volumes
        self._marks, self._linking = view_layers.Marks(layer), Linking(depsgraph, notes)
        self._pictures: dict[frozenset[int], tuple[Image, ...]] = {}
        self._given: set[int] = set()
        """Curves, text and the like whose mesh Blender also lists as an instance."""

    def visit(self, placed: Any) -> None:
        """Read one instance of the depsgraph: an object at one place."""
        item, parent = placed.object, placed.parent if placed.is_instance else None
        shown, kind = (placed.show_self, placed.show_particles), item.type
        matrix = np.array(placed.matrix_world, np.float64)
        if kind != "LIGHT" and self._culling.leaves_out(item, matrix):
            return
        matrix = self._standing.place(item, parent, placed.persistent_id, matrix)
        given = self.instancing.of(placed)
        instance = Instance(item, parent, tuple(matrix[:3, 3].tolist()), placed.random_id & MASK, given=given)
        if self._strands and shown[1] and kind in MESH_TYPES and len(item.particle_systems):
            self._place_round(instance, matrix, self._seen(item, parent), hair=True)
        if not shown[0]:
            return
        if kind in ROUND_TYPES:
            if self._strands or kind != "CURVES":
                self._place_round(instance, matrix, self._seen(item, parent))
        elif kind in MESH_TYPES or kind in CONVERTIBLE_TYPES:
            if parent is not None and kind in MESH_TYPES and item.original.type in CONVERTIBLE_TYPES:
                self._given.add(item.original.as_pointer())
            if self._surfaces:
                self._place(instance, matrix, self._seen(item, parent))
        elif kind == "LIGHT":
            light, used = lights.read_light(instance, matrix, self.notes, self.palette.gallery)
            if light is not None:
                self.light_images |= used
                receivers, blockers = self._linking.of_light(item)
                group = self._group_numbers.get(item.lightgroup, 0)
                hidden = _hidden(item, parent)
                light = replace(light, hidden_from=hidden, receivers=receivers, blockers=blockers, group=group)
                self.lights.append(light)
                if not item.is_shadow_catcher:
                    self._made.setdefault(item.name_full)
        elif kind == "VOLUME" and self._clouds:
            self._place_volume(instance, matrix)

    def placements(self) -> list[meshes.Placement]:
        """The placements, by the names of their objects, those of hair and points last: where surfaces lie
        on each other, the order of triangles decides, and must not depend on that of Blender's lists.
        """
        for group in self._groups.values():
            group.sort()
        found = []
        for (mesh, _), group in sorted(self._groups.items(), key=lambda item: item[1].keys[0]):
            if mesh[0] == "object" and mesh[1] in self._given:
                continue  # otherwise every triangle would occur twice
            if mesh[0] != "volume":
                group.mesh = self._displaced(group)
            found.append(group)
        return found + self.strands.placements()

    def _displaced(self, group: meshes.Placement) -> meshes.MeshArrays:
        """The mesh of a group, displaced by its materials where the first instance is, as in Cycles."""
        slots = self.palette.displacements(group.materials.tolist())
        if not any(slots):
            return group.mesh
        used = frozenset().union(*(one.images for one in slots if one is not None))
        if used not in self._pictures:
            self._pictures[used] = self.palette.gallery.read(set(used), self.notes)
        keys = self.palette.layers.keys
        around = applying.Surroundings(group.matrices[0], group.values[0], keys, self._pictures[used])
        mesh, lost = applying.displaced(group.mesh, slots, around)
        if lost:
            self.notes.add("Not displaced, vertices that would leave the scene", group.names[0], lost)
        return mesh

    def _regular(self, item: Any, matrix: np.ndarray[Any, Any]) -> np.ndarray[Any, Any] | None:
        """The transform of an instance, made invertible; None, with a note, if it is unusable."""
        name = item.name_full  # linked files may contain objects of equal names
        self._check_once(item, name)
        if not np.isfinite(matrix).all():
            self.notes.add("Dropped, the transform is not finite", name)
            return None
        sheet = as_sheet(matrix)
        if sheet is None:
            self.notes.add("Dropped, the transform collapses the object to a line or a point (scale 0)", name)
        return sheet

    def _place_round(
        self, instance: Instance, matrix: np.ndarray[Any, Any], hidden: Hidden, *, hair: bool = False
    ) -> None:
        """Add one instance of a point cloud, of hair curves, or (hair) of the object's particle hair."""
        item, sheet = instance.item, self._regular(instance.item, matrix)
        if sheet is None:
            return
        visit = self.strands.visit_hair if hair else self.strands.visit
        used = self.palette.indices(item, item.data, hidden, self._sets(instance), self._mask(instance))
        self._note_linking(item, used)
        visit(instance, sheet, used)

    def _place(self, instance: Instance, matrix: np.ndarray[Any, Any], hidden: Hidden) -> None:
        """Add one instance of the object's mesh, unless its transform is unusable."""
        item, sheet = instance.item, self._regular(instance.item, matrix)
        if sheet is None:
            return
        mesh_key, mesh, used = self._mesh(instance, hidden)
        if mesh is None or not len(mesh.triangles):
            return
        self._note_linking(item, used)
        if mesh_key[0] == "mesh":  # other meshes may be dropped at the end
            self._room.placed(len(mesh.triangles))
        group_key = (mesh_key, used)
        if (group := self._groups.get(group_key)) is None:
            group = self._groups[group_key] = meshes.Placement(mesh, np.array(used, np.int32))
        group.add(instance, sheet, instance.values(self.palette.layers.object_values))

    def _place_volume(self, instance: Instance, matrix: np.ndarray[Any, Any]) -> None:
        """Add the box around the grids of a volume object."""
        item, parent = instance.item, instance.parent
        data, name = item.data, item.name_full
        self._check_once(item, name)
        key = ("volume", data.as_pointer())
        if key not in self._volumes:
            self._volumes[key] = grids.read_volume(data, name, self.notes, sum(one.values.size for one in self.grids))
            first = len(self.grids) + 1
            self._grid_numbers[key] = {grid: float(first + i) for i, grid in enumerate(self._volumes[key].voxels)}
            self.grids += self._volumes[key].voxels.values()
        box = self._volumes[key].box
        if box is None or not np.isfinite(matrix).all() or not is_regular(matrix):
            self.notes.add("Skipped, the volume is empty or has no size", name)
            return
        used = self.palette.indices(item, data, self._seen(item, parent))
        if all(self.palette.materials()[i].volume is None for i in used):
            self.notes.add("Skipped, the volume has no material with a volume shader", name)
            return
        group = self._groups.setdefault((key, used), meshes.Placement(box, np.array(used, np.int32)))
        scale = {DENSITY_SCALE: grids.density_scale(matrix, data)}
        values = replace(instance, grids=self._grid_numbers[key] | scale)
        group.add(instance, matrix, values.values(self.palette.layers.object_values))

    def _mask(self, instance: Instance) -> materials.Mask:
        """How rays see an instance. It is a holdout as its instancer or its collections are, and a shadow
        catcher as itself or its instancer is.
        """
        item, parent = instance.item, instance.parent
        owner = item if parent is None else parent
        hole = bool(owner.is_holdout or self._marks.of(owner)[0])
        offset = round(item.shadow_terminator_geometry_offset, 6)  # the default is 0.1 in f32
        return hole, item.is_shadow_catcher or owner.is_shadow_catcher, offset

    def _sets(self, instance: Instance) -> Sets:
        """The sets of linked lights that an object is in."""
        return self._linking.of_object(instance.item, instance.parent)

    def _mesh(
        self, instance: Instance, hidden: Hidden
    ) -> tuple[tuple[str, int], meshes.MeshArrays | None, tuple[int, ...]]:
        """The key and arrays of the object's mesh, read once for all its instances, and its materials."""
        item, sets, mask = instance.item, self._sets(instance), self._mask(instance)
        # In edit mode the evaluated mesh is a wrapper without attributes.
        if item.type in MESH_TYPES and not item.data.is_editmode:
            data = item.data
            key = ("mesh", data.as_pointer())
            if key not in self._meshes:
                parent = instance.parent
                self._meshes[key] = self._standing.shape(item, parent, data, lambda: self._read(data, item))
            return key, self._meshes[key], self.palette.indices(item, data, hidden, sets, mask)
        key = ("object", item.original.as_pointer())
        if key not in self._meshes:
            # Edited meshes and other types provide a temporary mesh, which `to_mesh_clear` frees.
            data = item.to_mesh()
            if data is None:
                return key, None, ()
            self._meshes[key] = self._standing.shape(item, instance.parent, item.data, lambda: self._read(data, item))
            item.to_mesh_clear()
        return key, self._meshes[key], self.palette.indices(item, item.data, hidden, sets, mask)

    def _read(self, data: Any, item: Any) -> meshes.MeshArrays:
        """A mesh with the layers that materials read."""
        keys = self.palette.layers.keys
        self._room.check(data, keys)
        for key in keys:
            if reason := texture_layers.unreadable(data, key):
                self._unreadable.add(key)
                self.notes.add(f"The attribute {key[1]!r} is black, its {reason} is not supported yet", item.name_full)
        read = meshes.read_mesh(data, uvs=self.uvs, layers=keys)
        if read.lost:
            self.notes.add("Custom normals that are not finite are replaced by those of the faces", item.name_full)
        return read

    def note_layers(self) -> None:
        """Note layers that materials read and no mesh has."""
        there = self._unreadable.union(self.strands.found, *(mesh.layers for mesh in self._meshes.values()))
        for key, names in self.palette.readers().items():
            kind, layer = key
            if key in there or not layer or kind == STRAND:
                continue
            for name in names:
                what = "attribute" if kind == texture_layers.COLOR else "UV map"
                self.notes.add(f"No mesh has the {what} {layer!r}, it is 0 everywhere, in material", name)

    def _seen(self, item: Any, parent: Any) -> Hidden:
        """The rays that ignore an instance, including the effect of its collections."""
        hidden = _hidden(item, parent)
        owner = item if parent is None else parent
        _, indirect_only = self._marks.of(owner)
        if not indirect_only or "camera" in hidden:
            return hidden
        return ("camera", *hidden)

    def _note_linking(self, item: Any, used: tuple[int, ...]) -> None:
        """Note an object that glows and links its light; used: its materials."""
        linking, known = item.light_linking, self.palette.materials()
        if (linking.receiver_collection or linking.blocker_collection) and any(known[i].glows for i in used):
            self._linked.setdefault(item.name_full)

    def note_lights(self) -> None:
        """Note lights that shine on more than in Cycles."""
        for name in self._linked:
            self.notes.add("Light linking is supported for lights only, not for glowing objects", name)
        if any(material.catcher for material in self.palette.materials()):
            for name in self._made:
                self.notes.add("Not a shadow catcher, but shines on shadow catchers alone, too", name)

    def _check_once(self, item: Any, name: str) -> None:
        """Note an object's unsupported settings, once per object."""
        if name in self._checked:
            return
        self._checked.add(name)
        if group := self._group_numbers.get(item.lightgroup, 0):
            self.object_groups[name] = group
        self.matte_names[name] = item.name, _topmost(item).name
        if item.pass_index:
            self.object_numbers[name] = float(item.pass_index)


def _topmost(item: Any) -> Any:
    """The object whose children, and theirs, include this one."""
    while item.parent is not None:
        item = item.parent
    return item


def _hidden(item: Any, parent: Any) -> Hidden:
    """The rays that ignore an object; those that its instancer ignores are included."""
    both = [item] if parent is None else [item, parent]
    return tuple(ray for ray, setting in RAYS.items() if not all(getattr(one, setting, True) for one in both))
