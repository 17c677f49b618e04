# SPDX-License-Identifier: GPL-3.0-or-later
"""Events that the processor counts while rays are traced: misses of the last cache, instructions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..scene.rays import RaySet
from . import timing, yardstick

if TYPE_CHECKING:
    from ..base.interface import Native
    from .timing import Candidate

NAMES = ("cache_misses", "instructions")
"""The events of a row, by their names in `count_events`."""


def refusal(native: Native) -> str | None:
    """Why the system does not count these events, in one sentence; None where it counts them."""
    try:
        native.count_events(lambda: None, NAMES)
    except OSError as error:
        return str(error)
    return None


def per_ray(native: Native, candidate: Candidate, some: RaySet, threads: int) -> dict[str, float]:
    """Mean events per ray of one pass as it is timed, on all its threads; nothing where there are no rays, where the
    system does not count them, and for foreign tracers, whose threads run before.
    """
    if not len(some) or yardstick.is_foreign(candidate.spec):
        return {}
    timing.warmed_pass(candidate, some, threads)
    try:
        found = native.count_events(lambda: timing.one_pass(candidate, some, threads), NAMES)
    except OSError:
        return {}
    return {name: count / len(some) for name, count in found.items()}
