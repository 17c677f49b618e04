# SPDX-License-Identifier: GPL-3.0-or-later
"""From Blender's dependency graph to the arrays of `core.scene`. The only way in; nothing of Blender stays behind."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.scene.instances import Layout, choose
from ...core.scene.scene import Hidden, Image, Light, Material, Numbers, Scene, World
from . import layers as texture_layers
from . import lights, materials, meshes, view_layers, world

if TYPE_CHECKING:
    from ...core.base.notes import Notes

MESH_TYPES = {"MESH"}
CONVERTIBLE_TYPES = {"CURVE", "SURFACE", "FONT", "META"}
SKIPPED_TYPES = {
    "CURVES": "hair curves",
    "POINTCLOUD": "point cloud",
    "VOLUME": "volume",
    "GREASEPENCIL": "grease pencil",
    "GPENCIL": "grease pencil",
}
WAIT, LATER, NO_WORLD = "wait", "later", "no world"
"""What becomes of a Sky Texture that another Blender must render first."""

HOLDOUT = "Holdout is not supported yet, rendered as usual"
THIN = 1e-6
"""How thick a sheet is beside its width."""

RAYS = ("camera", "shadow", "diffuse", "glossy", "transmission")
"""The kinds of rays that an object can be hidden from."""


@dataclass
class _Group:
    """A mesh and the places found for it so far."""

    mesh: meshes.MeshArrays
    materials: np.ndarray[Any, Any]
    matrices: list[np.ndarray[Any, Any]] = field(default_factory=list)
    names: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Found:
    """What was read, before anything is placed."""

    placements: list[meshes.Placement]
    materials: tuple[Material, ...]
    lights: tuple[Light, ...]
    world: World
    numbers: Numbers
    images: tuple[Image, ...] = ()
    layers: tuple[tuple[str, str], ...] = ()
    objects: bool = False

    def layout(self, mode: str, *, integrator: str = "path", interactive: bool = False) -> Layout:
        """Whether to keep instances, and why."""
        if integrator == "whitted" and any(material.glows for material in self.materials):
            why = "Whitted's rays find glowing meshes only as lights in their places"
            return Layout(two_level=False, reason=f"instances: flattened, since {why}")
        sizes: dict[int, list[int]] = {}
        for placement in self.placements:
            triangles, places = len(placement.mesh.triangles), len(placement.names)
            sizes.setdefault(id(placement.mesh), [triangles, 0])[1] += places
        if self.layers or self.objects:
            why = "only triangles in their places carry what these textures read"
            return Layout(two_level=False, reason=f"instances: flattened, since {why}")
        smooth = any(placement.mesh.normals is not None for placement in self.placements)
        return choose(mode, [(a, b) for a, b in sizes.values()], smooth=smooth, interactive=interactive)

    def flattened(self, *, uvs: bool = False) -> Scene:
        """Every triangle in its place."""
        return self._scene(meshes.assemble(self.placements, uvs=uvs, layers=self.layers, objects=self.objects))

    def instanced(self) -> Scene:
        """Every mesh once, and its places."""
        return self._scene(meshes.keep_instances(self.placements))

    def _scene(self, geometry: Any) -> Scene:
        moved = tuple(lights.moved(light, geometry.origin) for light in self.lights)
        return Scene(geometry, self.materials, moved, self.world, self.numbers, self.images)


def extract(depsgraph: Any, notes: Notes, *, uvs: bool = False, sky: str = "") -> Scene:
    """The scene as the depsgraph's mode (viewport or render) shows it, in arrays, every triangle in its place.

    As `find` reads it. Geometry is in the frame of `Scene.geometry.origin`.
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
) -> Found:
    """Everything that can be rendered as the depsgraph's mode shows it; with a 3D view, only what that view shows.

    Reads meshes, whatever has a mesh (curves, surfaces, text, metaballs) and lights, with every instance of them, with
    the materials and the world of the view layer; what cannot be rendered goes into `notes` by name.

    sky: WAIT for a Sky Texture, which takes seconds; begin it now and have it LATER; or NO_WORLD, for triangles alone.
    Without a word renders wait and viewports do not. keep_going: asked meanwhile; where it returns False, Cancelled is
    raised.
    """
    layer = depsgraph.view_layer_eval
    reader = _Reader(notes, uvs, depsgraph.ids, layer)
    # Take everything from an item at once: Blender reuses its memory for the next one.
    for instance in depsgraph.object_instances:
        if instance.show_self and (space is None or instance.object.visible_in_viewport_get(space)):
            reader.visit(instance.object, instance.matrix_world, instance.parent if instance.is_instance else None)
    reader.note_layers()
    sky = sky or (WAIT if depsgraph.mode == "RENDER" else LATER)
    background, shown, suns = world.read_world(
        view_layers.world(depsgraph) if layer.use_sky and sky != NO_WORLD else None,
        notes,
        reader.palette.gallery,
        wait=sky == WAIT,
        keep_going=keep_going,
    )
    return Found(
        placements=reader.placements(),
        materials=reader.palette.materials(),
        lights=(*reader.lights, *suns),
        world=background,
        numbers=Numbers(reader.object_numbers, reader.palette.pass_indices()),
        images=reader.palette.images(shown),
        layers=tuple(reader.palette.layers.keys),
        objects=reader.palette.layers.objects,
    )


class _Reader:
    def __init__(self, notes: Notes, uvs: bool, blocks: Any, layer: Any) -> None:
        self.notes = notes
        self.uvs = uvs
        self.palette = materials.Palette(notes, blocks, layer.material_override)
        self.lights: list[Light] = []
        self.object_numbers: dict[str, float] = {}
        self._meshes: dict[tuple[str, int], meshes.MeshArrays] = {}
        self._room = meshes.LayerRoom()
        self._groups: dict[tuple[tuple[str, int], tuple[int, ...]], _Group] = {}
        self._checked: set[str] = set()
        self._held: set[str] = set()
        self._unreadable: set[texture_layers.Key] = set()
        self._surfaces = layer.use_solid
        self._marks = view_layers.Marks(layer)
        self._given: set[int] = set()
        """Curves, text and the like whose mesh Blender gives as an instance beside them."""

    def visit(self, item: Any, matrix_world: Any, parent: Any = None) -> None:
        """Take over one object at one place, where perhaps another object has put it."""
        kind = item.type
        matrix = np.array(matrix_world, np.float64)
        if kind in MESH_TYPES or kind in CONVERTIBLE_TYPES:
            if parent is not None and kind in MESH_TYPES and item.original.type in CONVERTIBLE_TYPES:
                self._given.add(item.original.as_pointer())
            if self._surfaces:
                self._place(item, matrix, self._seen(item, parent))
        elif kind == "LIGHT":
            light = lights.read_light(item, matrix, self.notes)
            if light is not None:
                self._note_linking(item, item.name_full)
                self.lights.append(replace(light, hidden_from=_hidden(item, parent)))
        elif kind in SKIPPED_TYPES:
            self.notes.add(f"Skipped, {SKIPPED_TYPES[kind]} cannot be rendered yet", item.name_full)

    def placements(self) -> list[meshes.Placement]:
        """What was found, in order of appearance."""
        return [
            meshes.Placement(group.mesh, np.stack(group.matrices), tuple(group.names), group.materials)
            for (mesh, _), group in self._groups.items()
            if mesh[0] != "object" or mesh[1] not in self._given  # else every triangle would be there twice
        ]

    def _place(self, item: Any, matrix: np.ndarray[Any, Any], hidden: Hidden) -> None:
        name = item.name_full  # two files may each have an object of the same name
        self._check_once(item, name)
        if not np.isfinite(matrix).all():
            self.notes.add("Dropped, the transform is not finite", name)
            return
        sheet = _as_sheet(matrix)
        if sheet is None:
            self.notes.add("Dropped, the transform leaves a line or a point of the object (scale 0)", name)
            return
        matrix = sheet
        mesh_key, mesh, used = self._mesh(item, hidden)
        if mesh is None or not len(mesh.triangles):
            return
        if mesh_key[0] == "mesh":  # others may be left out in the end
            self._room.placed(len(mesh.triangles))
        group_key = (mesh_key, used)
        if (group := self._groups.get(group_key)) is None:
            group = self._groups[group_key] = _Group(mesh, np.array(used, np.int32))
        group.matrices.append(matrix)
        group.names.append(name)

    def _mesh(self, item: Any, hidden: Hidden) -> tuple[tuple[str, int], meshes.MeshArrays | None, tuple[int, ...]]:
        """The object's mesh, read once however often it is placed, and its materials."""
        # In edit mode the mesh is a shell around the one that is edited, without attributes.
        if item.type in MESH_TYPES and not item.data.is_editmode:
            data = item.data
            key = ("mesh", data.as_pointer())
            if key not in self._meshes:
                self._meshes[key] = self._read(data, item)
            return key, self._meshes[key], self.palette.indices(item, data, hidden)
        key = ("object", item.original.as_pointer())
        if key not in self._meshes:
            # Edited meshes and other kinds of objects lend a mesh, which dies with `to_mesh_clear`.
            data = item.to_mesh()
            if data is None:
                return key, None, ()
            self._meshes[key] = self._read(data, item)
            item.to_mesh_clear()
        return key, self._meshes[key], self.palette.indices(item, item.data, hidden)

    def _read(self, data: Any, item: Any) -> meshes.MeshArrays:
        """A mesh and what materials read of it."""
        keys = self.palette.layers.keys
        self._room.check(data, keys)
        for key in keys:
            if reason := texture_layers.unreadable(data, key):
                self._unreadable.add(key)
                self.notes.add(f"The attribute {key[1]!r} is black, its {reason} is not supported yet", item.name_full)
        return meshes.read_mesh(data, uvs=self.uvs, layers=keys)

    def note_layers(self) -> None:
        """Remark on what materials read and no mesh has."""
        there = self._unreadable.union(*(mesh.layers for mesh in self._meshes.values()))
        for key, names in self.palette.readers().items():
            kind, layer = key
            if key in there or not layer:
                continue
            for name in names:
                what = "attribute" if kind == texture_layers.COLOR else "UV map"
                self.notes.add(f"No mesh has the {what} {layer!r}, it is 0 everywhere, in material", name)

    def _seen(self, item: Any, parent: Any) -> Hidden:
        """The rays that do not see an object at its place, also because of its collections."""
        hidden = _hidden(item, parent)
        owner = item if parent is None else parent
        holdout, indirect_only = self._marks.of(owner)
        if holdout and owner.name_full not in self._held:
            self._held.add(owner.name_full)
            self.notes.add(HOLDOUT, owner.name_full)
        if not indirect_only or "camera" in hidden:
            return hidden
        return ("camera", *hidden)

    def _note_linking(self, item: Any, name: str) -> None:
        linking = item.light_linking
        if linking.receiver_collection is not None:
            self.notes.add("Light linking is not supported yet, the light reaches everything", name)
        if linking.blocker_collection is not None:
            self.notes.add("Shadow linking is not supported yet, everything throws shadows", name)

    def _check_once(self, item: Any, name: str) -> None:
        """Remark on settings of an object that are not obeyed."""
        if name in self._checked:
            return
        self._checked.add(name)
        if item.pass_index:
            self.object_numbers[name] = float(item.pass_index)
        if item.is_holdout and name not in self._held:
            self._held.add(name)
            self.notes.add(HOLDOUT, name)
        if item.is_shadow_catcher:
            self.notes.add("Shadow catchers are not supported yet, rendered as usual", name)
        self._note_linking(item, name)
        if any(
            system.settings.type == "HAIR" and system.settings.render_type == "PATH" for system in item.particle_systems
        ):
            self.notes.add("Skipped, hair strands cannot be rendered yet", name)


def _hidden(item: Any, parent: Any) -> Hidden:
    """The rays that do not see an object; what an instancer hides is hidden."""
    both = [item] if parent is None else [item, parent]
    return tuple(ray for ray in RAYS if not all(getattr(one, f"visible_{ray}") for one in both))


def _as_sheet(matrix: np.ndarray[Any, Any]) -> np.ndarray[Any, Any] | None:
    """A transform that can be inverted: one that loses an axis leaves a thin sheet instead; None if it loses two."""
    if _is_regular(matrix):
        return matrix
    turned, lengths, axes = np.linalg.svd(matrix[:3, :3])
    if lengths[1] <= THIN * lengths[0]:
        return None
    lengths[2] = THIN * lengths[1]
    if np.linalg.det(turned) * np.linalg.det(axes) < 0:
        turned[:, 2] *= -1  # the front of its faces stays in front
    sheet = matrix.copy()
    sheet[:3, :3] = turned * lengths @ axes
    return sheet


def _is_regular(matrix: np.ndarray[Any, Any]) -> bool:
    """Whether a transform keeps volumes apart from zero, judged relative to the lengths of its columns."""
    linear = matrix[:3, :3]
    lengths = np.linalg.norm(linear, axis=0)
    return bool(lengths.all()) and abs(np.linalg.det(linear / lengths)) > 1e-12
