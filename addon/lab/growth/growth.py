# SPDX-License-Identifier: GPL-3.0-or-later
"""Growth of times with the number of triangles: one surface at increasingly fine tessellations, under the same rays.

The surface is a bumpy torus, tilted against the axes and seen from inside its tube, so that every ray hits it. The rays
are made on one tessellation, and their origins are lifted off so that they suit all others.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...core.base import rotation
from ...core.base.native import FAILURES, first_line
from ...core.measure import accuracy, check, counting, peak
from ...core.measure.accuracy import Answers, Errors
from ...core.measure.reference import affordable
from ...core.measure.rows import is_lazy
from ...core.scene import rays
from ...core.scene.rays import RaySet
from ...core.scene.workload import View, Workload

if TYPE_CHECKING:
    from ...core.base.interface import Native, Structure

SIZES = tuple(round(10 ** (4 + half / 2)) for half in range(7))
"""Numbers of triangles: half decades from ten thousand to ten million."""

LEAST = 400
"""Smallest number of triangles; fewer do not resolve the bumps."""

MOST = 50_000_000
"""Largest number of triangles; more exceed the memory of most machines."""

RAYS_FROM = 10_000
"""Number of triangles of the tessellation on which the rays are made."""

LIFT = 0.01
"""Distance of the bounces' origins from that tessellation, as a share of the diagonal: beyond all other
tessellations.
"""

SETS = ("primary", "diffuse")

ALONE = "primary, alone"
"""The primary rays again, as unrelated single rays. The work that a tile shares shrinks with the triangles, so only
this set shows the growth for a single ray.
"""

BRUTE_TESTS = 2_000_000_000
"""Triangle tests per set that brute force may spend, which limits the number of compared rays."""

LEAST_CHECKED = 192

WAYS_AROUND, WAYS_ACROSS = 9, 5
"""Number of bumps around the torus and across its tube."""

RADIUS, BUMP = 0.35, 0.06
"""Radius of the tube and its variation, relative to the torus's radius."""

AHEAD = 0.6
"""Angle along the ring to the view's target, in radians."""


TILT = rotation.tilt(0.5, 0.7)


class LazyError(ValueError):
    """A lazily built configuration, whose build time excludes the part done while tracing. The message names it."""


@dataclass(frozen=True)
class Options:
    """Options of the measurement. threads: numbers of threads of the builds. repeats: of builds and of passes over the
    rays.

    size: width and height of the view. check_rays: largest number of rays per set compared with brute force. peak:
    whether each build is repeated in its own process, to measure its memory. memory_limit: bytes that a build may use,
    None for the native module's limit.
    """

    sizes: tuple[int, ...] = SIZES
    threads: tuple[int, ...] = (1, 2)
    repeats: int = 3
    size: tuple[int, int] = (512, 512)
    check_rays: int = 4096
    seed: int = 1
    peak: bool = True
    memory_limit: int | None = None


@dataclass
class Point:
    """Measurements of one structure at one number of triangles; None where unknown.

    builds: by number of threads, processor and wall-clock seconds, one of each per repeat. rays: by set, nanoseconds
    per ray on one thread, the shortest of the passes, and the mean steps and triangle tests. errors: of the compared
    rays. A point with wrong answers has no times.
    """

    spec: str
    triangles: int
    errors: Errors | None = None
    builds: dict[int, dict[str, list[float]]] = field(default_factory=dict)
    rays: dict[str, dict[str, float]] = field(default_factory=dict)
    bytes: int | None = None
    peak_bytes: int | None = None
    left_out: list[str] = field(default_factory=list)
    error: str | None = None

    @property
    def right(self) -> bool:
        """Whether every answer equals brute force's bit for bit."""
        return self.errors is not None and self.errors.agrees(bitwise=True)

    def build_seconds(self, threads: int, clock: str) -> float | None:
        """The shortest of the repeats. clock: "processor" or "wall"."""
        found = self.builds.get(threads)
        return None if found is None else min(found[clock])

    def speed_up(self) -> float | None:
        """Ratio of the wall-clock build times on one thread and on the most threads, shortest against shortest."""
        most = max(self.builds, default=1)
        one, many = (self.build_seconds(threads, "wall") for threads in (1, most))
        return None if most == 1 or one is None or many is None else one / many

    def as_row(self) -> dict[str, Any]:
        """The point as a JSON object."""
        kept = {key: value for key, value in asdict(self).items() if key != "errors"}
        errors = None if self.errors is None else self.errors.as_row("brute")
        return {**kept, "errors": errors, "speed_up": self.speed_up()}


Event = str | Point


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


def fixed_rays(native: Native, options: Options) -> list[RaySet]:
    """The rays traced on all tessellations."""
    coarse = torus(RAYS_FROM)
    tracer = native.build(coarse.vertices, coarse.triangles, "brute", threads=0)
    primary, diffuse = rays.make(coarse, tracer, size=options.size, seed=options.seed, names=SETS, offset=LIFT)
    return [primary, replace(primary, name=ALONE, order="none"), diffuse]


def refuse_lazy(specs: Sequence[str]) -> None:
    """Reject lazily built trees: their remaining work depends on the rays, not on the triangles alone. Raises
    LazyError.
    """
    for spec in specs:
        if is_lazy(spec):
            raise LazyError(f"{spec} is built lazily, so the time of its build does not show its growth")


def measure(native: Native, specs: Sequence[str], options: Options) -> Iterator[Event]:
    """Measure all structures at all sizes, smallest first; yields the text of each step, and each complete point.

    Raises LazyError.
    """
    refuse_lazy(specs)
    # Make the rays once for all sizes.
    yield "making the rays"
    ray_sets = fixed_rays(native, options)
    for size in options.sizes:
        workload = torus(size)
        count = len(workload.triangles)
        yield f"{count:,} triangles: brute force, the reference"
        checked, expected = _reference(native, workload, ray_sets, options)
        for spec in specs:
            point = Point(spec, count)
            try:
                yield from _measure(native, workload, point, ray_sets, checked, expected, options)
            except FAILURES as error:
                point.error = first_line(error)
            yield point


def _reference(
    native: Native, workload: Workload, ray_sets: Sequence[RaySet], options: Options
) -> tuple[list[RaySet], list[Answers]]:
    """A sample of each set, and brute force's answers to it."""
    count = min(max(affordable(workload, tests=BRUTE_TESTS), LEAST_CHECKED), options.check_rays)
    checked = [some.take(rays.blocks(len(some), count, options.seed)) for some in ray_sets]
    brute = native.build(workload.vertices, workload.triangles, "brute", threads=0)
    return checked, [Answers.of(brute.closest(some.origins, some.directions, threads=0)) for some in checked]


def _measure(
    native: Native,
    workload: Workload,
    point: Point,
    ray_sets: Sequence[RaySet],
    checked: Sequence[RaySet],
    expected: Sequence[Answers],
    options: Options,
) -> Iterator[str]:
    """Fill a point: first the check of its answers, then the times. Yields the text of each step."""
    where = f"{point.triangles:,} triangles, {point.spec}"
    builds: dict[int, dict[str, list[float]]] = {}
    # Build on each number of threads in turns; the first structure is also checked and traced.
    for repeat in range(options.repeats):
        for threads in options.threads:
            yield f"{where}: building on {threads} threads, {repeat + 1} of {options.repeats}"
            structure, worked, taken = _build(native, workload, point.spec, threads, options)
            one = builds.setdefault(threads, {"processor": [], "wall": []})
            one["processor"].append(worked)
            one["wall"].append(taken)
            if repeat == 0 and threads == options.threads[0]:
                yield f"{where}: comparing answers with those of brute force"
                point.errors = _errors(native, structure, checked, expected)
                point.bytes = structure.statistics["bytes"]
                if not point.right:
                    return
                for some in ray_sets:
                    yield f"{where}: {len(some):,} {some.name} rays"
                    point.rays[some.name] = _pace(structure, some, options.repeats)
            # Free this structure first, so that every build starts with the same free memory.
            del structure
            gc.collect()
    point.builds = builds
    if options.peak:
        yield f"{where}: building in a process of its own, for the memory"
        try:
            point.peak_bytes = _peak(native, workload, point.spec, options)
        except (peak.PeakError, OSError) as error:
            point.left_out.append(f"peak memory: {first_line(error)}")


def _build(
    native: Native, workload: Workload, spec: str, threads: int, options: Options
) -> tuple[Structure, float, float]:
    """A structure, and the seconds of its build: processor time of all threads, and wall-clock time."""
    worked, begun = time.process_time(), time.perf_counter()
    structure = native.build(
        workload.vertices, workload.triangles, spec, threads=threads, memory_limit=options.memory_limit
    )
    return structure, time.process_time() - worked, time.perf_counter() - begun


def _errors(native: Native, structure: Structure, checked: Sequence[RaySet], expected: Sequence[Answers]) -> Errors:
    """The errors of nearest hits and any-hits over all sets."""
    found = []
    for some, right in zip(checked, expected, strict=True):
        answers, occluded = accuracy.traced(structure, some, 1)
        found.append(accuracy.compare(right, answers, occluded, native.ulp_distance, bitwise=True))
    return accuracy.total(found)


def _pace(structure: Structure, some: RaySet, repeats: int) -> dict[str, float]:
    """Nanoseconds per ray on one thread, and mean steps and tests per ray."""
    counters = counting.counters(structure, some, 1)
    rate = check.rate(structure, some, 1, repeats)
    return {"nanoseconds": 1e3 / rate} | {name: float(np.mean(counters[name])) for name in ("steps", "tests")}


def _peak(native: Native, workload: Workload, spec: str, options: Options) -> int:
    """Largest growth of the process's memory during a build, in bytes. Raises PeakError and OSError."""
    scene = peak.save_scene(workload.vertices, workload.triangles)
    try:
        running = peak.Measurement(native, scene, spec, max(options.threads), options.memory_limit)
        try:
            while not running.wait(1.0):
                pass
            return running.result()
        finally:
            running.stop()
    finally:
        scene.unlink(missing_ok=True)


@dataclass(frozen=True)
class BuildFit:
    """Growth of build times. power: a in seconds ~ n^a, by least squares of logarithms; ideal: the same for n log n
    over the same range.

    constant: c in seconds ~ c n log2 n, in nanoseconds; ratios: measured over fitted, by size.
    """

    power: float
    ideal: float
    constant: float
    ratios: tuple[float, ...]


@dataclass(frozen=True)
class TraceFit:
    """Growth of trace times. base, slope: in nanoseconds ~ base + slope log2 n, by least squares; power: in nanoseconds
    ~ n^power.

    ratios: 1 plus the distance of the measurement from the line, as a share of the mean, by size.
    """

    base: float
    slope: float
    power: float
    ratios: tuple[float, ...]


def fit_build(counts: Sequence[int], seconds: Sequence[float]) -> BuildFit | None:
    """The growth of build times; None for fewer than two different sizes."""
    if len(set(counts)) < 2:
        return None
    n, t = np.array(counts, np.float64), np.maximum(seconds, 1e-9)
    work = n * np.log2(n)
    constant = float(np.exp(np.mean(np.log(t / work))))
    return BuildFit(_power(n, t), _power(n, work), 1e9 * constant, tuple((t / (constant * work)).tolist()))


def fit_trace(counts: Sequence[int], values: Sequence[float]) -> TraceFit | None:
    """The growth of a ray's time or of its steps; None for fewer than three different sizes, which fit any line."""
    if len(set(counts)) < 3:
        return None
    depth, t = np.log2(np.array(counts, np.float64)), np.maximum(values, 1e-9)
    slope, base = (float(value) for value in np.polyfit(depth, t, 1))
    ratios = 1 + (t - base - slope * depth) / t.mean()
    return TraceFit(base, slope, _power(np.exp2(depth), t), tuple(ratios.tolist()))


def _power(n: NDArray[np.float64], t: NDArray[np.float64]) -> float:
    return float(np.polyfit(np.log(n), np.log(t), 1)[0])
