# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors against the time of a ray: each configuration with and without its error bounds, on three scenes.

The scenes are the measured one, the same moved far from the origin, and a grid of touching boxes, where rays that a
traversal without bounds loses are frequent. Errors are counted by one rule for all programs, Embree included: a hit
that is missed or invented, or one on a triangle at another distance.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np

from ...base.arrays import F32, I32
from ...scene import grid, rays
from ...scene.rays import RaySet
from ...scene.workload import Workload
from .. import accuracy, inference, timing, yardstick
from ..accuracy import Answers
from ..offsets import is_unguarded, unguarded
from ..rows import Spread, spread
from ..timing import Candidate

if TYPE_CHECKING:
    from ...base.interface import Native
    from ..yardstick import Traced

HERE, FAR, GRID = "here", "far", "grid"
"""The scene itself, the same moved, and the grid of touching boxes."""

DISTANCE = 1e5
"""Distance of the moved scene from the origin, in its own diagonals: seven bits remain for positions inside it."""

CHECKED = 16_384
"""Largest number of rays of each set that are compared and timed."""

CHECKED_FAR = 2048
"""The same on the moved scene, where brute force has to answer them and bounds make rays fifty times as slow."""

BOXES = 4
"""Boxes along each axis of the grid."""

ROUNDS = inference.LEAST_ROUNDS
"""Largest number of timed passes, after one that warms the caches. The variants of a configuration alternate."""

PASSES_SECONDS = 0.2
"""No round but the first begins after this time; medians of fewer rounds have no interval."""

BUILD_SECONDS = 1.0
"""Configurations that take longer to build are not built again: their variants are measured on the grid only."""


class Point(TypedDict):
    """One variant of a configuration on one scene and ray set.

    bounds: whether error bounds are kept; Embree's are its robust mode. wrong: rays, of `rays`. ulp_max, ulp_p999,
    ulp_mean: of the distance, in units in the last place, over rays that hit in both; None where no ray does, and for
    any-hit rays. ns: nanoseconds per ray over the rounds, None without rays.
    """

    place: str
    set: str
    bounds: bool
    rays: int
    wrong: int
    ulp_max: int | None
    ulp_p999: int | None
    ulp_mean: float | None
    ns: Spread | None


@dataclass(frozen=True, eq=False)
class Place:
    """A scene, some of its rays, and brute force's answers to them."""

    name: str
    vertices: F32
    triangles: I32
    sets: tuple[RaySet, ...]
    expected: Mapping[str, Answers]


@dataclass(frozen=True)
class Limits:
    """threads: of builds and timed passes. memory: bytes that a build may use, None for the native module's limit.
    brief: without the moved scene.
    """

    threads: int
    memory: int | None = None
    brief: bool = False


class Tradeoff:
    """The scenes of all measurements, made once for all configurations."""

    def __init__(
        self,
        native: Native,
        workload: Workload,
        checked: Mapping[str, tuple[RaySet, Answers]],
        seed: int,
        limits: Limits,
    ) -> None:
        """checked: the rays of each set and their correct answers."""
        self._native, self._limits = native, limits
        some, expected = [], {}
        for name, (whole, right) in checked.items():
            kept = rays.blocks(len(whole), CHECKED, seed)
            some.append(whole.take(kept))
            expected[name] = right.take(kept)
        self._places = [Place(HERE, workload.vertices, workload.triangles, tuple(some), expected)]
        if not limits.brief:
            self._places.append(_far(native, workload, some, seed))
        if workload.name != GRID:
            boxes = grid.workload(BOXES, CHECKED, seed)
            self._places.append(_place(native, GRID, boxes.vertices, boxes.triangles, boxes.extra))

    def points(self, candidate: Candidate) -> Iterator[list[Point]]:
        """The points of a built configuration, scene by scene. Raises the exceptions of a build."""
        variants = variants_of(candidate.spec, self._native.structures())
        slow = min(candidate.build_seconds) > BUILD_SECONDS
        for place in self._places:
            # The structure of the row is the first variant on its own scene; the others are built here.
            first = next(iter(variants))
            built: dict[bool, Traced] = {first: candidate.structure} if place.name == HERE else {}
            if not slow or place.name == GRID:
                built |= {bounds: self._built(place, spec) for bounds, spec in variants.items() if bounds not in built}
            yield self._measured(place, built)

    def _built(self, place: Place, spec: str) -> Traced:
        if spec in yardstick.MODES:
            return yardstick.EmbreeStructure(place.vertices, place.triangles, robust=yardstick.MODES[spec])
        if yardstick.is_foreign(spec):
            if place.name == GRID and spec in yardstick.UNSAFE:
                raise ValueError(f"the grid of touching boxes: {yardstick.UNSAFE[spec]}")
            return yardstick.MAKERS[spec](place.vertices, place.triangles)
        limits = self._limits
        return self._native.build(
            place.vertices, place.triangles, spec, threads=limits.threads, memory_limit=limits.memory
        )

    def _measured(self, place: Place, built: Mapping[bool, Traced]) -> list[Point]:
        found: list[Point] = []
        for some in place.sets:
            seconds = self._times(some, built)
            found += [
                self._point(place, some, bounds, structure, seconds[bounds]) for bounds, structure in built.items()
            ]
        return found

    def _times(self, some: RaySet, built: Mapping[bool, Traced]) -> dict[bool, list[float]]:
        """Seconds of the passes of each variant, which alternate."""
        seconds: dict[bool, list[float]] = {bounds: [] for bounds in built}
        begun = time.monotonic()
        for number in range(ROUNDS + 1 if len(some) else 0):
            if number > 1 and time.monotonic() > begun + PASSES_SECONDS:
                break
            for bounds, structure in built.items():
                taken = timing.one_pass(Candidate("", structure), some, self._limits.threads)
                seconds[bounds] += [taken] if number else []
        return seconds

    def _point(self, place: Place, some: RaySet, bounds: bool, structure: Traced, seconds: Sequence[float]) -> Point:
        """Compare the answers of one variant."""
        arguments = some.options(self._limits.threads)
        answers = occluded = None
        if some.any_hit:
            occluded = structure.occluded(some.origins, some.directions, **arguments)
        else:
            answers = Answers.of(structure.closest(some.origins, some.directions, **arguments))
        errors = accuracy.compare(
            place.expected[some.name], answers, occluded, self._native.ulp_distance, bitwise=False
        )
        ulps = errors.ulps
        return {
            "place": place.name,
            "set": some.name,
            "bounds": bounds,
            "rays": len(some),
            "wrong": errors.wrong,
            "ulp_max": int(ulps.max()) if len(ulps) else None,
            "ulp_p999": int(np.quantile(ulps, 0.999, method="higher")) if len(ulps) else None,
            "ulp_mean": float(ulps.mean()) if len(ulps) else None,
            "ns": spread(1e9 * np.array(seconds) / len(some)) if seconds else None,
        }


def variants_of(spec: str, structures: Sequence[Any]) -> dict[bool, str]:
    """The configurations with and without error bounds; only one where a structure has no such choice."""
    if spec == yardstick.SPEC:
        return {robust: mode for mode, robust in yardstick.MODES.items()}
    if yardstick.is_foreign(spec):
        return {False: spec}
    if is_unguarded(spec):
        return {False: spec}
    without = unguarded(spec, structures)
    return {True: spec} if without is None else {True: spec, False: without}


def _place(native: Native, name: str, vertices: F32, triangles: I32, sets: Sequence[RaySet]) -> Place:
    """A scene with brute force's answers."""
    brute = native.build(vertices, triangles, "brute", threads=0)
    expected = {
        one.name: Answers.of(brute.closest(one.origins, one.directions, t_max=one.t_max, threads=0)) for one in sets
    }
    return Place(name, vertices, triangles, tuple(sets), expected)


def _far(native: Native, workload: Workload, sets: Sequence[RaySet], seed: int) -> Place:
    """The scene and some of its rays, moved and rounded."""
    sets = [one.take(rays.blocks(len(one), CHECKED_FAR, seed)) for one in sets]
    # Not along a diagonal, and with a part that binary numbers cannot represent exactly.
    shift = (DISTANCE * workload.diagonal() + 0.1) * np.array([1.0, -1.0, 0.5])
    moved = [replace(one, origins=(one.origins + shift).astype(np.float32)) for one in sets]
    return _place(native, FAR, (workload.vertices + shift).astype(np.float32), workload.triangles, moved)
