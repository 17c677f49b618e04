# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's result of a picture: the pixels of the passes of a view layer, for one view or for several."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.base import cryptomatte
from ..read import passes

if TYPE_CHECKING:
    from ...core.base.arrays import F32
    from ...core.scene.scene import Scene


class Result:
    """An open result, which ends once. views: the names of its views; one without a name unless there are several."""

    def __init__(self, engine: Any, depsgraph: Any, size: tuple[int, int]) -> None:
        """Open the result of a depsgraph's view layer."""
        self._engine = engine
        self._layer = depsgraph.view_layer.name
        self._names = passes.native_names(depsgraph.view_layer_eval)
        self._result = engine.begin_result(0, 0, *size, layer=self._layer)
        self.views = [view.name for view in self._result.views] or [""]

    def fill(self, buffers: Mapping[str, F32], view: int) -> None:
        """Copy a picture, flat arrays by the native names of the passes, into the view of this number."""
        for render_pass in self._result.layers[0].passes:
            name = self._names.get(render_pass.name, "")
            buffer = buffers.get(name)
            if buffer is None or render_pass.view_id != view:
                continue
            if render_pass.channels == 1 and name.startswith("Output"):
                buffer = np.ascontiguousarray(buffer[::4])
            if len(render_pass.rect) * render_pass.channels != len(buffer):
                raise RuntimeError(f"Pass {render_pass.name}: Blender expects another size of picture")
            render_pass.rect.foreach_set(buffer)

    def show(self) -> None:
        """Update the picture that the user sees."""
        self._engine.update_result(self._result)

    def describe(self, scene: Scene) -> None:
        """Add the metadata of the mattes among the passes to the whole picture, for the compositor and for files."""
        for kind, names in scene.mattes.names().items() if scene.mattes is not None else ():
            if any(name.startswith(kind) for name in self._names):
                for key, value in cryptomatte.metadata(f"{self._layer}.{kind}", names).items():
                    self._engine.get_result().stamp_data_add_field(key, value)

    def end(self, *, cancel: bool = False) -> None:
        """Close the result; if cancelled, without keeping its pixels."""
        self._engine.end_result(self._result, cancel=cancel)


def copy(job: Any, buffers: dict[str, F32], origin: np.ndarray[Any, Any], *, keep: bool = False) -> None:
    """Copy the current picture of a job into flat buffers, one for each pass.

    keep: whether Combined keeps its values where the job has no samples yet.
    """
    for name, buffer in buffers.items():
        job.copy_into(name, buffer, keep=keep and name == "Combined")
        if name == "Position":
            to_world(buffer, origin)


def to_world(positions: np.ndarray[Any, Any], origin: np.ndarray[Any, Any]) -> None:
    """Move flat (n * 3,) positions from the scene frame to the world, in place; background pixels (0, 0, 0) stay."""
    points = positions.reshape(-1, 3)
    points[points.any(axis=1)] += origin.astype(np.float32)
