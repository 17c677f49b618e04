# SPDX-License-Identifier: GPL-3.0-or-later
"""Choosing a structure for a scene and a number of samples, quickly: small trials first, large ones only for those
that may win by more than the trial costs.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ..measure import check
from ..measure.reference import BRUTE_TESTS, Reference, affordable
from ..scene import rays
from ..scene.workload import Workload
from ..structures import presets, specs
from ..structures.catalogue import Catalogue
from . import choice
from .choice import Comparison, Line, Mix, Plan

if TYPE_CHECKING:
    from ..base.interface import Native, Structure

CANDIDATES = (
    "bvh-sah",
    "kd",
    "bih-sah",
    "octree-net",
    "bsp-wn-plus-kd:k=4,alpha=0.5",
    "bsp-wn-plus-kd:k=6,alpha=0.1",
    "bsp-wn-plus-kd:k=6,alpha=0.5",
    "bsp-cn-plus-kd:k=6,alpha=0.5",
    "rbsp-kd:k=5",
)
"""What is tried: one of each kind, the best of the sources with few and with more directions."""

SIZE, TRIAL_SIZE = (480, 320), (192, 128)
"""Pixels of the view whose rays are timed, over the whole scene and over a part. In fewer, rays lie so far apart that
they do not go together as they do in most pictures, and another structure seems the best."""

LEAST_RAYS, SHARE = 192 * 128, 64
"""So many of the whole scene's rays are timed, in blocks that lie as close, or one for so many samples of the picture
where those are more: with few samples, timing all of them would take longer than the picture.
"""

TRIAL_TRIANGLES = 4096
"""A trial is made over at most so many triangles, chosen at random."""

MARGIN = 1.15
"""How far a small trial may be wrong: whoever seems slower than the best by less than this is tried in full."""

CHEAP, HOPELESS = 0.08, 4.0
"""Whoever builds in this share of the best picture's time is tried in full however slow it seemed, unless it seemed
slower than this many times the best: parts of a scene tell little of the whole."""

REPEATS = 3
"""Rays are timed this often, and the best counts: other work on the machine only ever slows down."""

CHECKED = 1024
"""Rays of each full trial that are compared with brute force, fewer where that would take longer than it may."""

BRUTE_TESTS_PER_RAY = 10
"""So many triangle tests brute force may do for each ray of the picture: a tenth of the picture's own time."""

SMALL_BUDGET = 0.05
"""So much of the best picture's time the small trials may take; those that are left then are not tried."""

BUDGET = 0.2
"""All full trials together may take this share of the best picture's time, so that choosing never costs more than it
can win."""


def view_of(pixels: int, most: tuple[int, int] = SIZE) -> tuple[int, int]:
    """The view in no more pixels than a picture of so many has, in whole tiles. most: width and height otherwise."""
    share = math.sqrt(min(1.0, pixels / math.prod(most)))
    width, height = (max(rays.TILE, int(side * share) // rays.TILE * rays.TILE) for side in most)
    return width, height


def candidates(catalogue: Catalogue) -> list[str]:
    """The configurations of CANDIDATES that this catalogue has."""
    return [spec for spec in CANDIDATES if _problem(catalogue, spec) is None]


def dropped(catalogue: Catalogue) -> list[str]:
    """One line for each configuration of CANDIDATES that this catalogue lacks, with the reason."""
    problems = ((spec, _problem(catalogue, spec)) for spec in CANDIDATES)
    return [f"{spec}: left out, {problem}" for spec, problem in problems if problem is not None]


def _problem(catalogue: Catalogue, spec: str) -> str | None:
    try:
        presets.settings(catalogue, spec)
    except specs.SpecError as error:
        return str(error)
    return None


@dataclass(frozen=True)
class Trial:
    """A configuration over a part of the scene. build: seconds expected over the whole; speed: relative to the first's
    on the same part, 2 is twice as fast.
    """

    spec: str
    build: float
    speed: float


@dataclass(frozen=True)
class Choice:
    """spec: what to use. structure: built over the whole scene. comparison: what was tried in full. notes: why, and why
    not the others. seconds: what choosing took in all; own: without the build of what was chosen, which is not lost.
    """

    spec: str
    structure: Structure
    comparison: Comparison
    notes: tuple[str, ...]
    seconds: float
    own: float


@dataclass
class Chooser:
    """One choice, step by step, for whoever shows progress and may want to stop.

    memory_limit: bytes that each build over the whole scene may take, None for what the native module allows.
    dropped: lines on configurations that are not tried, for the notes of the result.
    """

    native: Native
    workload: Workload
    plan: Plan
    specs: Sequence[str]
    threads: int = 0
    memory_limit: int | None = None
    dropped: Sequence[str] = ()
    result: Choice | None = None
    _reference: Reference | None = None
    _notes: list[str] = field(default_factory=list)
    _lines: dict[str, Line] = field(default_factory=dict)
    _built: dict[str, Structure] = field(default_factory=dict)

    def steps(self) -> Iterator[str]:
        """Says what is done next; after the last item `result` is there.

        Raises what builds raise, and RuntimeError when no structure gives right answers.
        """
        clock = time.process_time if self.threads == 1 else time.perf_counter
        began = clock()
        first, *others = self.specs
        yield f"{first}: building"
        structure, build = check.timed_build(self.native, self.workload, first, self.threads, self.memory_limit)
        size = view_of(self.plan.pixels)
        sets = rays.make(self.workload, structure, size=size, seed=1, names=choice.SETS)
        wanted = max(LEAST_RAYS, self.plan.pixels * self.plan.samples // SHARE)
        sets = [some.take(rays.blocks(len(some), wanted, seed=1)) for some in sets if len(some)]
        yield "counting the rays of a small picture"
        counted = choice.mix(self.native, structure, self.workload, SIZE, self.plan.max_bounces)
        yield "asking brute force"
        compared = self._affordable(counted)
        self._reference = Reference(self.native, self.workload, sets, compared, seed=1, threads=self.threads)
        yield f"{first}: comparing and timing rays"
        self._measured(first, structure, build, sets, counted)
        trials = yield from self._trials(first, others, clock)
        spent = 0.0
        for trial in sorted(trials, key=lambda trial: self._expected(trial, first)):
            best = self._best()
            expected = self._expected(trial, first)
            cheap = trial.build <= CHEAP * best.total
            # As long as all err nobody is too slow.
            if not best.problem and expected > best.total * (HOPELESS if cheap else MARGIN):
                about = f"it would take about {expected:.2f} s, {choice.NOT_COMPARED}"
                self._notes.append(f"{trial.spec}: left out, {about}")
                continue
            if not best.problem and spent + trial.build > BUDGET * best.total:
                self._notes.append(f"{trial.spec}: left out, trying it would cost more than it could save")
                continue
            yield f"{trial.spec}: building"
            start = clock()
            try:
                structure, build = check.timed_build(
                    self.native, self.workload, trial.spec, self.threads, self.memory_limit
                )
            except MemoryError as error:
                spent += clock() - start
                self._notes.append(f"{trial.spec}: left out, {error}")
                continue
            yield f"{trial.spec}: comparing and timing rays"
            self._measured(trial.spec, structure, build, sets, counted)
            spent += clock() - start
        self._decide(clock() - began)

    def _measured(self, spec: str, structure: Structure, build: float, sets: list[rays.RaySet], counted: Mix) -> None:
        """Keep what a full trial found, and of the structures only the best. Rays are timed on one thread, whose clock
        no other work disturbs; in a picture they share all threads.
        """
        assert self._reference is not None, "brute force was asked first"
        wrong, checked = self._reference.wrong(structure), len(self._reference)
        problem = f"{wrong:,} of {checked:,} answers are wrong" if wrong else ""
        if problem:
            self._notes.append(f"{spec}: left out, {problem}")
        speeds = {some.name: check.rate(structure, some, 1, REPEATS) for some in sets}
        trace = counted.seconds(speeds, self.plan) / (self.threads or os.cpu_count() or 1) if speeds else 0.0
        self._lines[spec] = Line(spec, build, trace, wrong, checked, problem)
        self._built[spec] = structure
        best = self._best().spec
        self._built = {best: self._built[best]}

    def _ranked(self) -> list[Line]:
        """What was tried in full: those whose answers are right, the best first, then the others."""
        return sorted(self._lines.values(), key=lambda line: (bool(line.problem), line.total))

    def _best(self) -> Line:
        return self._ranked()[0]

    def _affordable(self, counted: Mix) -> int:
        """How many rays may be compared with brute force, beside a picture like this."""
        pictured = self.plan.pixels * self.plan.samples * (counted.primary + counted.shadow + counted.secondary)
        tests = min(BRUTE_TESTS, BRUTE_TESTS_PER_RAY * pictured)
        return min(CHECKED, affordable(self.workload, tests=tests))

    def _trials(
        self, first: str, others: Sequence[str], clock: Callable[[], float]
    ) -> Generator[str, None, list[Trial]]:
        """Small trials of all, over a part of the scene; returns them without the first's."""
        count = len(self.workload.triangles)
        part = choice.subset(self.workload, TRIAL_TRIANGLES, seed=1)
        share = len(part.triangles)
        # A build over n triangles takes about n log n.
        grown = count * math.log2(count + 2) / (share * math.log2(share + 2))
        made: list[Trial] = []
        reference = scale = 1.0
        sets: list[rays.RaySet] = []
        began, limit = clock(), SMALL_BUDGET * self._lines[first].total
        for spec in (first, *others):
            if clock() - began > limit:
                self._notes.append(f"{spec}: not tried: this picture is too quick to be worth it")
                continue
            yield f"{spec}: trying it on {share:,} triangles"
            structure, build = check.timed_build(self.native, part, spec, self.threads)
            if spec == first:
                size = view_of(self.plan.pixels, TRIAL_SIZE)
                sets = [s for s in rays.make(part, structure, size=size, seed=1, names=choice.SETS) if len(s)]
            speeds = [check.rate(structure, some, 1) for some in sets]
            speed = 1 / float(np.mean([1 / value for value in speeds])) if speeds else 1.0
            build *= grown
            if spec == first:
                reference = speed
                scale = self._lines[first].build / max(build, 1e-9)
            else:
                made.append(Trial(spec, build * scale, speed / reference))
        return made

    def _expected(self, trial: Trial, first: str) -> float:
        """Build plus render that a small trial lets expect."""
        return trial.build + self._lines[first].trace / trial.speed

    def _decide(self, seconds: float) -> None:
        found = Comparison(self.plan, tuple(self._ranked()))
        best = self._best()
        if best.problem:
            told = "; ".join(f"{line.spec}: {line.problem}" for line in found.lines)
            raise RuntimeError(f"{found.reason()} {told}")
        own = seconds - best.build
        notes = [found.reason(), f"Choosing took {own:.2f} s beside that build.", *self.dropped, *self._notes]
        self.result = Choice(best.spec, self._built[best.spec], found, tuple(notes), seconds, own)


def choose(native: Native, workload: Workload, plan: Plan, catalogue: Catalogue, *, threads: int = 0) -> Choice:
    """The best structure for a picture, at one go."""
    chooser = Chooser(native, workload, plan, candidates(catalogue), threads, dropped=dropped(catalogue))
    for _ in chooser.steps():
        pass
    assert chooser.result is not None, "the last step decides"
    return chooser.result
