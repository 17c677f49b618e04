# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of a structure: first what matters most, all others in closed parts. Generated from the catalogue."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import bpy

from ...core.base import native
from ...core.structures import catalogue, relevance
from ...core.structures.settings import same
from ..session import reports
from ..settings import presets, properties, quality
from .texts import fold, wrapped

if TYPE_CHECKING:
    from ...core.structures.catalogue import Parameter, Structure

PARTS = {"builder": "Builder", "costs": "Costs", "numerics": "Numerics"}
"""Titles of the closed parts, by the group of their parameters."""

RAY_PARAMETERS = {relevance.NODES, relevance.TRAVERSAL, "shadow"}
"""Parameters of the first part that are about rays and not about the tree."""

LABEL = 0.48
"""Share of the width that labels take: at the default width this fits 17 characters, and the values fit 14."""

NODES = {
    "planes": "Planes",
    "wide": "Wide Planes",
    "boxes": "Boxes",
    "intervals": "Intervals",
    "octants": "Octants",
    "cells": "Cells",
}
"""Names of the kinds of nodes of structures that have only one."""

RAYS = {
    "single": "One by One",
    "flight": "In Flight",
    "packet": "Packets",
    "tile": "Tiles",
    "beam": "Beams",
    "stream": "Streams",
    "auto": "Automatic",
}
"""Names of the kinds of rays of structures that have only one."""


def draw(layout: Any, group: Any) -> None:
    """Draw the choice of a structure, its parameters that have an effect, and its source."""
    presets.draw(layout)
    draw_choice(layout, group)
    chosen = properties.structure(group)
    shown = properties.shown(group)
    # Nodes and rays follow the parameters of the tree, chosen or not.
    named = False
    for parameter in shown["main"]:
        if parameter.name in RAY_PARAMETERS and not named:
            _name_only_kinds(layout, chosen)
            named = True
        _field(layout, group, parameter)
    if not named:
        _name_only_kinds(layout, chosen)
    for key, title in PARTS.items():
        _part(layout, group, key, title, shown[key])
    if (body := fold(layout, "source", "Source")) is not None:
        wrapped(body, chosen.paper, icon="BOOKMARKS")


def draw_choice(layout: Any, group: Any) -> None:
    """Draw the choice of a structure, without its parameters."""
    layout.prop(group, "structure", text="")
    if not group.structure:
        wrapped(layout, f"{properties.UNKNOWN}: {properties.structure(group).label}", icon="ERROR")


def draw_top(layout: Any, scene: Any) -> None:
    """Draw the choice of the tree over instances, where they are kept."""
    mode = quality.instancing(scene.halfspace)
    if mode == "two-level" or (mode == "auto" and reports.KEPT.of(scene)):
        layout.prop(scene.halfspace, "top")


def _part(layout: Any, group: Any, key: str, title: str, parameters: list[Parameter]) -> None:
    """Draw a part that is closed at first. Its title contains the number of values that are not the defaults."""
    if not parameters:
        return
    changed = sum(not same(getattr(group, one.name), one.default) for one in parameters)
    body = fold(layout, key, f"{title}, {changed} changed" if changed else title)
    if body is not None:
        column = body.column()
        for parameter in parameters:
            _field(column, group, parameter)


def _field(layout: Any, group: Any, parameter: Parameter) -> None:
    """Draw a parameter: a number, a check box, or a menu of the options that are valid here."""
    label = parameter.label
    if parameter.is_switch:
        row = _row(layout, "")
        row.prop(group, properties.switch(parameter.name), text=label)
        return
    row = _row(layout, label)
    if parameter.kind != "choice":
        row.prop(group, parameter.name, text="")
        return
    names = dict(properties.options(group, parameter.name))
    value = properties.values(group)[parameter.name]
    row.menu(menu_of(parameter.name), text=names.get(str(value), str(value)))


def _name_only_kinds(layout: Any, chosen: Structure) -> None:
    """Name the nodes, and the rays, of a structure that has only one kind of them."""
    kinds = {way.nodes for way in chosen.ways}
    if chosen.parameter(relevance.NODES) is None and len(kinds) == 1 and kinds <= NODES.keys():
        _row(layout, "Nodes").label(text=NODES[kinds.pop()])
    kinds = {way.rays for way in chosen.ways}
    if chosen.parameter(relevance.TRAVERSAL) is None and len(kinds) == 1 and kinds <= RAYS.keys():
        _row(layout, "Rays").label(text=RAYS[kinds.pop()])


def _row(layout: Any, label: str) -> Any:
    """A row with a label on the left. Returns the layout of the value."""
    split = layout.split(factor=LABEL, align=True)
    split.use_property_split = False
    left = split.row()
    left.alignment = "RIGHT"
    left.label(text=label)
    return split


def menu_of(name: str) -> str:
    """The identifier of the menu that offers the options of a choice."""
    return f"HALFSPACE_MT_choice_{name}"


class _Choice:
    """A menu of the options of a choice that are valid with the other settings."""

    name = ""

    def draw(self, context: Any) -> None:
        group = context.scene.halfspace
        for option, label in properties.options(group, self.name):
            self.layout.prop_enum(group, self.name, option, text=label)  # type: ignore[attr-defined]


_registered: list[type] = []


def register() -> None:
    """Register a menu for each choice of the catalogue."""
    if native.problem() is not None:
        return
    for parameter in catalogue.load().parameters().values():
        if parameter.kind == "choice" and not parameter.is_switch:
            content = {"bl_label": parameter.label, "bl_description": parameter.doc, "name": parameter.name}
            menu = type(menu_of(parameter.name), (_Choice, bpy.types.Menu), content)
            bpy.utils.register_class(menu)
            _registered.append(menu)


def unregister() -> None:
    """Undo `register`."""
    while _registered:
        bpy.utils.unregister_class(_registered.pop())
