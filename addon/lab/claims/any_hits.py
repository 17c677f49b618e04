# SPDX-License-Identifier: GPL-3.0-or-later
"""The order of children for rays that need any hit: by expected cost (RTSAH), by surface (SATO), by distance.

Both sources order the two children of a node for single rays. Here the eight children of a node are ordered for
streams, which is what such rays go in; so every outcome is of our own configuration.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...core.scene import rays
from ...core.scene.workload import Workload
from .claims import UNTESTED, Claim, Lab, Outcome, Timing

if TYPE_CHECKING:
    from ...core.base.interface import Tracer

SIZE = (512, 512)
"""Width and height, in pixels, of the view from whose visible points rays go in all directions."""

SCENES = ("sponza-dabrovic", "conference", "country-kitchen", "stanford-dragon", "stanford-bunny")

ORDERS = {name: f"bvh-sah:traversal=stream,any_order={name}" for name in ("near", "cost", "area")}
"""Configurations by the order of the children."""

LENGTH = 0.1
"""Length of the shorter rays as a share of the scene's diagonal, as ambient occlusion sends them (chosen)."""


LENGTHS = {"any hits": None, "short any hits": LENGTH}
"""Sets of rays by the share of the diagonal at which they end; None: nowhere."""


def _all_ways(workload: Workload, tracer: Tracer, name: str) -> rays.RaySet:
    """Any-hit rays from the visible points in cosine-weighted directions, in no order. name: a key of LENGTHS."""
    some = rays.make(workload, tracer, size=SIZE, seed=1, names=("shuffled",))[0]
    share = LENGTHS[name]
    t_max = some.t_max if share is None else np.full_like(some.t_max, share * workload.diagonal())
    return replace(some, name=name, any_hit=True, t_max=t_max)


def measured(lab: Lab) -> Iterator[tuple[Workload, str, Mapping[str, Timing]]]:
    """The times of all orders, scene by scene and set by set."""
    for workload in (found for name in SCENES if (found := lab.shared(name)) is not None):
        tracer = lab.build(workload, "kd")
        for name in LENGTHS:
            some = lab.rays(workload, name, partial(_all_ways, workload, tracer, name))
            if len(some):
                times = lab.seconds(workload, list(ORDERS.values()), some)
                yield workload, name, {order: times[spec] for order, spec in ORDERS.items()}


def against_nearest(lab: Lab, order: str) -> Iterator[Outcome]:
    """One order against that of nearest hits, and against the others."""
    missing = True
    for workload, name, found in measured(lab):
        missing = False
        shares = {other: found[order].share(found[other]) for other in found if other != order}
        steps = {other: found[other].counters["steps"] for other in found}
        tests = {other: found[other].counters["tests"] for other in found}
        others = ", ".join(f"{share.value:.2f} of {other}" for other, share in shares.items())
        work = (f"{other} {nodes:.1f} nodes and {tests[other]:.1f} tests" for other, nodes in steps.items())
        yield Outcome(
            "best",
            shares["near"].below(),
            f"{workload.name}, {name}: {order} takes {others} ({found[order].nanoseconds:.0f} ns a ray)",
            f"per ray: {'; '.join(work)}",
            lab.error(workload, list(ORDERS.values())),
            {other: share.value for other, share in shares.items()},
        )
    if missing:
        yield Outcome("best", UNTESTED, "no shared scene is there")


CLAIMS = (
    Claim(
        "any-hits-cost",
        "Ize and Hansen 2011, RTSAH traversal order for occlusion rays",
        "Rays that need any hit take less time where children are visited by expected cost, not the nearest first.",
        lambda lab: against_nearest(lab, "cost"),
        SCENES,
    ),
    Claim(
        "any-hits-area",
        "Nah and Manocha 2014, SATO: Surface area traversal order for shadow ray tracing",
        "Rays that need any hit take less time where the child with the largest surface is visited first.",
        lambda lab: against_nearest(lab, "area"),
        SCENES,
    ),
)
