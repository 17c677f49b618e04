# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether steps and tests are those of the walk that is timed: rays that go together may be counted one by one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..scene.rays import RaySet
from ..structures import specs

if TYPE_CHECKING:
    from ..base.interface import Structure
    from .rows import RayColumns

ONE_BY_ONE = "counted one by one, though they may go together"
"""What is said of rays whose counters are not those of the timed walk."""


SHADOWS_TOGETHER = ("auto", "tile8", "tile16", "p16")
"""Traversals that walk shadow rays in tiles or packets, but not where these are counted."""


def is_of_the_timed_walk(values: Mapping[str, Any], *, any_hit: bool) -> bool:
    """Whether rays of a configuration are counted as they are traced, as its parameter `traversal` says.

    values: all of its parameters (`specs.values`). any_hit: of rays that ask whether anything is hit.
    """
    walk = values.get("traversal")
    if any_hit:
        # With a cache they go singly in any case, and as a beam they are counted so.
        return values.get("shadow") in ("cache", "beam") or walk not in SHADOWS_TOGETHER
    # Of a tree that rays build, tiles are counted as single rays.
    return walk != "auto" and not (walk == "tile8" and str(values.get("lazy")) == "1")


def counters(structure: Structure, some: RaySet, threads: int) -> dict[str, NDArray[np.uint32]]:
    """Counters by name, (n,) each, of the any-hit or nearest-hit traversal of these rays. threads: 0 = one per core."""
    options = some.options(threads)
    if some.any_hit:
        return structure.occluded(some.origins, some.directions, counters=True, **options)[1]
    found = structure.closest(some.origins, some.directions, counters=True, **options).counters
    assert found is not None, "they were requested"
    return found


def mark(told: Mapping[str, RayColumns], sets: Iterable[RaySet], values: Mapping[str, Any]) -> None:
    """Add to what a row tells of these sets whether its counters are those of the timed walk."""
    for some in sets:
        told[some.name]["counts_timed_walk"] = is_of_the_timed_walk(values, any_hit=some.any_hit)


def tells(row: Mapping[str, Any], name: str) -> bool:
    """Whether a row's counters of a set are those of the timed walk; rows of earlier versions do not say."""
    return bool(row["rays"][name].get("counts_timed_walk", True))


def remark(chosen: Mapping[str, str], structures: Sequence[Mapping[str, Any]]) -> str:
    """What stands behind counters of configurations where some are not those of the walk that is timed, or nothing.

    chosen: what each is called, and the configuration. structures: the native registry.
    """
    silent = [
        name for name, spec in chosen.items() if not is_of_the_timed_walk(specs.values(spec, structures), any_hit=False)
    ]
    return f" (rays of {', '.join(silent)} are {ONE_BY_ONE})" if silent else ""
