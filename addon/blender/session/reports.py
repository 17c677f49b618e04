# SPDX-License-Identifier: GPL-3.0-or-later
"""What the last picture of each scene cost and left out, for the panels. Never saved."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ...core.choose.choice import NOT_COMPARED


@dataclass(frozen=True)
class Report:
    """statistics: the structure's and the render's, as the native module names them. reasons: why this structure,
    where it was not the user who chose it. answers: what is known of their errors. tree: the number of the structure,
    if it was kept.
    """

    label: str
    triangles: int
    extract_seconds: float
    statistics: dict[str, Any]
    left_out: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)
    answers: str = NOT_COMPARED
    tree: int | None = None


_last: dict[int, Report] = {}


def keep(scene: Any, report: Report) -> None:
    """Remember the report of a scene, in place of its last one."""
    _last[scene.original.session_uid] = report


def last(scene: Any) -> Report | None:
    """The report of a scene's last picture in this session."""
    return _last.get(scene.original.session_uid)


def clear() -> None:
    """Forget all."""
    _last.clear()
