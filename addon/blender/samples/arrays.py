# SPDX-License-Identifier: GPL-3.0-or-later
"""Scene files of arrays (.npz) in Blender: *File › Import*, and the mesh and camera that scripts make from them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from bpy.props import EnumProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from ...core.base import native
from ...core.scene import workload
from ..session import failures
from . import camera

if TYPE_CHECKING:
    from ...core.scene.workload import Workload


def add(scene: Any, loaded: Workload) -> Any:
    """Add a workload's triangles and its view's camera, in its own coordinates. Returns the object."""
    item = bpy.data.objects.new(loaded.name, mesh(loaded))
    scene.collection.objects.link(item)
    camera.see(scene, loaded.view)
    return item


def mesh(loaded: Workload) -> Any:
    """All triangles, flat, with one matte material."""
    made = bpy.data.meshes.new(loaded.name)
    count = len(loaded.triangles)
    # Fill the mesh's arrays directly, without Python code per triangle.
    made.vertices.add(len(loaded.vertices))
    made.loops.add(3 * count)
    made.polygons.add(count)
    made.attributes["position"].data.foreach_set("vector", loaded.vertices.reshape(-1))
    made.polygons.foreach_set("loop_start", np.arange(0, 3 * count, 3, dtype=np.int32))
    made.attributes[".corner_vert"].data.foreach_set("value", loaded.triangles.reshape(-1))
    made.polygons.foreach_set("use_smooth", np.zeros(count, bool))
    made.update()
    # Add a matte material.
    material = bpy.data.materials.new("Plaster")
    if material.node_tree is None:
        material.use_nodes = True
    shader = next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeBsdfPrincipled")
    shader.inputs["Base Color"].default_value = (0.62, 0.58, 0.52, 1.0)
    shader.inputs["Roughness"].default_value = 0.9
    shader.inputs["Specular IOR Level"].default_value = 0.2
    made.materials.append(material)
    return made


class HALFSPACE_OT_import_arrays(bpy.types.Operator, ImportHelper):
    """Imports a scene file of arrays."""

    bl_idname = "halfspace.import_arrays"
    bl_label = "Import Arrays"
    bl_description = "Import triangles and a camera from a NumPy archive, as Halfspace's commands read them"
    bl_options = {"REGISTER", "UNDO"}

    filename_ext = ".npz"
    filter_glob: StringProperty(default="*.npz", options={"HIDDEN"})  # type: ignore[valid-type]

    up_axis: EnumProperty(  # type: ignore[valid-type]
        name="Up Axis",
        description="Axis of the file that points upwards in Blender",
        items=[
            ("FILE", "As in the File", "The axis that the file names, or Z", 0),
            ("X", "X", "", 1),
            ("Y", "Y", "", 2),
            ("Z", "Z", "", 3),
        ],
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        return native.problem() is None and context.scene is not None

    def execute(self, context: Any) -> set[str]:
        try:
            limit = native.load().free_memory()
            loaded = workload.load_npz(Path(bpy.path.abspath(self.filepath)), memory_limit=limit)
        except BaseException as error:
            return failures.reported(self, error)
        item = add(context.scene, loaded.upright(loaded.up_axis if self.up_axis == "FILE" else self.up_axis.lower()))
        item.select_set(True)
        context.view_layer.objects.active = item
        return {"FINISHED"}


def _menu(self: Any, _context: Any) -> None:
    self.layout.operator(HALFSPACE_OT_import_arrays.bl_idname, text="Halfspace Arrays (.npz)")


CLASSES = (HALFSPACE_OT_import_arrays,)


def register() -> None:
    """Add the entry in *File › Import*."""
    bpy.types.TOPBAR_MT_file_import.append(_menu)


def unregister() -> None:
    """Undo `register`."""
    bpy.types.TOPBAR_MT_file_import.remove(_menu)
