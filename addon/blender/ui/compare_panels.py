# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel that compares structures for the open scene."""

from __future__ import annotations

from typing import Any

import bpy

from ...core.choose import choice
from ...core.choose.choice import Comparison, Line
from ...core.structures import catalogue
from ..measure import compare_operators, comparing
from ..settings import presets, properties
from . import panels, structure
from .texts import counted, fold, wrapped


class HALFSPACE_PT_view_compare(panels.SidebarPanel, bpy.types.Panel):
    """Comparison of structures, and automatic choice of one."""

    bl_label = "Compare"
    section = "Compare"

    def draw(self, context: Any) -> None:
        layout, scene = self.layout, context.scene
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
        if found.name == comparing.CHOOSE:
            answer(layout, found)
        else:
            _table(layout, found.comparison)
            for line in found.notes:
                wrapped(layout, line)
        layout.operator(compare_operators.HALFSPACE_OT_write_report.bl_idname, icon="FILE_TICK")


def answer(layout: Any, found: comparing.Found) -> None:
    """Draw the answer of an automatic choice in three lines, and the measurements below in a closed part."""
    column = layout.column(align=True)
    for line, icon in zip(found.comparison.answer(comparing.name), ("SOLO_ON", "TIME", "INFO"), strict=False):
        wrapped(column, line, icon=icon)
    if (body := fold(layout, "chosen", f"{counted(len(found.comparison.lines), 'structure')} measured")) is not None:
        _table(body, found.comparison)
        for line in found.rest:
            wrapped(body, line)


def _ticks(layout: Any, group: Any) -> None:
    """Check boxes for all structures, collapsed; the chosen structure is always compared."""
    if (body := fold(layout, "compared", f"{len(comparing.ticked(group))} structures")) is not None:
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


CLASSES = (HALFSPACE_PT_view_compare,)
