# SPDX-License-Identifier: GPL-3.0-or-later
"""González López and Gisbert Cantó, as published: beams that begin with the whole image, against single rays, box
hierarchies and beams of 64 rays; what one more ray costs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ...core.base.arrays import F32
from ...core.scene.rays import TILE, RaySet, pinhole
from ...core.scene.workload import Workload
from . import beams, paper_scenes
from .claims import Chart, Claim, Lab, Outcome, Timing, slope, verdict

POLYGON = "octree-beam:traversal=polygon"
NET, SAMET, TILES, BOX = beams.NET, beams.SAMET, beams.BEAM, beams.BOX

SCENES = ("sponza-dabrovic", "conference")
"""The real scenes, where their files are present."""

SIDE = 4
"""Samples per pixel along each axis: 16 in all."""

QUARTER = 0.25
"""Largest cost of a further ray, relative to Samet-Net."""

THRESHOLDS = (1, 4, 8, 16, 32, 64, 256)
"""Values of `beam_min`, the paper's threshold, for which it gives no number."""

LARGEST = paper_scenes.RESOLUTIONS[-1]


def samples(workload: Workload, size: tuple[int, int], side: int) -> RaySet:
    """Rays through `side` × `side` points of each pixel, in tiles of 8×8 points; the window does not depend on them."""
    width, height = (side * n for n in size)
    directions: F32 = np.empty((height // TILE, width // TILE, TILE, TILE, 3), np.float32)
    # Make all rays in the order of scanlines, and move each row of tiles to its place.
    rows = pinhole(workload.view, (width, height), paper_scenes.WINDOW).reshape(height // TILE, TILE, -1, TILE, 3)
    for place, row in zip(directions, rows, strict=True):
        place[:] = row.transpose(1, 0, 2, 3)
    directions = directions.reshape(-1, 3)
    origins: F32 = np.ascontiguousarray(np.broadcast_to(workload.view.eye.astype(np.float32), directions.shape))
    endless = np.full(len(directions), np.inf, np.float32)
    name = f"{size[0]}x{size[1]}, {side * side} samples"
    return RaySet(name, origins, directions, endless, order="tile8")


def parallel_samples(workload: Workload, size: tuple[int, int], side: int) -> RaySet:
    """The same points of the window at the distance of the view's target, seen by an orthographic camera from the plane
    of the eye.
    """
    rays = samples(workload, size, side)
    view = workload.view
    forward = view.axes()[2].astype(np.float32)
    distance = np.float32(np.linalg.norm(view.target - view.eye))
    # Divide by the depth: what is left across the axis is the place in a window at distance 1.
    offsets = rays.directions / (rays.directions @ forward)[:, None] - forward
    origins = view.eye.astype(np.float32) + distance * offsets
    directions: F32 = np.ascontiguousarray(np.broadcast_to(forward, origins.shape))
    return replace(rays, name=f"{rays.name}, parallel", origins=origins, directions=directions)


def workloads(lab: Lab) -> Iterator[Workload]:
    """The two scenes of the paper, and the real ones that are present."""
    yield paper_scenes.scattered()
    yield paper_scenes.concentrated()
    for name in SCENES:
        workload = lab.shared(name)
        if workload is not None:
            yield workload


def steps(timing: Timing) -> float:
    """Nodes visited per ray, leaves included."""
    return timing.counters["steps"] + timing.counters["leaves"] + timing.counters["leaves_empty"]


def further(few: Timing, many: Timing) -> tuple[float, float]:
    """Node steps and nanoseconds of each ray that the second picture has in addition."""
    rays = many.rays - few.rays
    nodes = (many.rays * steps(many) - few.rays * steps(few)) / rays
    return nodes, (many.seconds - few.seconds) / rays * 1e9


def further_ray(lab: Lab, camera: Callable[[Workload, tuple[int, int], int], RaySet]) -> Iterator[Outcome]:
    """Cost of a further ray of a camera from 1 to 16 samples per pixel at the largest picture."""
    specs = (POLYGON, TILES, NET)
    for workload in (paper_scenes.scattered(), paper_scenes.concentrated()):
        one = lab.seconds(workload, specs, camera(workload, LARGEST, 1))
        all_of_them = lab.seconds(workload, specs, camera(workload, LARGEST, SIDE))
        cost = {spec: further(one[spec], all_of_them[spec]) for spec in specs}
        nodes, time = (cost[POLYGON][i] / cost[NET][i] for i in (0, 1))
        text = "; ".join(f"{spec} {own[0]:.4f} nodes, {own[1]:.1f} ns" for spec, own in cost.items())
        yield Outcome(
            "faithful",
            verdict(holds=nodes <= QUARTER),
            f"{workload.name}, 1280×1024, from 1 to 16 samples a pixel, each further ray: {text}. Polygons against "
            f"octree-net: {nodes:.4f} of the nodes (limit: {QUARTER}), {time:.2f} of the time "
            f"({verdict(holds=time <= QUARTER)})",
            counted(all_of_them[POLYGON]),
            lab.error(workload, specs),
            {"nodes": nodes, "time": time, "polygon_ns": cost[POLYGON][1], "net_ns": cost[NET][1]},
        )


def counted(timing: Timing) -> str:
    """The events of beams, as text."""
    totals = {name: timing.counters[name] * timing.rays for name in timing.counters if name.startswith("beam")}
    events = ", ".join(f"{total:,.0f} {name.removeprefix('beam_')}" for name, total in totals.items())
    return f"{timing.rays:,} rays: {events}; {timing.counters['tests']:.2f} tests per ray"


def resolutions(lab: Lab) -> Iterator[Outcome]:
    """Time against the number of rays, for pictures of all sizes."""
    specs = [POLYGON, TILES, NET, SAMET]
    if not lab.lacks(BOX):
        specs.append(BOX)
    for workload in workloads(lab):
        times = beams.sweep(lab, workload, specs)
        slopes = {spec: slope((t.rays, t.seconds) for t in own) * 1e9 for spec, own in times.items()}
        nodes = {spec: further(own[0], own[-1])[0] for spec, own in times.items()}
        text = ", ".join(f"{spec} {slopes[spec]:.0f} ns and {nodes[spec]:.3f} nodes" for spec in specs)
        yield Outcome(
            "faithful",
            verdict(holds=slopes[POLYGON] <= beams.FLAT * slopes[NET]),
            f"{workload.name}: each further ray from 320×200 to 1280×1024: {text}",
            counted(times[POLYGON][-1]),
            lab.error(workload, specs),
            {f"slope {spec}": own for spec, own in slopes.items()},
            (chart(workload, times),),
        )


def chart(workload: Workload, times: Mapping[str, Sequence[Timing]]) -> Chart:
    """Time against rays, as in the paper's figures."""
    return Chart(
        f"{workload.name}: camera rays as polygons, as tiles, one by one",
        "million rays",
        "milliseconds",
        {spec: [(t.rays / 1e6, t.seconds * 1e3) for t in own] for spec, own in times.items()},
    )


def thresholds(lab: Lab) -> Iterator[Outcome]:
    """Time and nodes per ray against the number of rays below which they go on singly."""
    for workload in workloads(lab):
        specs = [f"{POLYGON},beam_min={least}" for least in THRESHOLDS]
        rays = lab.rays(workload, "{}x{}".format(*LARGEST), partial(paper_scenes.camera_rays, workload, LARGEST))
        times = lab.seconds(workload, specs, rays)
        own = dict(zip(THRESHOLDS, (times[spec] for spec in specs), strict=True))
        least = min(own, key=lambda u: own[u].seconds)
        text = ", ".join(f"{u}: {t.nanoseconds:.0f} ns, {steps(t):.3f} nodes" for u, t in own.items())
        yield Outcome(
            "best",
            verdict(holds=own[least].seconds < max(own[1].seconds, own[THRESHOLDS[-1]].seconds)),
            f"{workload.name}: per ray at 1280×1024: {text}; quickest with {least}",
            counted(own[least]),
            lab.error(workload, specs),
            {f"U={u}": t.nanoseconds for u, t in own.items()},
        )


CLAIMS = (
    Claim(
        "beams-further-ray",
        beams.PAPER,
        "Supersamples fill the same beams: the number of rays hardly influences the time.",
        partial(further_ray, camera=samples),
    ),
    Claim(
        "beams-parallel",
        beams.PAPER,
        "Beams of an orthographic camera are traced alike (ours; the paper has pinholes only).",
        partial(further_ray, camera=parallel_samples),
    ),
    Claim(
        "beams-resolution",
        beams.PAPER,
        "The slope of the time of beams that begin with the whole image is much smaller than that of single rays.",
        resolutions,
        SCENES,
    ),
    Claim(
        "beams-threshold",
        beams.PAPER,
        "Rays go on singly where fewer than a threshold are left; the paper gives no number.",
        thresholds,
        SCENES,
    ),
)
