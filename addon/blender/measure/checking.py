# SPDX-License-Identifier: GPL-3.0-or-later
"""Statistics of the last structure: its properties, its speed, and a check of a sample of its answers.

Panels only read results; the operator measures.
"""

from __future__ import annotations

from typing import Any

import bpy

from ...core.base import native
from ...core.choose import choice
from ...core.measure import check
from ...core.measure.check import Check
from ..session import building, failures, reports, trees
from ..settings import properties
from . import workloads


def words(tree: trees.Tree) -> str:
    """A short text on the tree's checked answers, for use next to its speed."""
    found = tree.check
    if found is None:
        return choice.NOT_COMPARED
    return f"{found.errors.rays:,} answers {'right' if found.right else 'compared, some WRONG'}"


class HALFSPACE_OT_check(bpy.types.Operator):
    """Measures the structure."""

    bl_idname = "halfspace.check"
    bl_label = "Measure a Sample"
    bl_description = (
        "Trace the camera's rays, their shadow rays and bounces, and rays in the planes of triangles through the "
        "structure, and compare a sample of the answers with brute force, bit for bit. Takes seconds in large scenes"
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        return native.problem() is None and context.scene is not None

    def execute(self, context: Any) -> set[str]:
        scene = context.scene
        render = scene.render
        size = (max(render.resolution_x, 1), max(render.resolution_y, 1))
        try:
            depsgraph = context.evaluated_depsgraph_get()  # first, because evaluation reports changes
            tree = _chosen(scene) or trees.usable(scene, properties.spec(scene.halfspace))
            if tree is None:
                building.build_now(scene, depsgraph)
                tree = trees.last(scene)
                assert tree is not None
            # Run the check to its last result.
            workload = workloads.of_tree(tree, scene.name, size)
            found: Check | None = None
            for found in check.steps(native.load(), tree.structure, workload, threads=0):  # noqa: B007 (the last)
                pass
        except BaseException as error:
            return failures.reported(self, error, "measure the structure")
        for line in workload.notes:
            self.report({"WARNING"}, line)
        tree.check = found
        trees.redraw()
        return {"FINISHED"}


def _chosen(scene: Any) -> trees.Tree | None:
    """The structure selected automatically by the last render, which is then the one to measure, or None."""
    tree, report = trees.last(scene), reports.last(scene)
    if not scene.halfspace.automatic or tree is None or report is None or report.tree != tree.number:
        return None
    return trees.usable(scene, tree.spec)


CLASSES = (HALFSPACE_OT_check,)
