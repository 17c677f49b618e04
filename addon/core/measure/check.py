# SPDX-License-Identifier: GPL-3.0-or-later
"""A quick check of one built structure: its speed on a scene's rays, and a sample of its answers
against brute force.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..scene import rays
from ..scene.workload import Workload
from . import accuracy, counting
from .accuracy import Answers, Errors
from .reference import affordable

if TYPE_CHECKING:
    from ..base.interface import Native, Structure

SIZE = (256, 256)
"""Width and height, in pixels, of the view whose rays are traced."""

SETS = ("primary", "shadow", "diffuse", "coplanar")
"""The rays of a picture, and rays in the planes of triangles, where a traversal without error bounds loses hits."""

MOST_CHECKED = 4096
"""Largest number of rays per set that are compared."""


@dataclass(frozen=True)
class Check:
    """Result of a check. errors: of a sample, against brute force. mrays_s, steps, tests: per set; the last two are
    means per ray.
    """

    errors: Errors
    mrays_s: dict[str, float]
    steps: dict[str, float]
    tests: dict[str, float]

    @property
    def right(self) -> bool:
        """Whether every checked answer equals brute force's bit for bit."""
        return self.errors.agrees(bitwise=True)


def steps(
    native: Native, structure: Structure, workload: Workload, *, seed: int = 1, threads: int = 0
) -> Iterator[Check]:
    """Check a native structure over the workload's triangles; yields after each set, the last result is complete."""
    sets = rays.make(workload, structure, size=SIZE, seed=seed, names=SETS)
    sets = [some for some in sets if len(some)]
    brute = native.build(workload.vertices, workload.triangles, "brute", threads=threads)
    wanted = max(min(affordable(workload, len(sets)), MOST_CHECKED), 64)
    found: list[Errors] = []
    speed: dict[str, float] = {}
    step_means: dict[str, float] = {}
    test_means: dict[str, float] = {}
    # Compare a sample of each set, time the whole set, and count the work of the sample.
    for whole in sets:
        some = whole.take(rays.blocks(len(whole), wanted, seed))
        right = Answers.of(brute.closest(some.origins, some.directions, t_max=some.t_max, threads=threads))
        answers, occluded = accuracy.traced(structure, some, threads)
        found.append(accuracy.compare(right, answers, occluded, native.ulp_distance, bitwise=True))
        speed[whole.name] = rate(structure, whole, threads)
        counters = counting.counters(structure, some, threads)
        step_means[whole.name], test_means[whole.name] = (float(np.mean(counters[key])) for key in ("steps", "tests"))
        yield Check(accuracy.total(found), dict(speed), dict(step_means), dict(test_means))


def rate(structure: Structure, whole: rays.RaySet, threads: int, repeats: int = 1) -> float:
    """Million rays of a set per second, the best of `repeats` passes after a warm-up pass."""
    return max(rates(structure, whole, threads, repeats))


def rates(structure: Structure, whole: rays.RaySet, threads: int, repeats: int) -> list[float]:
    """Million rays of a set per second in each of `repeats` passes after a warm-up pass.

    On one thread the thread's processor clock is used, which other load on the machine does not affect.
    """
    ask = structure.occluded if whole.any_hit else structure.closest
    options = whole.options(threads)
    clock = time.thread_time if threads == 1 else time.perf_counter
    found = []
    for _ in range(repeats + 1):
        start = clock()
        ask(whole.origins, whole.directions, **options)
        found.append(len(whole) / max(clock() - start, 1e-9) / 1e6)
    return found[1:]


def timed_build(
    native: Native, workload: Workload, spec: str, threads: int, memory_limit: int | None = None
) -> tuple[Structure, float]:
    """A structure and its build time in seconds, in processor time on one thread.

    memory_limit: bytes that the build may use, None for the native module's limit. Raises the build's exceptions.
    """
    start = time.process_time()
    structure = native.build(workload.vertices, workload.triangles, spec, threads=threads, memory_limit=memory_limit)
    worked = time.process_time() - start
    return structure, worked if threads == 1 else float(structure.statistics["build_seconds"])
