# SPDX-License-Identifier: GPL-3.0-or-later
"""Automatic choice of a structure for a scene and a sample count: small trials of all candidates first, then full
trials of those whose possible gain exceeds the cost of the trial.
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
from ..structures import presets, specs, ways
from ..structures.catalogue import Catalogue
from . import choice
from .choice import Comparison, Line, Mix, Plan

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..base.interface import Native, Structure

TREES = (
    "bvh-sah",
    "bvh-hlbvh",
    "kd",
    "bih-sah",
    "octree-net",
    "bsp-wn-plus-kd:k=4,alpha=0.5",
    "bsp-wn-plus-kd:k=6,alpha=0.1",
    "bsp-wn-plus-kd:k=6,alpha=0.5",
    "bsp-cn-plus-kd:k=6,alpha=0.5",
    "rbsp-kd:k=5",
)
"""Trees to try: one of each kind, and the best of the sources' structures with few and with more directions. Each is
tried with the quickest rays through each kind of its nodes.
"""

QUICK, FEW_SAMPLES = "bvh-hlbvh", 2
"""The tree that is built in the shortest time, and the camera samples per triangle below which it is built first.
Measured on one thread: its slower rays use up what its build saves against `bvh-sah` after 0.5 to 3.5 samples per
triangle of Conference; on the Stanford bunny they are not slower.
"""

SMALL = "bvh-sah", "bih-sah"
"""Trees whose builds take the least memory. Measured on the Stanford bunny, bytes per triangle at the peak of the build
and of the tree: `bih-sah` 136 and 23, `bvh-sah` 136 and 54, `bvh-hlbvh` 257 and 56, `kd` 393 and 95.
"""

SIZE, TRIAL_SIZE = (480, 320), (192, 128)
"""Width and height of the view whose rays are timed, for the whole scene and for a part of it. With fewer pixels,
neighbouring rays are less coherent than in most pictures, and the ranking of the structures changes.
"""

LEAST_RAYS, SHARE = 192 * 128, 64
"""Number of rays of the whole scene that are timed at least, and camera samples of the picture per timed ray beyond
that. The rays lie in dense blocks; timing all of them would take longer than a picture with few samples.
"""

TRIAL_TRIANGLES = 4096
"""Number of randomly chosen triangles in the scene of a small trial."""

MARGIN = 1.15
"""Assumed error of small trials: a candidate predicted slower than the best by less than this factor
gets a full trial.
"""

CHEAP, HOPELESS = 0.08, 4.0
"""Rule for cheap builds: a candidate whose build takes at most the share CHEAP of the best total time gets a full trial
unless it was predicted slower than the best by the factor HOPELESS. A part of a scene predicts the whole poorly.
"""

REPEATS = 3
"""Number of timed passes; the fastest counts, because other load on the machine only adds time."""

CHECKED = 1024
"""Largest number of rays per full trial that are compared with brute force."""

BRUTE_TESTS_PER_RAY = 10
"""Triangle tests that brute force may spend per ray of the picture: about a tenth of the picture's own time."""

SMALL_BUDGET = 0.05
"""Share of the best total time that the small trials may take; the remaining candidates are skipped."""

BUDGET = 0.2
"""Share of the best total time that all full trials together may take, which bounds the cost of choosing."""


def view_of(pixels: int, most: tuple[int, int] = SIZE) -> tuple[int, int]:
    """Width and height of a view with at most `pixels` pixels, in whole tiles. most: its size when
    `pixels` is larger.
    """
    share = math.sqrt(min(1.0, pixels / math.prod(most)))
    width, height = (max(rays.TILE, int(side * share) // rays.TILE * rays.TILE) for side in most)
    return width, height


def rows_of(size: tuple[int, int], wanted: int) -> NDArray[np.int64]:
    """Rows of tiles with at least `wanted` pixels, evenly spaced over a view of this size; all if it has no more."""
    every = size[1] // rays.TILE
    count = min(-(-wanted // (size[0] * rays.TILE)), every)
    return ((np.arange(count) + 0.5) * every / count).astype(np.int64)


def candidates(catalogue: Catalogue) -> list[str]:
    """The configurations to try: the quickest of those of TREES that this catalogue contains."""
    known = [(catalogue.get(specs.structure_of(tree)), tree) for tree in TREES if _problem(catalogue, tree) is None]
    return [spec for structure, tree in known if structure is not None for spec in ways.fastest(structure, tree)]


def dropped(catalogue: Catalogue) -> list[str]:
    """One line for each of TREES that this catalogue lacks, with the reason."""
    problems = ((tree, _problem(catalogue, tree)) for tree in TREES)
    return [f"{tree}: left out, {problem}" for tree, problem in problems if problem is not None]


def _problem(catalogue: Catalogue, spec: str) -> str | None:
    try:
        presets.settings(catalogue, spec)
    except specs.SpecError as error:
        return str(error)
    return None


@dataclass(frozen=True)
class Choice:
    """Result of a choice. spec: the configuration to use. structure: built over the whole scene. comparison: all full
    trials. notes: the reasons for and against each candidate. left_out: the candidates without a full trial, by the
    reason. dropped: those that the catalogue lacks, one per line.

    seconds: total time of choosing; own: the same without the build of the chosen structure, which is not wasted.
    """

    spec: str
    structure: Structure
    comparison: Comparison
    notes: tuple[str, ...]
    seconds: float
    own: float
    left_out: dict[str, list[str]] = field(default_factory=dict)
    dropped: tuple[str, ...] = ()


@dataclass
class Chooser:
    """One choice, run step by step so that a caller can show progress and cancel.

    memory_limit: bytes that each build over the whole scene may use, None for the native module's limit.
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
    _left_out: dict[str, list[str]] = field(default_factory=dict)
    _lines: dict[str, Line] = field(default_factory=dict)
    _built: dict[str, Structure] = field(default_factory=dict)

    def steps(self) -> Iterator[str]:
        """Run the choice; yields the text of the next step, and sets `result` in the last one.

        Raises the exceptions of builds, and RuntimeError when no structure answers correctly.
        """
        # Build the first candidate; its rays and its time are the yardstick for all others.
        clock = time.process_time if self.threads == 1 else time.perf_counter
        began = clock()
        first, structure, build, others = yield from self._first()
        size = view_of(self.plan.pixels)
        wanted = max(LEAST_RAYS, self.plan.pixels * self.plan.samples // SHARE)
        rows = rows_of(size, wanted)
        sets = rays.make(self.workload, structure, size=size, seed=1, names=choice.SETS, rows=rows)
        sets = [some.take(rays.blocks(len(some), wanted, seed=1)) for some in sets if len(some)]
        # Count the rays of a small picture: the mix weights the measured speeds of the ray sets.
        yield "counting the rays of a small picture"
        counted = choice.mix(self.native, structure, self.workload, SIZE, self.plan.max_bounces)
        yield "tracing the sample with brute force"
        compared = self._affordable(counted)
        self._reference = Reference(self.native, self.workload, sets, compared, seed=1, threads=self.threads)
        yield f"{first}: comparing and timing rays"
        self._measured(first, structure, build, sets, counted)
        trials = yield from self._trials(first, others, clock)
        # Run full trials in the order of the predicted total time, within the budget.
        spent = 0.0
        for trial in sorted(trials, key=lambda trial: trial.total):
            best = self._best()
            cheap = trial.build <= CHEAP * best.total
            # While every tried structure is wrong, no candidate is too slow or too expensive.
            if not best.problem and trial.total > best.total * (HOPELESS if cheap else MARGIN):
                self._leave_out(trial.spec, f"left out, about {trial.times}, {choice.NOT_COMPARED}")
                continue
            # The best is built already: another one must build and trace in less time than the best traces.
            late = not cheap and trial.build + trial.trace / MARGIN > best.trace
            if not best.problem and (late or spent + trial.build > BUDGET * best.total):
                self._leave_out(trial.spec, "left out, a full trial would take longer than it could save")
                continue
            # Build and measure the candidate; one that does not fit into memory is left out.
            yield f"{trial.spec}: building"
            start = clock()
            try:
                structure, build = self._build(trial.spec)
            except MemoryError as error:
                spent += clock() - start
                self._leave_out(trial.spec, f"left out, {error}")
                continue
            yield f"{trial.spec}: comparing and timing rays"
            self._measured(trial.spec, structure, build, sets, counted)
            spent += clock() - start
        self._decide(clock() - began, trials)

    def _build(self, spec: str) -> tuple[Structure, float]:
        """A structure over the whole scene and its build time. Raises the build's exceptions."""
        return check.timed_build(self.native, self.workload, spec, self.threads, self.memory_limit)

    def _first(self) -> Generator[str, None, tuple[str, Structure, float, list[str]]]:
        """Build the first candidate that fits into memory; returns it with its build time, and the others.

        A picture of few samples begins with QUICK. Once a candidate does not fit, those of SMALL are next. Raises
        MemoryError if none fits.
        """
        few = self.plan.pixels * self.plan.samples < FEW_SAMPLES * len(self.workload.triangles)
        waiting = sorted(self.specs, key=lambda spec: spec != QUICK) if few else list(self.specs)
        while True:
            spec = waiting.pop(0)
            yield f"{spec}: building"
            try:
                structure, build = self._build(spec)
            except MemoryError as error:
                if not waiting:
                    raise
                waiting.sort(key=lambda spec: spec not in SMALL)
                self._leave_out(spec, f"left out, {error}")
            else:
                return spec, structure, build, waiting

    def _leave_out(self, spec: str, reason: str) -> None:
        """Record why a candidate has no full trial; those of one reason share a note."""
        self._left_out.setdefault(reason, []).append(spec)

    def _measured(self, spec: str, structure: Structure, build: float, sets: list[rays.RaySet], counted: Mix) -> None:
        """Record the result of a full trial, and keep only the best structure built so far.

        Rays are timed on one thread, whose processor clock other load does not disturb; the picture's time is that
        divided by its number of threads.
        """
        assert self._reference is not None, "brute force traces first"
        wrong, checked = self._reference.wrong(structure), len(self._reference)
        problem = f"{wrong:,} of {checked:,} answers are wrong" if wrong else ""
        if problem:
            self._leave_out(spec, f"left out, {problem}")
        speeds = {some.name: check.rates(structure, some, 1, REPEATS) for some in sets}
        least, most = counted.bounds(speeds, self.plan, self.threads or os.cpu_count() or 1)
        self._lines[spec] = Line(spec, build, least, wrong, checked, problem, least, most)
        self._built[spec] = structure
        best = self._best().spec
        self._built = {best: self._built[best]}

    def _ranked(self) -> list[Line]:
        """The full trials, correct ones first, in the order of the predicted total time."""
        return sorted(self._lines.values(), key=lambda line: (bool(line.problem), line.total))

    def _best(self) -> Line:
        return self._ranked()[0]

    def _affordable(self, counted: Mix) -> int:
        """The number of rays to compare with brute force, in proportion to the cost of the picture."""
        pictured = self.plan.pixels * self.plan.samples * (counted.primary + counted.shadow + counted.secondary)
        tests = min(BRUTE_TESTS, BRUTE_TESTS_PER_RAY * pictured)
        return min(CHECKED, affordable(self.workload, tests=tests))

    def _trials(
        self, first: str, others: Sequence[str], clock: Callable[[], float]
    ) -> Generator[str, None, list[Line]]:
        """Run a small trial of every candidate on a random part of the scene; returns the predictions for the whole
        scene without the first's.
        """
        count = len(self.workload.triangles)
        part = choice.subset(self.workload, TRIAL_TRIANGLES, seed=1)
        share = len(part.triangles)
        # Scale build times from the part to the whole scene: a build over n triangles takes about n log n.
        grown = count * math.log2(count + 2) / (share * math.log2(share + 2))
        made: list[Line] = []
        reference = scale = 1.0
        sets: list[rays.RaySet] = []
        began, limit = clock(), SMALL_BUDGET * self._lines[first].total
        # Time each candidate on the part, relative to the first, whose times over the whole scene are known. One is
        # tried in any case, to have a second. After a wrong first, nothing is too slow.
        for spec in (first, *others):
            if made and not self._lines[first].problem and clock() - began > limit:
                self._leave_out(spec, "not tried, because a trial would take too long for this picture")
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
                made.append(Line(spec, build * scale, self._lines[first].trace * reference / speed))
        return made

    def _decide(self, seconds: float, trials: Sequence[Line]) -> None:
        """Set `result` from the full trials. Raises RuntimeError when no structure answers correctly."""
        found = Comparison(self.plan, tuple(self._ranked()))
        best = self._best()
        if best.problem:
            told = "; ".join(f"{line.spec}: {line.problem}" for line in found.lines)
            raise RuntimeError(f"{found.reason()} {told}")
        own = seconds - best.build
        # Without another full trial, the second is the best prediction.
        reason = found.reason()
        if len(found.lines) == 1 and trials:
            second = min(trials, key=lambda trial: trial.total)
            reason += f" Then, predicted from a part of the scene, {second.spec}: {second.times}."
        left_out = (f"{', '.join(specs)}: {why}" for why, specs in self._left_out.items())
        notes = [reason, f"Choosing took {own:.2f} s in addition to that build.", *self.dropped, *left_out]
        self.result = Choice(
            best.spec, self._built[best.spec], found, tuple(notes), seconds, own, self._left_out, tuple(self.dropped)
        )


def choose(native: Native, workload: Workload, plan: Plan, catalogue: Catalogue, *, threads: int = 0) -> Choice:
    """The best structure for a picture, chosen without intermediate steps."""
    chooser = Chooser(native, workload, plan, candidates(catalogue), threads, dropped=dropped(catalogue))
    for _ in chooser.steps():
        pass
    assert chooser.result is not None, "the last step decides"
    return chooser.result
