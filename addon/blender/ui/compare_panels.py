# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels that compare structures for the open scene, in the sidebar and in the render properties."""

from __future__ import annotations

from typing import Any

import bpy

from ...core.base import native
from ...core.choose import choice
from ...core.choose.choice import Comparison, Line
from ...core.structures import catalogue
from ..measure import compare_operators, comparing
from ..settings import presets, properties
from . import panels, structure
from .texts import wrapped


class _ComparePanel:
    bl_label = "Compare"
    section = "Compare"

    def draw(self, context: Any) -> None:
        layout, scene = self.layout, context.scene  # type: ignore[attr-defined]
        layout.operator(compare_operators.HALFSPACE_OT_choose.bl_idname, icon="SHADERFX")
        structure.draw_top(layout, scene)
        _ticks(layout, scene.halfspace)
        layout.operator(compare_operators.HALFSPACE_OT_compare.bl_idname, icon="SORTTIME")
        now = comparing.progress()
        if now is not None:
            layout.progress(factor=now[0], text=now[1])
        found = comparing.last(scene)
        if found is None:
            return
        if found.stale:
            layout.label(text="The scene has changed since", icon="ERROR")
        _table(layout, found.comparison)
        for line in found.notes:
            wrapped(layout, line)
        layout.operator(compare_operators.HALFSPACE_OT_write_report.bl_idname, icon="FILE_TICK")


def _ticks(layout: Any, group: Any) -> None:
    """Check boxes for all structures, collapsed; the chosen structure is always compared."""
    header, body = layout.panel("HALFSPACE_compared", default_closed=True)
    header.label(text=f"{len(comparing.ticked(group))} structures")
    if body is not None:
        flow = body.grid_flow(row_major=True, columns=2, even_columns=True)
        for one in catalogue.load().structures:
            flow.prop(group.compared, properties.tick(one.id))


def _table(layout: Any, found: Comparison) -> None:
    """Two lines per configuration, best first: its name, and its predicted times."""
    box = layout.box()
    for line in found.lines:
        name = comparing.name(line.spec)
        if line.problem:
            wrapped(box, f"{name}: {line.problem}", icon="ERROR")
            continue
        column = box.column(align=True)
        row = column.row()
        row.label(text=name, icon=_mark(found, line))
        row.operator(presets.HALFSPACE_OT_use_spec.bl_idname, text="", icon="CHECKMARK").spec = line.spec
        row = column.row()
        for text, seconds in (("Build", line.build), ("Render", line.trace), ("Both", line.total)):
            row.label(text=f"{text} {_seconds(seconds)}")
    # Show errors with the times: every time comes with the check of its answers.
    checked = sum(line.checked for line in found.lines)
    if checked:
        wrong = sum(line.wrong for line in found.lines)
        wrapped(box, f"{checked:,} answers compared with brute force, {wrong:,} wrong")
    if any(not line.checked and not line.problem for line in found.lines):
        wrapped(box, choice.NOT_COMPARED.capitalize())
    wrapped(box, "Render: all rays of the picture at the measured speeds, without shading")


def _mark(found: Comparison, line: Line) -> str:
    """Icon of a line: a filled star for the least build plus render, a clock for the fastest rays."""
    if line is found.best:
        return "SOLO_ON"
    return "SORTTIME" if line is found.fastest else "BLANK1"


def _seconds(value: float) -> str:
    return f"{value:.2f} s" if value < 10 else f"{value:,.0f} s"


class HALFSPACE_PT_view_compare(_ComparePanel, panels.SidebarPanel, bpy.types.Panel):
    """Comparison panel in the sidebar of the 3D viewport."""


class HALFSPACE_PT_compare(_ComparePanel, panels.EnginePanel, bpy.types.Panel):
    """Comparison panel in the render properties."""

    @classmethod
    def poll(cls, context: Any) -> bool:
        return super().poll(context) and native.problem() is None


CLASSES = (HALFSPACE_PT_view_compare, HALFSPACE_PT_compare)
