# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that the inspector shows as files: tables as CSV, the cost map as PNG."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from ...core.base import csv_text, native
from ...core.inspector import csv_files, page
from ...core.report import results
from ..measure import cost_maps, pictures
from ..overlay import picking, replaying
from ..session import failures, trees
from . import levels, second, worst

WHAT = (
    ("NODES", "Nodes", "All nodes of the tree: place, box, share, SAH cost, triangles", 0),
    ("STEPS", "Steps of the Ray", "All steps of the picked ray: node, interval, tests", 1),
    ("RAYS", "Rays", "All rays of the chosen set, the worst first: rank, pixel, steps, tests, time", 2),
    ("LEVELS", "Levels", "SAH cost, overlap and fitted time of each level", 3),
    ("MAP", "Cost Map, Numbers", "The numbers of each pixel of the last cost map", 4),
    ("PICTURE", "Cost Map, Picture", "The last cost map as PNG, with its histograms", 5),
    (
        "PAGE",
        "Page",
        "Maps, worst rays, tree and levels of the last structure, and of the second one of the cost maps",
        6,
    ),
)
"""Kinds of export; all as CSV but the last two."""

SUFFIXES = {"PICTURE": ".png", "PAGE": ".html"}


class ExportError(ValueError):
    """There is nothing to write. The message states what to do first."""


def text(scene: Any, what: str) -> str:
    """A table as CSV. Raises ExportError, WorkloadError, TreeError."""
    if what == "MAP":
        return csv_text.text(csv_files.pixels(dict(_maps().maps)))
    tree = trees.last(scene)
    if tree is None:
        raise ExportError("Build a structure first")
    rows: dict[str, Callable[[], Any]] = {
        "NODES": lambda: csv_files.nodes(tree.table()),
        "STEPS": lambda: csv_files.steps(tree.table(), _replay(scene, tree)),
        "RAYS": lambda: _rays(scene, tree),
    }
    if what == "LEVELS":
        return csv_text.text((levels.known(scene) or levels.measure(scene, tree)).rows())
    return csv_text.text(rows[what]())


def page_of(scene: Any) -> str:
    """The page of the last structure, with the second structure of cost maps. Raises what `text` and builds raise."""
    tree = trees.last(scene)
    if tree is None:
        raise ExportError("Build a structure first")
    module, found = native.load(), worst.find(scene, tree)
    structures = [(tree.label, tree.structure)]
    other = second.find(scene, tree)
    if other is not None:
        structures.append((other.label, other.structure))
    return page.inspect(module, found.workload, structures, found.size).html


def _maps() -> cost_maps.Kept:
    """The maps of the picture, whichever scene they show."""
    for kept in cost_maps.KEPT.all():
        return kept
    raise ExportError("Show a cost map first")


def _rays(scene: Any, tree: trees.Tree) -> Any:
    settings, found = scene.halfspace.inspector, worst.find(scene, tree)
    return csv_files.rays(found.costs[settings.rays], settings.order, worst.times(found, tree, settings.rays))


def _replay(scene: Any, tree: trees.Tree) -> Any:
    ray = picking.last(scene)
    if ray is None:
        raise ExportError("Pick a ray first")
    found = replaying.replay(scene, tree, ray.path(tree))
    if found is None:
        raise ExportError("The structure has no tree")
    return found


class HALFSPACE_OT_export_inspector(bpy.types.Operator):
    """Writes a file."""

    bl_idname = "halfspace.export_inspector"
    bl_label = "Export"
    bl_description = "Write what the inspector shows into a file"

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})  # type: ignore[valid-type]
    check_existing: BoolProperty(default=True, options={"HIDDEN"})  # type: ignore[valid-type]
    what: EnumProperty(name="What", items=WHAT)  # type: ignore[valid-type]

    @classmethod
    def poll(cls, context: Any) -> bool:
        return native.problem() is None and context.scene is not None

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Ask for the file."""
        self.filepath = f"halfspace-{self.what.lower()}{self._suffix()}"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: Any) -> set[str]:
        path = Path(bpy.path.ensure_ext(bpy.path.abspath(self.filepath), self._suffix()))
        try:
            if self.what == "PICTURE":
                pictures.save(path, _maps().picture(context.scene))
            else:
                content = page_of(context.scene) if self.what == "PAGE" else text(context.scene, self.what)
                results.write(path, content)
        except BaseException as error:
            return failures.reported(self, error)
        self.report({"INFO"}, f"Wrote {path}")
        return {"FINISHED"}

    def _suffix(self) -> str:
        return SUFFIXES.get(self.what, ".csv")


CLASSES = (HALFSPACE_OT_export_inspector,)
