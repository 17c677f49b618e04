# SPDX-License-Identifier: GPL-3.0-or-later
"""Costs and omissions of each scene's last picture, for the panels. Never saved."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ...core.base.arrays import F64
from ...core.choose.choice import NOT_COMPARED
from ..state import Slot


@dataclass(frozen=True)
class Report:
    """Report on a picture.

    label: of the structure. statistics: of structure and render, with the native module's names. left_out: features
    that were not computed because the scene lacks them. warnings: unsupported features. reasons: for an automatic
    choice of the structure, the first three its answer. answers: text on their check. tree: the number of the
    structure, if it was kept. instances: whether the scene's instances were kept, and why; "" without instances. made:
    lines on hair and points, which were made into triangles.
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
    instances: str = ""
    made: tuple[str, ...] = ()


REPORT: Slot[Report] = Slot()


@dataclass(frozen=True, eq=False)
class Recorded:
    """The rays recorded of a picture, as `RenderJob.recorded` returns them, and the origin of their frame."""

    kinds: dict[str, dict[str, Any]]
    origin: F64


RECORD: Slot[int] = Slot()
"""Largest number of rays of each kind to record of the next pictures of a scene."""

RECORDED: Slot[Recorded] = Slot()
"""The rays of the last view layer of a scene's last picture, where they were to be recorded."""

KEPT: Slot[bool] = Slot()
"""Whether the last picture of a scene, also one of a 3D view, kept its instances."""

keep, last = REPORT.keep, REPORT.of
"""Replace, or return, the report of a scene's last picture in this session; None without one."""
