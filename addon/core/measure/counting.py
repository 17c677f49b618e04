# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether step and test counters belong to the timed traversal: the native module names the kernel of each batch."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..scene.rays import RaySet
from ..structures import specs
from ..structures.ways import nodes_of

if TYPE_CHECKING:
    from ..base.interface import Native, Structure
    from .rows import RayColumns, Way
    from .two_level import AnyLayout

ONE_BY_ONE = "counted one by one, though they may be traced together"
"""Remark on rays whose counters are not those of the timed traversal."""


def ways(structure: AnyLayout, sets: Iterable[RaySet]) -> dict[str, Way]:
    """Per ray set, the nodes and rays of the kernel that answers it."""
    found = {some.name: structure.routes[kind_of(some)] for some in sets}
    return {name: {"nodes": route["nodes"], "rays": route["rays"]} for name, route in found.items()}


def kind_of(some: RaySet) -> str:
    """The kind of batch, as `Structure.routes` names it, that the rays of a set are."""
    return "shadow" if some.any_hit else "tiles" if some.order == "tile8" else "closest"


def counters(structure: AnyLayout, some: RaySet, threads: int) -> dict[str, NDArray[np.uint32]]:
    """Counters by name, (n,) each, of the any-hit or nearest-hit traversal of these rays. threads: 0 = one per core."""
    options = some.options(threads)
    if some.any_hit:
        return structure.occluded(some.origins, some.directions, counters=True, **options)[1]
    found = structure.closest(some.origins, some.directions, counters=True, **options).counters
    assert found is not None, "they were requested"
    return found


def alone(structure: Structure, some: RaySet) -> dict[str, NDArray[np.uint32]]:
    """Counters by name, (n,) each, of these rays traced one by one, as paths show them.

    Brute force has one way to trace rays, and no recordings.
    """
    if nodes_of(structure.spec) == "none":
        return counters(structure, replace(some, order="none"), 0)
    return structure.record(some.origins, some.directions, None, some.t_max, any_hit=some.any_hit).counters


def mark(columns: Mapping[str, RayColumns], sets: Iterable[RaySet], structure: AnyLayout) -> None:
    """Set `counts_timed_walk` in a row's columns of each of these sets."""
    for some in sets:
        columns[some.name]["counts_timed_walk"] = bool(structure.routes[kind_of(some)]["counted"])


def counts_timed_traversal(row: Mapping[str, Any], name: str) -> bool:
    """Whether a row's counters of a ray set are those of the timed traversal; True for Embree, which counts nothing."""
    return bool(row["rays"][name].get("counts_timed_walk", True))


def remark(chosen: Mapping[str, str], native: Native) -> str:
    """A remark on those configurations whose counters are not of the timed traversal; "" if there are none.

    chosen: label to configuration. Raises specs.SpecError.
    """
    found = [name for name, spec in chosen.items() if not _counts_nearest(specs.tiny(native, spec))]
    return f" (rays of {', '.join(found)} are {ONE_BY_ONE})" if found else ""


def _counts_nearest(structure: Structure) -> bool:
    """Whether the kernels of nearest hits count themselves."""
    return all(structure.routes[kind]["counted"] for kind in ("closest", "tiles"))
