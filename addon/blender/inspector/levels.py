# SPDX-License-Identifier: GPL-3.0-or-later
"""SAH cost, overlap and fitted time of each level of the last structure, and of the second one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import bpy

from ...core.base import native
from ...core.choose import auto
from ...core.inspector import levels as measuring
from ...core.inspector.levels import Levels
from ...core.measure.reference import Reference, affordable
from ..session import failures, trees
from ..state import Slot
from . import second, worst


@dataclass(frozen=True, eq=False)
class Measured:
    """The levels of a tree for the rays of a view, and sentences about their sums. wrong: of the `compared`
    answers of the structure. beside: the levels of the second structure, if there is one.
    """

    rays: worst.Found
    spec: str
    levels: Levels
    lines: tuple[str, ...]
    wrong: int
    compared: int
    beside: Measured | None = None

    def rows(self) -> Iterator[dict[str, Any]]:
        """The levels of both structures, for files."""
        for row in self.levels.rows(self.wrong, self.compared):
            yield {"structure": self.spec, **row}
        if self.beside is not None:
            yield from self.beside.rows()


MEASURED: Slot[Measured] = Slot()
"""Valid while `rays` is what `worst.known` returns."""


def known(scene: Any) -> Measured | None:
    """The levels of the scene's last tree, if they were measured for the camera's view."""
    measured = MEASURED.of(scene)
    return measured if measured is not None and measured.rays is worst.known(scene) else None


def measure(scene: Any, tree: trees.Tree) -> Measured:
    """Measure the levels of the scene's tree, and of the second structure. Raises WorkloadError, TreeError, and what
    builds raise.
    """
    found = worst.find(scene, tree)
    other = second.find(scene, tree)
    beside = None if other is None else _measure(found, other, None)
    measured = _measure(found, tree, beside)
    MEASURED.keep(scene, measured)
    return measured


def _measure(found: worst.Found, tree: trees.Tree, beside: Measured | None) -> Measured:
    """The levels of a structure for these rays."""
    primary = found.costs["primary"]
    made = measuring.measure(tree.structure, tree.table(), found.workload, primary)
    # Every time is shown with the errors of the same structure.
    reference = Reference(
        native.load(), found.workload, [primary.rays], min(auto.CHECKED, affordable(found.workload)), seed=0
    )
    wrong = reference.wrong(tree.structure)
    lines = measuring.sentences(made, wrong, len(reference))
    return Measured(found, tree.spec, made, tuple(lines), wrong, len(reference), beside)


class HALFSPACE_OT_measure_levels(bpy.types.Operator):
    """Measures the levels."""

    bl_idname = "halfspace.measure_levels"
    bl_label = "Measure Levels"
    bl_description = (
        "Expected cost, end-point overlap and fitted time of each level of the tree, for the rays of the camera's "
        "view: at which depth is the time spent? With a second structure, of both for the same rays"
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        return native.problem() is None and context.scene is not None and trees.last(context.scene) is not None

    def execute(self, context: Any) -> set[str]:
        tree = trees.last(context.scene)
        assert tree is not None, "see poll"
        try:
            measure(context.scene, tree)
        except BaseException as error:
            return failures.reported(self, error, "measure the levels")
        trees.redraw_panels()
        return {"FINISHED"}


CLASSES = (HALFSPACE_OT_measure_levels,)
