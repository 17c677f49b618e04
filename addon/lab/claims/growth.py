# SPDX-License-Identifier: GPL-3.0-or-later
"""Growth of builds and rays with the number of triangles: one surface at ever finer tessellations, the same rays.

The surface is a bumpy torus, tilted against the axes and seen from inside its tube, so that every ray hits it. The rays
are made on one tessellation, and their origins are lifted off so that they suit all others.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ...core.base import rotation
from ...core.scene import rays
from ...core.scene.rays import RaySet
from ...core.scene.workload import View, Workload
from .claims import Chart, Claim, Lab, Outcome, slope, verdict

PAPER = "Wald and Havran, On building fast kd-trees for ray tracing, and on doing that in O(N log N) (2006)"

SPECS = ("kd", "bsp-wn-plus-kd")

COUNTS = {
    True: tuple(round(10 ** (4 + half / 2)) for half in range(5)),
    False: tuple(round(10 ** (4 + half / 2)) for half in range(7)),
}
"""Numbers of triangles, half decades: to a million in a quick run (True), to ten million in a full one."""

RAYS_FROM = 10_000
"""Number of triangles of the tessellation on which the rays are made."""

LIFT = 0.01
"""Distance of the bounces' origins from that tessellation, as a share of the diagonal: beyond all other
tessellations.
"""

SIZE = (512, 512)
"""Width and height of the view in pixels."""

ALONE = "primary, alone"
"""The primary rays again, as unrelated single rays. The work that a tile shares shrinks with the triangles, so only
this set shows the growth for a single ray.
"""

NEAR = 0.05
"""Largest distance of the steps of a ray from a line in log n, as a share of their mean (chosen)."""

WAYS_AROUND, WAYS_ACROSS = 9, 5
"""Number of bumps around the torus and across its tube."""

RADIUS, BUMP = 0.35, 0.06
"""Radius of the tube and its variation, relative to the torus's radius."""

AHEAD = 0.6
"""Angle along the ring to the view's target, in radians."""

TILT = rotation.tilt(0.5, 0.7)

Points = Sequence[tuple[float, float]]
"""Number of triangles and what was measured."""


def torus(count: int) -> Workload:
    """The surface with about `count` triangles: the nearest product of two numbers whose ratio fits the shape."""
    across = max(8, round((count / 6) ** 0.5))
    around = max(24, round(count / 2 / across))
    # Displace the tube's radius by the bumps.
    u = np.arange(around)[:, None] * (2 * np.pi / around)
    v = np.arange(across)[None, :] * (2 * np.pi / across)
    tube = RADIUS + BUMP * np.sin(WAYS_AROUND * u + np.sin(v)) * np.cos(WAYS_ACROSS * v)
    ring = 1 + tube * np.cos(v)
    points = np.stack([ring * np.cos(u), ring * np.sin(u), tube * np.sin(v)], axis=-1).reshape(-1, 3)
    vertices = np.ascontiguousarray(points @ TILT.T, np.float32)
    # Connect the closed grid of points with two triangles per cell.
    here = np.arange(around * across, dtype=np.int32).reshape(around, across)
    there, up, both = np.roll(here, -1, 0), np.roll(here, -1, 1), np.roll(here, (-1, -1), (0, 1))
    triangles = np.stack([here, there, both, here, both, up], axis=-1).reshape(-1, 3)
    return Workload(f"torus-{len(triangles)}", vertices, triangles, _view())


def _view() -> View:
    """A view from the middle of the tube along it."""
    eye, target = (TILT @ np.array([np.cos(u), np.sin(u), 0.0]) for u in (0.0, AHEAD))
    return View(eye, target, TILT @ np.array([0.0, 0.0, 1.0]), 60.0)


def fixed_rays(lab: Lab) -> list[RaySet]:
    """The rays traced on all tessellations."""
    coarse = torus(RAYS_FROM)
    tracer = lab.build(coarse, "brute")
    primary, diffuse = rays.make(coarse, tracer, size=SIZE, seed=1, names=("primary", "diffuse"), offset=LIFT)
    return [primary, replace(primary, name=ALONE, order="none"), diffuse]


def power(points: Points) -> float:
    """The exponent a of y ~ n^a, by least squares of logarithms."""
    return slope(tuple(np.log(point)) for point in points)


def over_work(points: Points) -> tuple[float, list[float]]:
    """The constant c of y ~ c n log₂ n, by least squares of logarithms, and measured over fitted, by size."""
    n, y = np.array(points, np.float64).T
    work = n * np.log2(n)
    constant = float(np.exp(np.mean(np.log(y / work))))
    return constant, (y / (constant * work)).tolist()


def over_line(points: Points) -> tuple[float, float, list[float]]:
    """Base and slope of y ~ base + slope log₂ n by least squares, and by size 1 plus the distance of the measurement
    from the line, as a share of the mean.
    """
    n, y = np.array(points, np.float64).T
    depth = np.log2(n)
    rise = slope(zip(depth, y, strict=True))
    base = float(y.mean() - rise * depth.mean())
    return base, rise, (1 + (y - base - rise * depth) / y.mean()).tolist()


def within(ratios: Sequence[float]) -> str:
    """The smallest and the largest ratio to a fit, in percent beyond it."""
    return f"{100 * (min(ratios) - 1):+.0f} to {100 * (max(ratios) - 1):+.0f} %".replace("-", "−")


def builds(lab: Lab) -> Iterator[Outcome]:
    """The exponent of the time of builds on one thread against that of n log n over the same sizes."""
    surfaces = [torus(count) for count in COUNTS[lab.quick]]
    primary, *_ = fixed_rays(lab)
    found = [lab.build_seconds(surface, SPECS) for surface in surfaces]
    counts = [float(len(surface.triangles)) for surface in surfaces]
    ideal = power([(n, n * float(np.log2(n))) for n in counts])
    for spec in SPECS:
        points = [(n, made.seconds[spec]) for n, made in zip(counts, found, strict=True)]
        grown, (constant, ratios) = power(points), over_work(points)
        # Check each tree, and build the largest on two threads too.
        for surface in surfaces:
            lab.check(surface, spec, primary)
        largest = surfaces[-1]
        pair = lab.native.build(largest.vertices, largest.triangles, spec, threads=2).statistics["build_seconds"]
        alone, size = (lab.statistics(largest, spec)[name] for name in ("build_seconds", "bytes"))
        yield Outcome(
            "best",
            verdict(holds=grown <= ideal),
            f"{spec}: the build grows as n^{grown:.3f}, where n log n is n^{ideal:.3f} over these sizes: "
            + ", ".join(f"{n:,.0f} triangles {seconds:.3g} s" for n, seconds in points),
            f"{1e9 * constant:.1f} ns × n log₂ n fits within {within(ratios)}; at {counts[-1]:,.0f} two threads build "
            f"× {alone / pair:.2f} by the clock on the wall, and the tree takes {size / counts[-1]:.0f} bytes "
            "a triangle",
            lab.errors([surface.name for surface in surfaces], [spec]),
            {"power": grown, "ideal": ideal},
            (
                Chart(
                    f"{spec}: build over c n log₂ n",
                    "log₂ n",
                    "measured over fitted",
                    {spec: list(zip(np.log2(counts).tolist(), ratios, strict=True))},
                    level=(1.0, "n log n"),
                ),
            ),
        )


def lengths(lab: Lab) -> Iterator[Outcome]:
    """The steps of a ray against a line in log n, for camera rays in tiles and alone, and for bounces."""
    surfaces = [torus(count) for count in COUNTS[lab.quick]]
    counts = [float(len(surface.triangles)) for surface in surfaces]
    sets = fixed_rays(lab)
    for spec in SPECS:
        found = [{some.name: lab.seconds(surface, [spec], some)[spec] for some in sets} for surface in surfaces]
        steps = {
            some.name: [(n, own[some.name].counters["steps"]) for n, own in zip(counts, found, strict=True)]
            for some in sets
        }
        times = {
            some.name: [(n, own[some.name].nanoseconds) for n, own in zip(counts, found, strict=True)] for some in sets
        }
        lines = {name: over_line(points) for name, points in steps.items()}
        far = {name: max(abs(ratio - 1) for ratio in ratios) for name, (_, _, ratios) in lines.items()}
        yield Outcome(
            "best",
            verdict(holds=all(far[some.name] <= NEAR for some in sets if some.order == "none")),
            f"{spec}: nodes a ray: "
            + "; ".join(
                f"{name} {base:.1f} {rise:+.2f} log₂ n within {within(ratios)}"
                for name, (base, rise, ratios) in lines.items()
            ),
            "ns a ray at "
            + "; ".join(
                f"{n:,.0f} triangles " + ", ".join(f"{name} {points[place][1]:.0f}" for name, points in times.items())
                for place, n in enumerate(counts)
            )
            + "; tiles grow faster, because neighbouring rays share fewer triangles",
            lab.errors([surface.name for surface in surfaces], [spec]),
            {name: power(points) for name, points in times.items()},
            tuple(
                Chart(
                    f"{spec}: {what} a ray",
                    "log₂ n",
                    what,
                    {name: [(float(np.log2(n)), y) for n, y in points] for name, points in own.items()},
                )
                for what, own in (("ns", times), ("nodes", steps))
            ),
        )


CLAIMS = (
    Claim("growth-builds", PAPER, "A tree over n triangles is built in a time of n log n.", builds),
    Claim("growth-rays", PAPER, "A ray visits as many nodes as the logarithm of the number of triangles.", lengths),
)
