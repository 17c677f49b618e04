# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawing panels and running operators without a window."""

import time
from types import FunctionType, MethodType, SimpleNamespace
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

    def _within(self) -> Any:
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
                self.operators.append(SimpleNamespace(id=args[0], text=kwargs.get("text")))
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
    """The items that one of Blender's panels, or of ours, draws in this context."""
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
    """The items that a panel draws, header included."""
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


def operator(kind: type, **own: Any) -> Any:
    """An operator's own part, which Blender makes only in a window; `said` has its reports. own: its properties."""
    said: list[str] = []
    made = SimpleNamespace(said=said, report=lambda _kind, text: said.append(text))
    for base in reversed([one for one in kind.__mro__ if one.__module__.startswith("addon")]):
        for name, value in vars(base).items():
            if not name.startswith(("__", "bl_")):
                setattr(made, name, MethodType(value, made) if isinstance(value, FunctionType) else getattr(kind, name))
    vars(made).update(own)
    return made


class Window:
    """Context of operators in a window with this scene; `calls` has what they do to it, `texts` its status bar's."""

    def __init__(self, scene: Any) -> None:
        self.calls: list[str] = []
        self.texts: list[Any] = []
        note = self.calls.append
        manager = SimpleNamespace(
            progress_begin=lambda *_: note("begin"),
            progress_update=lambda *_: None,
            progress_end=lambda: note("end"),
            event_timer_add=lambda *_args, **_kwargs: "timer",
            event_timer_remove=lambda timer: note(f"no {timer}"),
            modal_handler_add=lambda _operator: note("modal"),
        )
        self.context = SimpleNamespace(
            scene=scene,
            window=SimpleNamespace(cursor_modal_set=note, cursor_modal_restore=lambda: note("restored")),
            screen=bpy.context.window and bpy.context.window.screen,
            window_manager=manager,
            workspace=SimpleNamespace(status_text_set=self.texts.append),
            evaluated_depsgraph_get=bpy.context.evaluated_depsgraph_get,
        )


def until_it_ends(kind: Any, itself: Any, context: Any) -> set[str]:
    """The last result of an operator; until then timers of others go on to them."""
    for _ in range(100_000):
        result: set[str] = kind.modal(itself, context, SimpleNamespace(type="TIMER"))
        if result != {"PASS_THROUGH"}:
            return result
        time.sleep(0.001)
    raise AssertionError("it never ends")
