# SPDX-License-Identifier: GPL-3.0-or-later
"""The second structure of the inspector, over the triangles of the last one: the one that cost maps show next to it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import bpy

from ...core.base import native
from ...core.overlay.cells import Path
from ...core.structures import catalogue
from ...core.structures.settings import memory_limit
from ..overlay import picking
from ..session import failures, trees
from ..session.trees import Tree
from ..state import Slot

SECOND: Slot[tuple[int, Tree]] = Slot()
"""The number of the first tree, and the second."""

PATHS: Slot[tuple[tuple[int, int, picking.Ray], tuple[Path, Path]]] = Slot()
"""The numbers of both trees and the ray, and its paths."""


def chosen(scene: Any) -> str:
    """Id of the chosen second structure; "" if there is none."""
    found = catalogue.load().get(scene.halfspace.second)
    return "" if found is None else str(found.id)


def known(scene: Any) -> Tree | None:
    """The second structure, if it was built over the triangles of the scene's last tree."""
    first, found = trees.last(scene), SECOND.of(scene)
    if found is None:
        return None
    if first is None or found[0] != first.number:
        SECOND.keep(scene, None)
        return None
    return found[1] if found[1].spec == chosen(scene) else None


def find(scene: Any, first: Tree) -> Tree | None:
    """The second structure, built if it is not known; None if none is chosen. Raises what builds raise."""
    spec, found = chosen(scene), known(scene)
    if not spec or found is not None:
        return found
    limit = memory_limit(scene.halfspace.memory_limit)
    structure = native.load().build(first.vertices, first.triangles, spec, memory_limit=limit)
    label = catalogue.load()[spec].label
    made = replace(first, structure=structure, spec=spec, label=label)
    SECOND.keep(scene, (first.number, made))
    return made


def paths(scene: Any) -> tuple[Path, Path] | None:
    """The paths of the picked ray through the last structure and through the second one, if all are known."""
    first, tree, ray = trees.last(scene), known(scene), picking.last(scene)
    if first is None or tree is None or ray is None:
        return None
    key, found = (first.number, tree.number, ray), PATHS.of(scene)
    if found is None or found[0] != key:
        found = key, (ray.path(first), ray.path(tree))
        PATHS.keep(scene, found)
    return found[1]


class HALFSPACE_OT_build_second(bpy.types.Operator):
    """Builds the second structure."""

    bl_idname = "halfspace.build_second"
    bl_label = "Build the Second"
    bl_description = "Build the second structure over the same triangles, to compare the picked ray in both"

    @classmethod
    def poll(cls, context: Any) -> bool:
        scene = context.scene
        return native.problem() is None and scene is not None and trees.last(scene) is not None and bool(chosen(scene))

    def execute(self, context: Any) -> set[str]:
        first = trees.last(context.scene)
        assert first is not None, "see poll"
        try:
            find(context.scene, first)
        except BaseException as error:
            return failures.reported(self, error, "build the second structure")
        trees.redraw_panels()
        return {"FINISHED"}


CLASSES = (HALFSPACE_OT_build_second,)
