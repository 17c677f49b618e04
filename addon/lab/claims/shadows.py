# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadow beams, which the octree paper announces, of point lights and suns; the shadow cache of OORT (Wilt 1994)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...core.base.arrays import F32
from ...core.scene import rays
from ...core.scene.workload import Workload
from ...core.structures.specs import joined
from . import paper_scenes
from .beams import NET, PAPER, octree
from .claims import UNTESTED, Claim, Lab, Outcome
from .polygons import NET as LINKS
from .polygons import POLYGON, counted, steps

if TYPE_CHECKING:
    from ...core.base.interface import Tracer

SHADOW_SIZE = (512, 512)
"""Width and height, in pixels, of the view whose visible points are tested for shadow."""

SCENES = ("sponza-dabrovic", "conference", "stanford-bunny", "utah-teapot-plane")


def scenes(lab: Lab) -> Iterator[Workload]:
    """The paper's two scenes, and those shared scenes that exist."""
    yield paper_scenes.scattered()
    yield paper_scenes.concentrated()
    yield from (workload for name in SCENES if (workload := lab.shared(name)) is not None)


def _shadow_rays(workload: Workload, tracer: Tracer) -> rays.RaySet:
    return rays.make(workload, tracer, size=SHADOW_SIZE, seed=1, names=("shadow",))[0]


def _sun_rays(workload: Workload, tracer: Tracer) -> rays.RaySet:
    """Rays from the same points to a sun without size, high and to the right of the view."""
    some = _shadow_rays(workload, tracer)
    right, up, forward = workload.view.axes()
    towards = (up + 0.4 * right - 0.3 * forward).astype(np.float32)
    directions: F32 = np.ascontiguousarray(np.broadcast_to(towards, some.directions.shape))
    endless = np.full(len(some), np.inf, np.float32)
    return replace(some, name="sun", directions=directions, t_max=endless)


LIGHTS = {"point light": _shadow_rays, "sun": _sun_rays}
"""Shadow rays by their light."""


def polygons(lab: Lab) -> Iterator[Outcome]:
    """Shadow rays as polygons from their light, against single rays through the same octree, scene by scene."""
    beams = f"{POLYGON},shadow=beam"
    for workload in scenes(lab):
        tracer = lab.build(workload, "kd")
        for light, make in LIGHTS.items():
            some = lab.rays(workload, light, partial(make, workload, tracer))
            if not len(some):
                yield Outcome("best", UNTESTED, f"{workload.name}: no ray hits the scene, so there are no shadow rays")
                break
            times = lab.seconds(workload, [LINKS, beams], some)
            single, quick = times[LINKS], times[beams]
            nodes, share = steps(quick) / steps(single), quick.share(single)
            yield Outcome(
                "faithful",
                share.below(),
                f"{workload.name}, {light}: polygons take {nodes:.3f} of the nodes and {share.value:.2f} times the "
                f"time of single rays by links ({single.nanoseconds:.0f} to {quick.nanoseconds:.0f} ns a ray)",
                counted(quick),
                lab.error(workload, [LINKS, beams]),
                {"nodes": nodes, "ratio": share.value, "singles": quick.counters["beam_singles"]},
            )


def shadows(lab: Lab, way: str) -> Iterator[Outcome]:
    """The time that one shadow method saves, scene by scene. way: value of `shadow=`."""
    for workload in scenes(lab):
        tracer = lab.build(workload, "kd")
        make = partial(_shadow_rays, workload, tracer)
        some = lab.rays(workload, "shadow", make)
        if not len(some):
            yield Outcome("best", UNTESTED, f"{workload.name}: no ray hits the scene, so there are no shadow rays")
            continue
        # Beams of 64 shadow rays are ours; the cache of one triangle is published.
        specs = {"best": octree(NET, "best")}
        if way == "cache":
            specs = {"faithful": octree(NET, "faithful"), "best": "kd"}
        # Time the structure without and with the shadow method, on the same rays.
        for configuration, spec in specs.items():
            asked = joined(spec, f"shadow={way}")
            times = lab.seconds(workload, [spec, asked], some)
            plain, quick = times[spec], times[asked]
            spared = quick.counters["spared"]
            nodes = [t.counters["steps"] + t.counters["leaves"] + t.counters["leaves_empty"] for t in (plain, quick)]
            share = quick.share(plain)
            yield Outcome(
                configuration,
                share.below(),
                f"{workload.name}, {spec}: {share.value:.2f} times the time ({plain.nanoseconds:.0f} to "
                f"{quick.nanoseconds:.0f} ns a ray); {spared * 100:.0f} % of {quick.rays:,} rays need no traversal",
                f"nodes per ray {nodes[0]:.2f} to {nodes[1]:.2f}, tests {plain.counters['tests']:.2f} to "
                f"{quick.counters['tests']:.2f}",
                lab.error(workload, [spec, asked]),
                {"ratio": share.value, "spared": spared},
            )


CLAIMS = (
    Claim(
        "shadow-beams",
        PAPER,
        "The process extends to shadow rays, which have the light as their common origin (announced, not measured).",
        lambda lab: shadows(lab, "beam"),
        SCENES,
    ),
    Claim(
        "shadow-polygons",
        PAPER,
        "Shadow rays from point lights, and from suns, go as the same polygons (announced, not measured).",
        polygons,
        SCENES,
    ),
    Claim(
        "shadow-cache",
        "Wilt, Object-Oriented Ray Tracing in C++ (OORT)",
        "Testing the last object that blocked a light first saves shadow rays their traversal.",
        lambda lab: shadows(lab, "cache"),
        SCENES,
    ),
)
