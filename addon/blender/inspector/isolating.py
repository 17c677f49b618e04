# SPDX-License-Identifier: GPL-3.0-or-later
"""Only the objects that the selected node's triangles belong to, in Blender's own local view.

Local view belongs to a 3D view and changes no object, so that the structure stays valid. A view that is in local view
already belongs to the user and is left alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ...core.tree.table import TreeError
from ..session import trees
from ..settings import signals

_ours: set[int] = set()
"""Addresses of the 3D views that were put into local view here."""


def objects(scene: Any) -> set[str]:
    """Full names of the objects that triangles of the selected node belong to; none without a tree."""
    tree = trees.last(scene)
    if tree is None:
        return set()
    try:
        table = tree.table()
    except TreeError:
        return set()
    node = scene.halfspace.inspector.node
    return tree.owners(table.triangles_of(node if node < len(table) else 0))


def follow(scene: Any) -> None:
    """Show in the scene's 3D views what the settings request: all objects, or those of the selected node."""
    wanted = objects(scene) if scene.halfspace.inspector.isolated else set()
    for window, area, space in _views(scene):
        if wanted and (space.local_view is None or space.as_pointer() in _ours):
            _show(window, area, space, wanted)
        elif not wanted:
            _leave(window, area, space)


def _views(scene: Any) -> Iterator[tuple[Any, Any, Any]]:
    """Window, area and space of each 3D view of the scene."""
    manager = bpy.context.window_manager
    for window in manager.windows if manager is not None else ():
        for area in window.screen.areas if window.scene == scene else ():
            if area.type == "VIEW_3D":
                yield window, area, area.spaces.active


def _show(window: Any, area: Any, space: Any, wanted: set[str]) -> None:
    """Show only these objects, and the instancers that show them; nothing changes if none of them can be shown."""
    layer = window.view_layer
    members = list(layer.objects)
    shown = [item for item in members if item.name_full in wanted]
    instancers = _instancers(layer, wanted)
    shown += [item for item in members if item.name_full in instancers and item not in shown]
    if space.local_view is None:
        # Local view begins with the selected objects; the selection is put back as it was.
        selected = {item for item in members if item.select_get(view_layer=layer)}
        for item in members:
            item.select_set(item in shown, view_layer=layer)
        _toggle(window, area)
        for item in members:
            item.select_set(item in selected, view_layer=layer)
        if space.local_view is None:
            return
        _ours.add(space.as_pointer())
    for item in members:
        item.local_view_set(space, item in shown)
    area.tag_redraw()


def _instancers(layer: Any, wanted: set[str]) -> set[str]:
    """Full names of the objects that show one of these objects as an instance."""
    found = set()
    for instance in layer.depsgraph.object_instances:
        if instance.is_instance and instance.instance_object.name_full in wanted:
            found.add(instance.parent.name_full)
    return found


def _leave(window: Any, area: Any, space: Any) -> None:
    """Show all objects again, if this view was put into local view here."""
    if space.as_pointer() in _ours:
        _ours.discard(space.as_pointer())
        if space.local_view is not None:
            _toggle(window, area)


def _toggle(window: Any, area: Any) -> None:
    """Enter or leave local view, without a change of the view's place."""
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window, screen=window.screen, area=area, region=region):
        if bpy.ops.view3d.localview.poll():
            bpy.ops.view3d.localview(frame_selected=False)


def _end() -> None:
    """Show all objects in all views, and let no scene request anything else."""
    for scene in bpy.data.scenes:
        settings = scene.halfspace.inspector
        if settings.isolated:
            settings.isolated = False
        follow(scene)
    _ours.clear()


@persistent
def _stepped(*_: Any) -> None:
    """After undo or redo, which change settings without a callback."""
    for scene in bpy.data.scenes:
        follow(scene)


@persistent
def _before_loading(*_: Any) -> None:
    """Another file is loaded: end isolation, because screens may outlive the file."""
    _end()


def _file_loaded(_scene: Any) -> None:
    """A file that was saved with isolated objects shows all of them again: its structure is not part of it."""
    for scene in bpy.data.scenes:
        if scene.halfspace.inspector.isolated:
            _ours.update(space.as_pointer() for _, _, space in _views(scene) if space.local_view is not None)
    _end()


def _watched() -> tuple[tuple[Any, Any], ...]:
    handlers = bpy.app.handlers
    return (
        (handlers.undo_post, _stepped),
        (handlers.redo_post, _stepped),
        (handlers.load_pre, _before_loading),
    )


def register() -> None:
    """Listen to the settings, to new structures, to undo and to loaded files."""
    signals.node_changed.connect(follow)
    signals.tree_changed.connect(follow)
    signals.file_loaded.connect(_file_loaded)
    for handlers, function in _watched():
        handlers.append(function)


def unregister() -> None:
    """Undo `register`, and show all objects again."""
    _end()
    for handlers, function in _watched():
        handlers.remove(function)
    signals.file_loaded.disconnect(_file_loaded)
    signals.tree_changed.disconnect(follow)
    signals.node_changed.disconnect(follow)
