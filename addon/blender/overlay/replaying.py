# SPDX-License-Identifier: GPL-3.0-or-later
"""The steps of the picked ray through the last structure, made once per ray and tree."""

from __future__ import annotations

from typing import Any

from ...core.inspector import replay as replays
from ...core.inspector.replay import Replay
from ...core.overlay.cells import Path
from ...core.tree.table import TreeError
from ..session import trees
from ..state import Slot
from . import picking

STEPS: Slot[tuple[tuple[int, picking.Ray | None], Replay]] = Slot()
"""The tree's number and the ray, and the steps."""


def step(scene: Any) -> int | None:
    """The step up to which the ray is shown; None if it is shown entirely."""
    settings = scene.halfspace.inspector
    return settings.step if settings.replaying else None


def replay(scene: Any, tree: trees.Tree, path: Path) -> Replay | None:
    """The steps of this path of the picked ray; None if the structure has no tree to read."""
    key, found = (tree.number, picking.last(scene)), STEPS.of(scene)
    if found is not None and found[0] == key:
        return found[1]
    try:
        made = replays.replay(tree.table(), path)
    except TreeError:
        return None
    STEPS.keep(scene, (key, made))
    return made


def known(scene: Any) -> Replay | None:
    """The steps of the picked ray if they were made already, for panels."""
    tree, found = trees.last(scene), STEPS.of(scene)
    if tree is None or found is None or found[0] != (tree.number, picking.last(scene)):
        return None
    return found[1]
