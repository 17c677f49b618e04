# SPDX-License-Identifier: GPL-3.0-or-later
"""How time grows with the number of triangles: one surface, tessellated ever more finely, under always the same rays.

The surface is a bumpy, tilted torus, nowhere in line with the axes, seen from inside its tube, so that every ray meets
it. The rays are made on one tessellation of it, and their origins lifted off, so that they fit all others.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from addon.core.base import rotation
from addon.core.base.native import FAILURES, first_line
from addon.core.measure import accuracy, check, counting, peak
from addon.core.measure.accuracy import Answers, Errors
from addon.core.measure.reference import affordable
from addon.core.measure.rows import is_lazy
from addon.core.scene import rays
from addon.core.scene.rays import RaySet
from addon.core.scene.workload import View, Workload

if TYPE_CHECKING:
    from addon.core.base.interface import Native, Structure

SIZES = tuple(round(10 ** (4 + half / 2)) for half in range(7))
"""Triangles: half decades from ten thousand to ten million."""

LEAST = 400
"""Fewer triangles would not show the bumps."""

MOST = 50_000_000
"""More would not fit into the memory of most machines."""

RAYS_FROM = 10_000
"""The rays are made on a tessellation of about so many triangles, whatever is measured."""

LIFT = 0.01
"""How far the bounces start off that tessellation, as a share of the diagonal: beyond every other tessellation."""

SETS = ("primary", "diffuse")

ALONE = "primary, alone"
"""The primary rays again, as rays that have nothing to do with each other. What a tile of them shares becomes less, the
smaller the triangles, so only this tells how the way of one ray grows."""

BRUTE_TESTS = 2_000_000_000
"""So many triangle tests per set the reference may do, which decides how many rays are compared."""

LEAST_CHECKED = 192

WAYS_AROUND, WAYS_ACROSS = 9, 5
"""Bumps around the torus and across its tube."""

RADIUS, BUMP = 0.35, 0.06
"""Of the tube, and by how much it varies, where the torus has the radius one."""

AHEAD = 0.6
"""How far along the ring the view looks, in radians."""


TILT = rotation.tilt(0.5, 0.7)


class LazyError(ValueError):
    """A configuration whose build would be told without what rays do of it. The message names it."""


@dataclass(frozen=True)
class Options:
    """What is measured. threads: the numbers of threads of the builds. repeats: of builds and of passes over the rays.

    size: width and height of the view. check_rays: rays per set compared with brute force at most. peak: whether
    each build is done once more in a process of its own, for its memory. memory_limit: bytes that a build may take,
    None for what the native module allows.
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
    """What was measured for one structure and one number of triangles; what is not known is None.

    builds: by number of threads, the processor's seconds and those of the clock, one of each per repeat. rays: by set,
    nanoseconds per ray on one thread, the least of the passes, and the mean steps and triangle tests. errors: of the
    compared rays. Where an answer is wrong there is no time.
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
        """Whether every answer was that of brute force, to the last bit."""
        return self.errors is not None and self.errors.agrees(bitwise=True)

    def build_seconds(self, threads: int, clock: str) -> float | None:
        """The least of the repeats. clock: processor or wall."""
        found = self.builds.get(threads)
        return None if found is None else min(found[clock])

    def speed_up(self) -> float | None:
        """By how much the most threads shorten the build by the clock, least against least."""
        most = max(self.builds, default=1)
        one, many = (self.build_seconds(threads, "wall") for threads in (1, most))
        return None if most == 1 or one is None or many is None else one / many

    def as_row(self) -> dict[str, Any]:
        """As JSON has it."""
        kept = {key: value for key, value in asdict(self).items() if key != "errors"}
        errors = None if self.errors is None else self.errors.as_row("brute")
        return {**kept, "errors": errors, "speed_up": self.speed_up()}


Event = str | Point


def torus(count: int) -> Workload:
    """The surface of about `count` triangles: the nearest product of two numbers whose ratio fits the shape."""
    across = max(8, round((count / 6) ** 0.5))
    around = max(24, round(count / 2 / across))
    u = np.arange(around)[:, None] * (2 * np.pi / around)
    v = np.arange(across)[None, :] * (2 * np.pi / across)
    tube = RADIUS + BUMP * np.sin(WAYS_AROUND * u + np.sin(v)) * np.cos(WAYS_ACROSS * v)
    ring = 1 + tube * np.cos(v)
    points = np.stack([ring * np.cos(u), ring * np.sin(u), tube * np.sin(v)], axis=-1).reshape(-1, 3)
    vertices = np.ascontiguousarray(points @ TILT.T, np.float32)
    here = np.arange(around * across, dtype=np.int32).reshape(around, across)
    there, up, both = np.roll(here, -1, 0), np.roll(here, -1, 1), np.roll(here, (-1, -1), (0, 1))
    triangles = np.stack([here, there, both, here, both, up], axis=-1).reshape(-1, 3)
    return Workload(f"torus-{len(triangles)}", vertices, triangles, _view())


def _view() -> View:
    """From the middle of the tube along it."""
    eye, target = (TILT @ np.array([np.cos(u), np.sin(u), 0.0]) for u in (0.0, AHEAD))
    return View(eye, target, TILT @ np.array([0.0, 0.0, 1.0]), 60.0)


def fixed_rays(native: Native, options: Options) -> list[RaySet]:
    """The rays that all tessellations are asked."""
    coarse = torus(RAYS_FROM)
    tracer = native.build(coarse.vertices, coarse.triangles, "brute", threads=0)
    primary, diffuse = rays.make(coarse, tracer, size=options.size, seed=options.seed, names=SETS, offset=LIFT)
    return [primary, replace(primary, name=ALONE, order="none"), diffuse]


def refuse_lazy(specs: Sequence[str]) -> None:
    """What a tree that rays build leaves to them depends on the rays, not on the triangles alone. Raises LazyError."""
    for spec in specs:
        if is_lazy(spec):
            raise LazyError(f"{spec} is built by rays in part, so the time of its build says nothing of its growth")


def measure(native: Native, specs: Sequence[str], options: Options) -> Iterator[Event]:
    """Measure all structures on all sizes, the smallest first: what comes next, and each point when it is complete.

    Raises LazyError.
    """
    refuse_lazy(specs)
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
    """A part of each set, and what brute force answers."""
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
    """Fill a point: first the proof that the answers are right, then the times."""
    where = f"{point.triangles:,} triangles, {point.spec}"
    builds: dict[int, dict[str, list[float]]] = {}
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
            # The next build finds the memory free that this one had.
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
    """A structure, and the seconds of its build by the processor's clock, which counts all threads, and the wall's."""
    worked, begun = time.process_time(), time.perf_counter()
    structure = native.build(
        workload.vertices, workload.triangles, spec, threads=threads, memory_limit=options.memory_limit
    )
    return structure, time.process_time() - worked, time.perf_counter() - begun


def _errors(native: Native, structure: Structure, checked: Sequence[RaySet], expected: Sequence[Answers]) -> Errors:
    """Of closest and any hits of all sets."""
    found = []
    for some, right in zip(checked, expected, strict=True):
        answers, occluded = accuracy.traced(structure, some, 1)
        found.append(accuracy.compare(right, answers, occluded, native.ulp_distance, bitwise=True))
    return accuracy.total(found)


def _pace(structure: Structure, some: RaySet, repeats: int) -> dict[str, float]:
    """Nanoseconds per ray on one thread, and what the rays met on the way."""
    counters = counting.counters(structure, some, 1)
    rate = check.rate(structure, some, 1, repeats)
    return {"nanoseconds": 1e3 / rate} | {name: float(np.mean(counters[name])) for name in ("steps", "tests")}


def _peak(native: Native, workload: Workload, spec: str, options: Options) -> int:
    """The bytes by which a build's memory rises at most. Raises PeakError and OSError."""
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
    """power: a of seconds ~ n^a, by least squares of logarithms; of n log n over the same range it would be `ideal`.

    constant: c of seconds ~ c n log2 n, nanoseconds; ratios: measured over fitted, by size.
    """

    power: float
    ideal: float
    constant: float
    ratios: tuple[float, ...]


@dataclass(frozen=True)
class TraceFit:
    """base, slope: of nanoseconds ~ base + slope log2 n, by least squares; power: of nanoseconds ~ n^power.

    ratios: one, and how far the measured is from the line as a share of the mean, by size.
    """

    base: float
    slope: float
    power: float
    ratios: tuple[float, ...]


def fit_build(counts: Sequence[int], seconds: Sequence[float]) -> BuildFit | None:
    """How build time grows; None for fewer than two different sizes."""
    if len(set(counts)) < 2:
        return None
    n, t = np.array(counts, np.float64), np.maximum(seconds, 1e-9)
    work = n * np.log2(n)
    constant = float(np.exp(np.mean(np.log(t / work))))
    return BuildFit(_power(n, t), _power(n, work), 1e9 * constant, tuple((t / (constant * work)).tolist()))


def fit_trace(counts: Sequence[int], values: Sequence[float]) -> TraceFit | None:
    """How the time of a ray grows, or its steps; None for fewer than three different sizes, which any line fits."""
    if len(set(counts)) < 3:
        return None
    depth, t = np.log2(np.array(counts, np.float64)), np.maximum(values, 1e-9)
    slope, base = (float(value) for value in np.polyfit(depth, t, 1))
    ratios = 1 + (t - base - slope * depth) / t.mean()
    return TraceFit(base, slope, _power(np.exp2(depth), t), tuple(ratios.tolist()))


def _power(n: NDArray[np.float64], t: NDArray[np.float64]) -> float:
    return float(np.polyfit(np.log(n), np.log(t), 1)[0])
