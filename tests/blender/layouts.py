# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawing panels without a window."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import bpy


class Layout:
    """Records what a panel draws; stands for `bpy.types.UILayout`."""

    def __init__(self, log: list[str] | None = None, operators: list[Any] | None = None) -> None:
        self.log: list[str] = [] if log is None else log
        self.operators: list[Any] = [] if operators is None else operators
        self.menus: dict[str, str] = {}
        self.parts: list[str] = []
        self.labels: dict[tuple[str, str], str | None] = {}

    def _within(self) -> Layout:
        """A layout inside this one, with the same record."""
        inner = Layout(self.log, self.operators)
        inner.menus, inner.parts, inner.labels = self.menus, self.parts, self.labels
        return inner

    def __getattr__(self, name: str) -> Any:
        def call(*args: Any, **kwargs: Any) -> Any:
            if name in ("prop", "prop_search"):
                assert args[1] in args[0].bl_rna.properties, args[1]
                self.log.append(args[1])
                self.labels[_declared(args[0], args[1]), args[1]] = kwargs.get("text")
            elif name == "label":
                self.log.append(kwargs["text"])
            elif name == "menu":
                assert hasattr(bpy.types, args[0]), args[0]
                self.log.append(args[0])
                self.menus[args[0]] = kwargs.get("text", "")
            elif name == "prop_enum":
                self.log.append(args[2])
            elif name == "operator":
                self.operators.append(SimpleNamespace(id=args[0]))
                return self.operators[-1]
            elif name == "panel":
                self.parts.append(args[0])
                return self._within(), self._within()
            return self._within()

        return call


def _declared(owner: Any, name: str) -> str:
    """The name of the most general type of Blender's data that has this property."""
    kind = owner.bl_rna
    while kind.base is not None and name in kind.base.properties:
        kind = kind.base
    return str(kind.identifier)


def draw_own(panel: type, context: Any) -> Layout:
    """What one of Blender's panels, or of ours, draws in this context."""
    attributes = {}
    for base in reversed(panel.__mro__):
        if base.__module__ not in ("builtins", "bpy_types", "_bpy_types") and base is not bpy.types.Panel:
            attributes |= {name: value for name, value in vars(base).items() if not name.startswith("__")}
    stand_in = type("Panel", (), {**attributes, "layout": Layout()})()
    for method in ("draw_header", "draw"):
        if hasattr(stand_in, method):
            getattr(stand_in, method)(context)
    layout: Layout = stand_in.layout
    return layout


def draw_all(panel: type, **context: Any) -> Layout:
    """What a panel draws, header included."""
    attributes = {key: value for key, value in vars(panel).items() if not key.startswith("bl_")}
    for base in panel.__mro__:
        if base.__module__.startswith("addon"):
            attributes = {**{k: v for k, v in vars(base).items() if not k.startswith("__")}, **attributes}
    attributes.pop("__dict__", None)
    stand_in = type("Panel", (), {**attributes, "layout": Layout()})()
    where = SimpleNamespace(**context)
    stand_in.draw(where)
    for header in ("draw_header", "draw_header_preset"):
        if hasattr(stand_in, header):
            getattr(stand_in, header)(where)
    layout: Layout = stand_in.layout
    return layout


def draw(panel: type, **context: Any) -> list[str]:
    """The properties and labels that a panel draws, in order."""
    return draw_all(panel, **context).log
