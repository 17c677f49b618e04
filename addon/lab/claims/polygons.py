# SPDX-License-Identifier: GPL-3.0-or-later
"""González López and Gisbert Cantó, as published: beams that begin with the whole image, against single rays, box
hierarchies and beams of 64 rays; what one more ray costs.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...core.base.arrays import F32
from ...core.scene.rays import TILE, RaySet, pinhole
from ...core.scene.workload import Workload
from . import beams, paper_scenes
from .claims import HOLDS, Chart, Claim, Lab, Outcome, Share, Timing, slope, verdict

if TYPE_CHECKING:
    from ...core.base.interface import Structure

POLYGON, NET = (beams.octree(name, "faithful") for name in (beams.BEAM, beams.NET))
BEAMS = {name: beams.octree(beams.BEAM, name) for name in beams.CONFIGURATIONS}
"""The paper's beams, and ours of 64 rays."""

NETS, SAMETS = ({name: beams.octree(tree, name) for name in beams.CONFIGURATIONS} for tree in (beams.NET, beams.SAMET))
"""Single rays through the octree by links, and by common ancestors."""

SCENES = ("sponza-dabrovic", "conference")
"""The real scenes, where their files are present."""

SIDE = 4
"""Samples per pixel along each axis: 16 in all."""

QUARTER = 0.25
"""Largest cost of a further ray, relative to Samet-Net."""

THRESHOLDS = (1, 4, 8, 16, 32, 64, 256)
"""Values of `beam_min`, the paper's threshold, for which it gives no number."""

SHARES, WORTH = (2, 4, 8, 16), 0.5
"""Numbers of parts of a picture that are traced by themselves, and the least share of as many times the speed."""

PASSES = 3
"""Passes of each part; the shortest counts."""

LEVELS = (4, 5, 6, 8)
"""Largest numbers of levels of octrees."""

FEW = 0.1
"""Share of the rays without a hit that may leave their beam before its end (chosen)."""

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
    """Cost of a further ray of a camera from 1 to 16 samples per pixel, at the largest picture or, in a quick run, a
    small one.
    """
    size = paper_scenes.RESOLUTIONS[1] if lab.quick else LARGEST
    specs = (*BEAMS.values(), *NETS.values())
    for workload in (paper_scenes.scattered(), paper_scenes.concentrated()):
        one = lab.seconds(workload, specs, camera(workload, size, 1))
        all_of_them = lab.seconds(workload, specs, camera(workload, size, SIDE))
        cost = {spec: further(one[spec], all_of_them[spec]) for spec in specs}
        for configuration, spec in BEAMS.items():
            net = NETS[configuration]
            nodes, time = (cost[spec][i] / cost[net][i] for i in (0, 1))
            text = "; ".join(f"{each} {cost[each][0]:.4f} nodes, {cost[each][1]:.1f} ns" for each in (spec, net))
            yield Outcome(
                configuration,
                verdict(holds=nodes <= QUARTER),
                f"{workload.name}, {size[0]}×{size[1]}, from 1 to 16 samples a pixel, each further ray: {text}. Beams "
                f"against single rays: {nodes:.4f} of the nodes (limit: {QUARTER}), {time:.2f} of the time "
                f"({Share.of(time).below(QUARTER)})",
                counted(all_of_them[spec]),
                lab.error(workload, (spec, net)),
                {"nodes": nodes, "time": time, "beam_ns": cost[spec][1], "net_ns": cost[net][1]},
            )


def counted(timing: Timing) -> str:
    """The events of beams, as text."""
    totals = {name: timing.counters[name] * timing.rays for name in timing.counters if name.startswith("beam")}
    events = ", ".join(f"{total:,.0f} {name.removeprefix('beam_')}" for name, total in totals.items())
    return f"{timing.rays:,} rays: {events}; {timing.counters['tests']:.2f} tests per ray"


def resolutions(lab: Lab) -> Iterator[Outcome]:
    """Time against the number of rays, for pictures of all sizes or, in a quick run, of three."""
    every = paper_scenes.RESOLUTIONS
    sizes = list(dict.fromkeys((every[0], every[len(every) // 2], every[-1]))) if lab.quick else list(every)
    chosen = {name: [spec, NETS[name], SAMETS[name]] for name, spec in BEAMS.items()}
    if not lab.lacks(beams.BOX):
        chosen = {name: [*own, beams.BOXES[name]] for name, own in chosen.items()}
    for workload in workloads(lab):
        times = beams.sweep(lab, workload, list(itertools.chain(*chosen.values())), sizes)
        slopes = {spec: slope((t.rays, t.seconds) for t in own) * 1e9 for spec, own in times.items()}
        nodes = {spec: further(own[0], own[-1])[0] for spec, own in times.items()}
        for configuration, own in chosen.items():
            spec, net, *_ = own
            text = ", ".join(f"{each} {slopes[each]:.0f} ns and {nodes[each]:.3f} nodes" for each in own)
            yield Outcome(
                configuration,
                beams.steepness(times[spec], times[net]).below(beams.FLAT),
                f"{workload.name}: each further ray from 320×200 to 1280×1024: {text}",
                counted(times[spec][-1]),
                lab.error(workload, own),
                {f"slope {each}": slopes[each] for each in own} | {f"nodes {each}": nodes[each] for each in own},
                (chart(workload, {each: times[each] for each in own}),),
            )


def chart(workload: Workload, times: Mapping[str, Sequence[Timing]]) -> Chart:
    """Time against rays, as in the paper's figures."""
    return Chart(
        f"{workload.name}: camera rays in beams and one by one",
        "million rays",
        "milliseconds",
        {spec: [(t.rays / 1e6, t.seconds * 1e3) for t in own] for spec, own in times.items()},
    )


def thresholds(lab: Lab) -> Iterator[Outcome]:
    """Time and nodes per ray against the number of rays below which they go on singly."""
    for workload in workloads(lab):
        specs = [POLYGON.replace(f"beam_min={beams.THRESHOLD}", f"beam_min={least}") for least in THRESHOLDS]
        rays = lab.rays(workload, "{}x{}".format(*LARGEST), partial(paper_scenes.camera_rays, workload, LARGEST))
        times = lab.seconds(workload, specs, rays)
        own = dict(zip(THRESHOLDS, (times[spec] for spec in specs), strict=True))
        least = min(own, key=lambda u: own[u].seconds)
        text = ", ".join(f"{u}: {t.nanoseconds:.0f} ns, {steps(t):.3f} nodes" for u, t in own.items())
        yield Outcome(
            "best",
            verdict(holds=HOLDS in {own[least].share(own[one]).below() for one in (THRESHOLDS[0], THRESHOLDS[-1])}),
            f"{workload.name}: per ray at 1280×1024: {text}; quickest with {least}",
            counted(own[least]),
            lab.error(workload, specs),
            {f"U={u}": t.nanoseconds for u, t in own.items()},
        )


def independent(lab: Lab) -> Iterator[Outcome]:
    """Parts of a picture traced by themselves: their answers, and the longest of their times."""
    for workload in workloads(lab):
        rays = paper_scenes.camera_rays(workload, LARGEST)
        lab.check(workload, POLYGON, rays)
        tree = lab.build(workload, POLYGON)
        whole, all_of_them = traced(tree, rays)
        ends = {count: np.linspace(0, len(rays) // TILE**2, count + 1).astype(int) * TILE**2 for count in SHARES}
        longest, equal = {}, True
        for count, own in ends.items():
            parts = [traced(tree, rays.take(slice(a, b))) for a, b in itertools.pairwise(own)]
            longest[count] = max(seconds for seconds, _ in parts) / whole
            equal &= np.array_equal(np.concatenate([t for _, t in parts]), all_of_them)
        clock = {threads: wall(tree, rays, threads) for threads in (1, 2)}
        yield Outcome(
            "faithful",
            verdict(*(Share.of(longest[n]).below(1 / (WORTH * n)) for n in SHARES), holds=bool(equal)),
            f"{workload.name}, 1280×1024 in parts: the longest takes this share of the whole: "
            + ", ".join(f"{count} parts {share:.3f}" for count, share in longest.items())
            + f" (limit: 1 / {WORTH:g} of the number of parts); two threads {clock[1] / clock[2]:.2f} times as fast as "
            "one by the clock on the wall",
            f"answers of the parts and of the whole are {'equal' if equal else 'different'} bit for bit; each part "
            "begins beams of its own",
            lab.error(workload, [POLYGON]),
            {f"{count} parts": share for count, share in longest.items()} | {"two threads": clock[1] / clock[2]},
            (
                Chart(
                    f"{workload.name}: parts traced by themselves",
                    "parts",
                    "times as fast",
                    {POLYGON: [(count, 1 / share) for count, share in longest.items()]},
                ),
            ),
        )


def traced(tree: Structure, rays: RaySet) -> tuple[float, F32]:
    """Least processor seconds of some rays on one thread, and their distances."""
    least = np.inf
    for _ in range(PASSES):
        begun = time.process_time()
        found = tree.closest(rays.origins, rays.directions, **rays.options(1))
        least = min(least, time.process_time() - begun)
    return least, found.t


def wall(tree: Structure, rays: RaySet, threads: int) -> float:
    """Least seconds of some rays by the clock on the wall."""
    least = np.inf
    for _ in range(PASSES):
        begun = time.perf_counter()
        tree.closest(rays.origins, rays.directions, **rays.options(threads))
        least = min(least, time.perf_counter() - begun)
    return least


def levels(lab: Lab) -> Iterator[Outcome]:
    """Rays of a beam by the largest number of levels of the octree."""
    for workload in (paper_scenes.scattered(), paper_scenes.concentrated()):
        specs = {depth: f"{POLYGON},max_depth={depth}" for depth in LEVELS}
        rays = lab.rays(workload, "{}x{}".format(*LARGEST), partial(paper_scenes.camera_rays, workload, LARGEST))
        found = lab.seconds(workload, list(specs.values()), rays)
        together = {depth: found[spec].counters["visits"] / steps(found[spec]) for depth, spec in specs.items()}
        yield Outcome(
            "faithful",
            verdict(holds=all(a >= b for a, b in itertools.pairwise(together.values()))),
            f"{workload.name}: rays that visit a node together, by the number of levels: "
            + ", ".join(f"{depth}: {count:.1f}" for depth, count in together.items()),
            "ns a ray: " + ", ".join(f"{depth}: {found[spec].nanoseconds:.0f}" for depth, spec in specs.items()),
            lab.error(workload, specs.values()),
            {f"{depth} levels": count for depth, count in together.items()},
        )


def empty_zones(lab: Lab) -> Iterator[Outcome]:
    """Share of the rays that hit nothing that stay in beams to their end."""
    for workload in (paper_scenes.scattered(), paper_scenes.concentrated()):
        rays = paper_scenes.camera_rays(workload, LARGEST)
        lab.check(workload, POLYGON, rays)
        found = lab.build(workload, POLYGON).closest(rays.origins, rays.directions, counters=True, **rays.options(1))
        counters, missed = found.counters, found.triangle < 0
        assert counters is not None, "they were requested"
        single = {
            what: float((counters["beam_singles"][own] > 0).mean())
            for what, own in (("miss", missed), ("hit", ~missed))
        }
        nodes = sum(counters[name][missed].astype(np.int64) for name in ("steps", "leaves", "leaves_empty"))
        yield Outcome(
            "faithful",
            verdict(holds=single["miss"] <= FEW),
            f"{workload.name}: of the rays that hit nothing, {missed.mean():.0%} of all, {1 - single['miss']:.1%} stay "
            f"in beams to their end (limit: {1 - FEW:.0%}), of the others {1 - single['hit']:.1%} until they hit",
            f"rays that hit nothing pay for {float(np.mean(nodes)):.3f} nodes each",
            lab.error(workload, [POLYGON]),
            single,
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
        "beams-independent",
        beams.PAPER,
        "Beams are independent and so can be traced in parallel.",
        independent,
        SCENES,
    ),
    Claim(
        "beams-levels",
        beams.PAPER,
        "Fewer levels of subdivision let beams hold more rays.",
        levels,
    ),
    Claim(
        "beams-empty-zones",
        beams.PAPER,
        "In large empty zones rays travel in beams to the end, without being determined.",
        empty_zones,
    ),
    Claim(
        "beams-threshold",
        beams.PAPER,
        "Rays go on singly where fewer than a threshold are left; the paper gives no number.",
        thresholds,
        SCENES,
    ),
)
