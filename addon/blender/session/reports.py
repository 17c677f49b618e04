# SPDX-License-Identifier: GPL-3.0-or-later
"""Costs and omissions of each scene's last picture, for the panels. Never saved."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ...core.choose.choice import NOT_COMPARED
from ..state import Slot


@dataclass(frozen=True)
class Report:
    """Report on a picture.

    label: of the structure. statistics: of structure and render, with the native module's names. left_out: features
    that were not computed because the scene lacks them. warnings: unsupported features. reasons: for an automatic
    choice of the structure. answers: text on their check. tree: the number of the structure, if it was kept.
    instances: whether the scene's instances were kept, and why; "" without instances. made: lines on hair and points,
    which were made into triangles.
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

KEPT: Slot[bool] = Slot()
"""Whether the last picture of a scene, also one of a 3D view, kept its instances."""

keep, last = REPORT.keep, REPORT.of
"""Replace, or return, the report of a scene's last picture in this session; None without one."""
