# SPDX-License-Identifier: GPL-3.0-or-later
"""Results of the stages of a picture: the scene that was read, and the structure that was built."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ...core.choose import choice

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ...core.scene.instances import Layout
    from ...core.scene.scene import Camera, Scene
    from ...core.session.session import Session
    from .motion import Motion


@dataclass(frozen=True, eq=False)
class Read:
    """A scene that was read. views: the camera of each view by name. moment: its `trees.moment`. seconds: the time to
    read it. made: see `extract.Found`. motion: for the vector pass. times: the scene at the times that samples take in
    turn, if it moves.
    """

    scene: Scene
    views: Mapping[str, Camera]
    layout: Layout
    moment: int
    seconds: float
    made: tuple[str, ...] = ()
    motion: Motion | None = None
    times: tuple[Scene, ...] = ()

    @property
    def view(self) -> Camera:
        """The camera of the first view."""
        return next(iter(self.views.values()))


@dataclass(frozen=True, eq=False)
class Built:
    """The session of a picture. reasons: of an automatic choice, as lines. answers: number of compared answers, as
    text.
    """

    session: Session
    spec: str
    label: str
    reasons: list[str] = field(default_factory=list)
    answers: str = choice.NOT_COMPARED
