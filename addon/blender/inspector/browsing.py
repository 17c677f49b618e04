# SPDX-License-Identifier: GPL-3.0-or-later
"""Going from node to node of the last structure, which the overlay shows."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import EnumProperty, IntProperty

from ...core.base import native
from ...core.tree.table import Table, TreeError
from ..overlay import framing, replaying
from ..session import trees


def show(scene: Any, node: int) -> None:
    """Select a node, and let the overlay show it."""
    scene.halfspace.inspector.node = node
    settings = scene.halfspace.overlay
    settings.show = True
    settings.parts |= {"NODE"}


def frame(context: Any, tree: trees.Tree, table: Table) -> bool:
    """Turn the 3D view to the selected node. Returns whether there is a view."""
    node = context.scene.halfspace.inspector.node
    bounds = table.bounds[node if node < len(table) else 0].reshape(2, 3)
    return framing.frame(getattr(context, "screen", None), bounds + tree.origin, framing.NODE_MARGIN)


class HALFSPACE_OT_go_to_node(bpy.types.Operator):
    """Selects a node."""

    bl_idname = "halfspace.go_to_node"
    bl_label = "Go to Node"
    bl_description = "Select another node of the tree, and show it with its children and triangles"
    bl_options = {"REGISTER", "UNDO"}

    to: EnumProperty(  # type: ignore[valid-type]
        name="To",
        items=[
            ("ROOT", "Root", "The node that everything is below", 0),
            ("PARENT", "Parent", "The node above", 1),
            ("CHILD", "Child", "A child", 2),
            ("NEXT", "Next", "The next node with the same parent", 3),
            ("PREVIOUS", "Previous", "The previous node with the same parent", 4),
            ("COSTLIEST", "Costliest Child", "The child with the largest expected cost below it", 5),
            ("LEAF", "Costliest Leaf", "The leaf with the largest expected cost, which the view frames", 6),
            ("STEP", "Step of the Ray", "The node of the current step of the picked ray", 7),
        ],
        options={"SKIP_SAVE"},
    )
    index: IntProperty(name="Child", min=0, options={"SKIP_SAVE"})  # type: ignore[valid-type]

    @classmethod
    def poll(cls, context: Any) -> bool:
        return native.problem() is None and context.scene is not None and trees.last(context.scene) is not None

    def execute(self, context: Any) -> set[str]:
        scene = context.scene
        tree = trees.last(scene)
        assert tree is not None, "see poll"
        try:
            table = tree.table()
        except TreeError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        goal = self._goal(scene, table)
        if goal is None:
            self.report({"ERROR"}, "There is no such node")
            return {"CANCELLED"}
        show(scene, goal)
        if self.to == "LEAF":
            frame(context, tree, table)
        return {"FINISHED"}

    def _goal(self, scene: Any, table: Table) -> int | None:
        """The row of the node to go to; None if there is none."""
        settings = scene.halfspace.inspector
        node = settings.node if settings.node < len(table) else 0
        children = table.children_of(node)
        if self.to == "CHILD":
            return int(children[self.index]) if self.index < len(children) else None
        if self.to == "STEP":
            found = replaying.known(scene)
            return found.steps[min(settings.step, len(found)) - 1].node if found is not None and len(found) else None
        goals = {
            "ROOT": lambda: 0,
            "PARENT": lambda: max(int(table.parent[node]), 0),
            "NEXT": lambda: table.sibling(node, 1),
            "PREVIOUS": lambda: table.sibling(node, -1),
            "COSTLIEST": lambda: table.costliest_child(node),
            "LEAF": table.costliest_leaf,
        }
        return goals[self.to]()


class HALFSPACE_OT_frame_node(bpy.types.Operator):
    """Turns the view to the selected node."""

    bl_idname = "halfspace.frame_node"
    bl_label = "Frame"
    bl_description = "Move the 3D view to the selected node, which may be small"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return native.problem() is None and context.scene is not None and trees.last(context.scene) is not None

    def execute(self, context: Any) -> set[str]:
        tree = trees.last(context.scene)
        assert tree is not None, "see poll"
        try:
            found = frame(context, tree, tree.table())
        except TreeError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if not found:
            self.report({"ERROR"}, "There is no 3D view")
            return {"CANCELLED"}
        return {"FINISHED"}


CLASSES = (HALFSPACE_OT_go_to_node, HALFSPACE_OT_frame_node)
