# SPDX-License-Identifier: GPL-3.0-or-later
"""Timed passes over ray sets, interleaved so that drift of the machine's speed affects every configuration equally.

In each round every configuration traces the same rays once, and the fastest one twice: the difference of its two times
is the noise of the machine under the same conditions.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..scene import rays
from ..scene.rays import RaySet
from . import counting, inference, rows, yardstick
from .accuracy import Errors

if TYPE_CHECKING:
    from .analysis.field import Shape, Work
    from .analysis.tradeoff import Point
    from .preparation import Options
    from .rows import RayColumns
    from .two_level import AnyLayout
    from .yardstick import Traced

STEP = 4
"""Divisor of a ray set where all its rays take too long: a quarter, a sixteenth, ... are timed."""

USUAL_RAYS_S = 4e6
"""Rays per second of a usual structure on a usual scene, which give the number of timed rays."""

SLOW = 16.0
"""A structure is slow if a pass over the usual rays takes more than this multiple of the limit of a pass."""

VIEW_SECONDS = 0.1
"""Smallest limit on a pass over one of the smaller views, in seconds."""

WARM_SECONDS = 0.02
"""Passes shorter than this are preceded by an untimed one. Otherwise they would depend on the caches left by the
previous structure, and of two equal ones the one after a large structure would appear slower in every round.
"""

LEAST_RAYS = 64
"""One tile: the smallest number of rays of a pass."""


@dataclass(eq=False)
class Candidate:
    """A configuration while it is measured.

    first_seconds: of builds with their first pass over the camera rays, one per round. statistics: of its structure,
    after its answers were compared. checked: million rays per second of each set, from one pass while its answers were
    compared. timed: the rays of each set that it is timed on. seconds: of each set, one per round. control: the
    repeated times of the same rounds, for the noise.
    """

    spec: str
    structure: Traced
    build_seconds: list[float] = field(default_factory=list)
    first_seconds: list[float] = field(default_factory=list)
    statistics: dict[str, Any] = field(default_factory=dict)
    peak_bytes: int | None = None
    errors: dict[str, Errors] = field(default_factory=dict)
    checked: dict[str, float] = field(default_factory=dict)
    counted: dict[str, dict[str, float]] = field(default_factory=dict)
    events: dict[str, dict[str, float]] = field(default_factory=dict)
    timed: dict[str, RaySet] = field(default_factory=dict)
    seconds: dict[str, list[float]] = field(default_factory=dict)
    control: dict[str, list[float]] = field(default_factory=dict)
    curve: list[dict[str, Any]] = field(default_factory=list)
    scaling: list[dict[str, float]] = field(default_factory=list)
    offsets: list[dict[str, float]] = field(default_factory=list)
    tradeoff: list[Point] = field(default_factory=list)
    work: dict[str, Work] = field(default_factory=dict)
    shape: Shape | None = None
    differing_pixels: int = 0
    cost_map: dict[str, Any] | None = None
    left_out: list[str] = field(default_factory=list)

    @property
    def native(self) -> AnyLayout:
        """The structure of a configuration of the native module."""
        assert not isinstance(self.structure, yardstick.Foreign)
        return self.structure

    def again(self) -> Candidate:
        """The same structure and rays, without times."""
        return Candidate(self.spec, self.structure, checked=self.checked, counted=self.counted, timed=self.timed)

    def mrays(self, name: str) -> NDArray[np.float64]:
        """Million rays per second of a set, one per round."""
        found: NDArray[np.float64] = len(self.timed[name]) / np.maximum(self.seconds[name], 1e-9) / 1e6
        return found


def affordable(whole: RaySet, mrays_s: float, seconds: float, seed: int) -> RaySet:
    """The part of a set that is timed: all, a quarter, a sixteenth, ..., the same for all structures that are not slow.

    It is what the usual speed traces in about `seconds`: rays that go together are faster in larger batches, so only
    times of equal batches are comparable. mrays_s: the structure's speed, which shortens the batch of a slow one.
    """
    count = len(whole)
    while count > LEAST_RAYS and (count > USUAL_RAYS_S * seconds or count > SLOW * mrays_s * 1e6 * seconds):
        count //= STEP
    return whole.take(rays.blocks(len(whole), max(count, min(LEAST_RAYS, len(whole))), seed))


def clock(threads: int) -> Callable[[], float]:
    """The clock of timed work: on one thread processor time, which other load does not affect; else wall-clock time."""
    return time.process_time if threads == 1 else time.perf_counter


def one_pass(candidate: Candidate, some: RaySet, threads: int) -> float:
    """Seconds of one pass over these rays."""
    now = clock(threads)
    structure, options = candidate.structure, some.options(threads)
    if isinstance(structure, yardstick.Foreign):
        trace = structure.timed(some)
        start = now()
        trace()
        return now() - start
    ask = structure.occluded if some.any_hit else structure.closest
    start = now()
    ask(some.origins, some.directions, **options)
    return now() - start


def warmed_pass(candidate: Candidate, some: RaySet, threads: int) -> float:
    """Seconds of a pass that does not depend on the work before it."""
    if len(some) < candidate.checked[some.name] * 1e6 * WARM_SECONDS:
        one_pass(candidate, some, threads)
    return one_pass(candidate, some, threads)


def rounds(candidates: Sequence[Candidate], name: str, repeats: int, threads: int) -> Iterator[str]:
    """Time every configuration on one set; yields the text of each step, one pass per step. The first round is a
    warm-up.
    """
    ours = [c for c in candidates if not yardstick.is_foreign(c.spec) and len(c.timed[name])]
    control = max(ours, key=lambda c: c.checked[name], default=None)
    for number in range(repeats + 1):
        for candidate in candidates:
            yield f"{candidate.spec}: {name}, " + (f"round {number} of {repeats}" if number else "warming up")
            seconds = warmed_pass(candidate, candidate.timed[name], threads)
            if number:
                candidate.seconds.setdefault(name, []).append(seconds)
        if control is not None and number:
            control.control.setdefault(name, []).append(warmed_pass(control, control.timed[name], threads))


def scaling(candidates: Sequence[Candidate], views: Sequence[RaySet], repeats: int, options: Options) -> Iterator[str]:
    """Time views of growing size, one pass per step; appends the medians to `scaling`, with their intervals.

    The full view's time comes from its own rounds. A structure too slow for a view, or for the next larger one, gets
    none.
    """
    limit = max(options.pass_seconds, VIEW_SECONDS)
    for view in views:
        able = [c for c in candidates if len(view) <= c.checked["primary"] * 1e6 * limit]
        seconds: dict[str, list[float]] = {}
        for number in range(repeats):
            for candidate in able:
                yield f"{candidate.spec}: {len(view):,} rays, round {number + 1} of {repeats}"
                seconds.setdefault(candidate.spec, []).append(warmed_pass(candidate, view, options.threads))
        for candidate in able:
            candidate.scaling.append(_view(len(view), seconds[candidate.spec]))
    whole = options.size[0] * options.size[1]
    for candidate in candidates:
        if candidate.scaling and len(candidate.timed["primary"]) == whole > candidate.scaling[-1]["rays"]:
            candidate.scaling.append(_view(whole, candidate.seconds["primary"]))


def _view(count: int, seconds: Sequence[float]) -> dict[str, float]:
    """Rays of a view, and the median of its seconds with its interval, where there is one."""
    found = rows.spread(seconds)
    return {"rays": count, "seconds": found["med"], **{key: found[key] for key in ("low", "high") if key in found}}


def count(candidate: Candidate, some: RaySet, threads: int) -> dict[str, float]:
    """Mean steps and triangle tests per ray; nothing for foreign tracers, or where there are no rays."""
    structure = candidate.structure
    if isinstance(structure, yardstick.Foreign) or not len(some):
        return {}
    counters = counting.counters(structure, some, threads)
    names = [name for name in counters if name in COUNTERS or name.startswith(CASE)]
    return {name: float(np.mean(counters[name])) for name in names}


def noise(candidates: Sequence[Candidate], name: str) -> float | None:
    """The typical relative difference between two times of the same work in the same round; None if not measured."""
    for candidate in candidates:
        again = candidate.control.get(name)
        if again:
            first = np.maximum(candidate.seconds[name], 1e-9)
            return float(np.expm1(np.median(np.abs(np.log(np.maximum(again, 1e-9) / first)))))
    return None


def speeds(candidate: Candidate, name: str, anchor: Candidate | None, machine_noise: float | None) -> RayColumns:
    """A row's entry for one ray set. anchor: timed in the same rounds."""
    some = candidate.timed[name]
    counted = candidate.counted[name]
    found: RayColumns = {
        "n": len(some),
        "mrays_s": None,
        "times_embree": None,
        "rounds": [],
        "anchor_rounds": [],
        "noise": machine_noise,
        "steps": counted.get("steps"),
        "steps_axis": counted.get("steps_axis"),
        "steps_oblique": counted.get("steps_oblique"),
        "steps_boxes": counted.get("steps_boxes"),
        "tests": counted.get("tests"),
        "hits": counted["hits"],
    }
    # Add case counters and speeds where they exist.
    cases = {name.removeprefix(CASE): mean for name, mean in counted.items() if name.startswith(CASE)}
    if cases:
        found["cases"] = cases
    if candidate.events.get(name):
        found["events"] = candidate.events[name]
    if len(some):
        rates = candidate.mrays(name)
        found["mrays_s"] = rows.spread(rates)
        found["rounds"] = [float(rate) for rate in rates]
        if anchor is not None:
            found["anchor_rounds"] = [float(rate) for rate in anchor.mrays(name)]
            if anchor.spec == yardstick.SPEC:
                times = rates / anchor.mrays(name)
                found["times_embree"] = float(np.median(times))
                if (between := inference.interval(times)) is not None:
                    found["times_embree_95"] = list(between)
    return found


CASE = "case_"
"""Prefix of the counters of the cases of ray and split plane."""

COUNTERS = ("steps", "steps_axis", "steps_oblique", "steps_boxes", "tests")
"""Mean counters per ray in a row: nodes visited, those with an axis plane, those with an oblique one, those with boxes,
intervals or octants, triangles tested.
"""
