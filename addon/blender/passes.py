# SPDX-License-Identifier: GPL-3.0-or-later
"""The passes that the engine can fill, and how Blender asks for them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Pass:
    """A render pass: its name (the same here, in Blender and in the native renderer) and its channels.

    kind: VALUE, VECTOR or COLOR. switch: the property of the view layer, or of its `halfspace` group for passes that
    only we have, that asks for it; empty for the one that is always there.
    """

    name: str
    channels: str
    kind: str
    switch: str = ""
    own: bool = False

    def wanted(self, view_layer: Any) -> bool:
        """Whether the user asks for this pass in this view layer."""
        return not self.switch or getattr(view_layer.halfspace if self.own else view_layer, self.switch)


PASSES = (
    Pass("Combined", "RGBA", "COLOR"),
    Pass("Depth", "Z", "VALUE", "use_pass_z"),
    Pass("Normal", "XYZ", "VECTOR", "use_pass_normal"),
    Pass("Position", "XYZ", "VECTOR", "use_pass_position"),
    Pass("Traversal Steps", "X", "VALUE", "use_pass_steps", own=True),
    Pass("Triangle Tests", "X", "VALUE", "use_pass_tests", own=True),
)


def wanted_passes(view_layer: Any) -> list[Pass]:
    """The passes of a view layer, Combined first."""
    return [render_pass for render_pass in PASSES if render_pass.wanted(view_layer)]


def register_passes(engine: Any, scene: Any, view_layer: Any) -> None:
    """Tell Blender which passes come, for the compositor and for files."""
    for render_pass in wanted_passes(view_layer):
        engine.register_pass(
            scene,
            view_layer,
            render_pass.name,
            len(render_pass.channels),
            render_pass.channels,
            render_pass.kind,
        )
