# SPDX-License-Identifier: GPL-3.0-or-later
"""The second structure of the inspector, over the triangles of the last one: the one that cost maps show beside it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ...core.base import native
from ...core.overlay.cells import Path
from ...core.structures import catalogue
from ...core.structures.settings import memory_limit
from ..overlay import picking
from ..session import failures, trees
from ..session.trees import Tree

_known: dict[int, tuple[int, Tree]] = {}
"""By the scene's `session_uid`: the number of the first tree, and the second."""

_paths: dict[int, tuple[tuple[int, int, picking.Ray], tuple[Path, Path]]] = {}
"""By the scene's `session_uid`: the numbers of both trees and the ray, and its paths."""


def chosen(scene: Any) -> str:
    """Id of the chosen second structure; "" if there is none."""
    found = catalogue.load().get(scene.halfspace.second)
    return "" if found is None else str(found.id)


def known(scene: Any) -> Tree | None:
    """The second structure, if it was built over the triangles of the scene's last tree."""
    uid, first = scene.original.session_uid, trees.last(scene)
    found = _known.get(uid)
    if found is None:
        return None
    if first is None or found[0] != first.number:
        del _known[uid]  # frees its memory
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
    made = replace(first, structure=structure, spec=spec, label=label, number=next(trees.NUMBERS))
    made.known_table = made.known_survey = None
    _known[scene.original.session_uid] = first.number, made
    return made


def paths(scene: Any) -> tuple[Path, Path] | None:
    """The paths of the picked ray through the last structure and through the second one, if all are known."""
    first, tree, ray = trees.last(scene), known(scene), picking.last(scene)
    if first is None or tree is None or ray is None:
        return None
    key, found = (first.number, tree.number, ray), _paths.get(scene.original.session_uid)
    if found is None or found[0] != key:
        found = key, (ray.path(first), ray.path(tree))
        _paths[scene.original.session_uid] = found
    return found[1]


def clear() -> None:
    """Free all second structures."""
    _known.clear()
    _paths.clear()


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


@persistent
def _file_loaded(*_: Any) -> None:
    clear()


def register() -> None:
    """Register the operator, and the handler of loaded files."""
    bpy.utils.register_class(HALFSPACE_OT_build_second)
    bpy.app.handlers.load_post.append(_file_loaded)


def unregister() -> None:
    """Undo `register`, and free all structures."""
    bpy.app.handlers.load_post.remove(_file_loaded)
    bpy.utils.unregister_class(HALFSPACE_OT_build_second)
    clear()
