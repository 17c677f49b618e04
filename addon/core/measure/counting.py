# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether step and test counters belong to the timed traversal: rays timed together may be counted one by one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..scene.rays import RaySet
from ..structures import catalogue, specs

if TYPE_CHECKING:
    from ..base.interface import Structure
    from .rows import RayColumns, Way

ONE_BY_ONE = "counted one by one, though they may be traced together"
"""Remark on rays whose counters are not those of the timed traversal."""


SHADOWS_TOGETHER = ("auto", "tile8", "tile16", "p16")
"""Traversals that trace shadow rays in tiles or packets, but count them singly."""


def is_of_the_timed_walk(values: Mapping[str, Any], *, any_hit: bool) -> bool:
    """Whether rays of a configuration are counted by the traversal that is timed, from its parameter `traversal`.

    values: all parameters of the configuration (`specs.values`). any_hit: for any-hit rays instead of nearest hits.
    """
    walk = values.get("traversal")
    if any_hit:
        # With a shadow cache rays are always single; shadow beams are counted as beams.
        return values.get("shadow") in ("cache", "beam") or walk not in SHADOWS_TOGETHER
    # In a lazily built tree, tiles are counted as single rays.
    return walk != "auto" and not (walk == "tile8" and str(values.get("lazy")) == "1")


def ways(structure: Structure, sets: Iterable[RaySet]) -> dict[str, Way]:
    """Per ray set, the nodes and rays of the kernel that answers it."""
    routes = catalogue.routes(structure)
    found = {some.name: routes[kind_of(some)] for some in sets}
    return {name: {"nodes": route["nodes"], "rays": route["rays"]} for name, route in found.items()}


def kind_of(some: RaySet) -> str:
    """The kind of batch, as `Structure.routes` names it, that the rays of a set are."""
    return "shadow" if some.any_hit else "tiles" if some.order == "tile8" else "closest"


def counters(structure: Structure, some: RaySet, threads: int) -> dict[str, NDArray[np.uint32]]:
    """Counters by name, (n,) each, of the any-hit or nearest-hit traversal of these rays. threads: 0 = one per core."""
    options = some.options(threads)
    if some.any_hit:
        return structure.occluded(some.origins, some.directions, counters=True, **options)[1]
    found = structure.closest(some.origins, some.directions, counters=True, **options).counters
    assert found is not None, "they were requested"
    return found


def mark(told: Mapping[str, RayColumns], sets: Iterable[RaySet], values: Mapping[str, Any]) -> None:
    """Set `counts_timed_walk` in a row's entry of each of these sets."""
    for some in sets:
        told[some.name]["counts_timed_walk"] = is_of_the_timed_walk(values, any_hit=some.any_hit)


def tells(row: Mapping[str, Any], name: str) -> bool:
    """Whether a row's counters of a set are those of the timed traversal; rows of earlier versions lack the entry and
    count as such.
    """
    return bool(row["rays"][name].get("counts_timed_walk", True))


def remark(chosen: Mapping[str, str], structures: Sequence[Mapping[str, Any]]) -> str:
    """A remark on those configurations whose counters are not of the timed traversal; "" if there are none.

    chosen: label to configuration. structures: the native registry.
    """
    if catalogue.counts_itself(structures):
        return ""
    silent = [
        name for name, spec in chosen.items() if not is_of_the_timed_walk(specs.values(spec, structures), any_hit=False)
    ]
    return f" (rays of {', '.join(silent)} are {ONE_BY_ONE})" if silent else ""
