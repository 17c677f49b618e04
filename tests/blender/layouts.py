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

    def _within(self) -> Layout:
        """A layout inside this one, with the same record."""
        inner = Layout(self.log, self.operators)
        inner.menus, inner.parts = self.menus, self.parts
        return inner

    def __getattr__(self, name: str) -> Any:
        def call(*args: Any, **kwargs: Any) -> Any:
            if name == "prop":
                assert args[1] in args[0].bl_rna.properties, args[1]
                self.log.append(args[1])
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
    return stand_in.layout  # type: ignore[no-any-return]


def draw(panel: type, **context: Any) -> list[str]:
    """The properties and labels that a panel draws, in order."""
    return draw_all(panel, **context).log
