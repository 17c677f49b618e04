# SPDX-License-Identifier: GPL-3.0-or-later
"""Measurable claims of the papers: a table of claims, one file per paper, and the lab that measures them.

A paper is a module with a constant `CLAIMS`; add it to `table.PAPERS`. A claim is a published statement and a
function that measures it in one or two configurations, *faithful* (the paper's form and constants, see `published.py`)
and *best* (ours). Every outcome holds, does not hold, lies within the noise of its limit, or cannot be tested here, and
names the counters that explain it. Every time is reported with a check of the answers.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.measure import accuracy, counting, inference
from ...core.measure.accuracy import Answers, Errors
from ...core.measure.check import timed_build
from ...core.scene.rays import RaySet, blocks
from ...core.scene.workload import Workload, load_both
from ...core.structures.specs import structure_of
from ..stability.agreement import BRUTE_PAIRS
from ..stability.stability import allowed_to_fail

if TYPE_CHECKING:
    from ...core.base.interface import Native, Structure

HOLDS = "holds"
FAILS = "does not hold"
UNCLEAR = "within the noise"
UNTESTED = "cannot be tested here"
VERDICTS = (HOLDS, FAILS, UNCLEAR, UNTESTED)

VERSION = 5
"""Version of the measurements: increment when a claim measures or counts anything else; older results are then not
reused.
"""

CHECKED = {True: 8_000, False: 20_000}
"""Rays per configuration and scene whose answers are compared with brute force, in a quick run (True) and a full one;
BRUTE_PAIRS limits them in scenes of millions of triangles.
"""

REPEATS = {True: 6, False: 9}
"""Number of timed passes after a warm-up pass: in a quick run (True) and a full one. Six have an interval."""

BUILDS = {True: 3, False: 7}
"""Number of timed builds."""

LEAST_PASSES, PASS_SECONDS = 3, {True: 4, False: 10}
"""Number of timed passes, and processor seconds in a quick run (True) and a full one, after which no further round of
passes begins.
"""

MARGIN = 0.03
"""Least half-width of the interval of a ratio of times (chosen): separate runs of the same pair differ by as much,
which the passes of one run do not show.
"""

COUNTED = 1 << 22
"""Rays that are counted at once: eight times what any kernel takes at once, so that they are cut as those timed."""

BUILD_SECONDS = {True: 20, False: 60}
"""Processor seconds after which no further round of builds begins: the slowest build takes minutes."""


@dataclass(frozen=True)
class Chart:
    """Data of a plot: lines of (x, y) points by name. level: height and label of a dashed line."""

    title: str
    x: str
    y: str
    lines: Mapping[str, Sequence[tuple[float, float]]]
    bars: bool = False
    level: tuple[float, str] | None = None


@dataclass(frozen=True)
class Checked:
    """Answers of some configurations compared with brute force: how many there are, and how many differ, by kind.

    wrong_triangle: on another triangle. false_hits: false hits and misses. last_bits: on the right triangle, but other
    bits of t, u or v. noun: what was compared, where the kinds do not apply.
    """

    specs: tuple[str, ...] = ()
    count: int = 0
    wrong: int = 0
    wrong_triangle: int = 0
    false_hits: int = 0
    last_bits: int = 0
    noun: str = "answers"

    @classmethod
    def of(cls, specs: Iterable[str], errors: Iterable[Errors]) -> Checked:
        """The sum of these errors. A ray with several differences counts under the first kind."""
        one = accuracy.total(errors)
        false_hits = one.wrong - one.wrong_triangle - one.last_bits
        return cls(tuple(specs), one.rays, one.wrong, one.wrong_triangle, false_hits, one.last_bits)

    def __str__(self) -> str:
        """As text."""
        whole = f"{self.wrong:,} of {self.count:,} {self.noun} differ from brute force"
        if not self.wrong or self.noun != "answers":
            return whole if self.specs or self.count else ""
        return (
            f"{whole}: {self.wrong_triangle:,} on another triangle, {self.false_hits:,} false hits or misses, "
            f"{self.last_bits:,} in last bits only"
        )


@dataclass(frozen=True)
class Outcome:
    """Result of one configuration of a claim.

    configuration: "faithful" or "best". verdict: one of VERDICTS. measured: the result as text. why: the counters that
    explain it. values: the numbers, for JSON.
    """

    configuration: str
    verdict: str
    measured: str
    why: str = ""
    checked: Checked = Checked()
    values: Mapping[str, float] = field(default_factory=dict)
    charts: tuple[Chart, ...] = ()


@dataclass(frozen=True)
class Claim:
    """A measurable statement of a paper. scenes: names of the shared scenes it is measured on, if present."""

    id: str
    paper: str
    statement: str
    measure: Callable[[Lab], Iterable[Outcome]]
    scenes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Result:
    """A claim and its outcomes.

    wrong: number of checked answers that differ from brute force, see `Lab.wrong`. machine: name of the machine that
    measured it; empty for this one. seconds: processor seconds of the measurement.
    """

    claim: Claim
    outcomes: tuple[Outcome, ...]
    wrong: int = 0
    machine: str = ""
    seconds: float = 0.0

    @property
    def measured(self) -> bool:
        """Whether any outcome has a verdict or values; False if everything it needs is missing."""
        return any(outcome.verdict != UNTESTED or outcome.values for outcome in self.outcomes)

    def as_rows(self) -> Iterator[dict[str, Any]]:
        """One row per configuration, ready for JSON."""
        for outcome in self.outcomes:
            row = asdict(outcome)
            charts = [{**chart, "lines": {k: list(v) for k, v in chart["lines"].items()}} for chart in row["charts"]]
            about = {"claim": self.claim.id, "paper": self.claim.paper, "says": self.claim.statement}
            yield {**about, "machine": self.machine, **row, "error": str(outcome.checked), "charts": charts}


def outcome(row: Mapping[str, Any]) -> Outcome:
    """The outcome in a row of `Result.as_rows`, also after a round trip through JSON."""
    names = [one.name for one in fields(Outcome)]
    drawn = [
        {**chart, "lines": {name: [tuple(point) for point in line] for name, line in chart["lines"].items()}}
        for chart in row["charts"]
    ]
    checked = Checked(**{**row["checked"], "specs": tuple(row["checked"]["specs"])})
    charts = tuple(Chart(**chart) for chart in drawn)
    return Outcome(**{**{name: row[name] for name in names}, "checked": checked, "charts": charts})


@dataclass(frozen=True)
class Share:
    """A measured number with the interval in which its noise leaves it, most often a time relative to another's."""

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, value: float, rounds: Sequence[float] = ()) -> Share:
        """A number and its values in single rounds: the 95 % interval of their median, all of them where they are too
        few, and at least MARGIN to both sides.
        """
        ends = inference.interval(rounds) or (min(rounds, default=value), max(rounds, default=value))
        return cls(value, min(ends[0], value * (1 - MARGIN)), max(ends[1], value * (1 + MARGIN)))

    def below(self, limit: float = 1.0) -> str:
        """The verdict on a number that shall be at most the limit."""
        return HOLDS if self.high <= limit else FAILS if self.low > limit else UNCLEAR

    def above(self, limit: float = 1.0) -> str:
        """The verdict on a number that shall be at least the limit."""
        return HOLDS if self.low >= limit else FAILS if self.high < limit else UNCLEAR


@dataclass(frozen=True)
class Timing:
    """Median seconds of one structure on one ray set, and mean counters per ray. rounds: seconds of each pass."""

    rays: int
    seconds: float
    counters: Mapping[str, float]
    rounds: tuple[float, ...] = ()

    @property
    def nanoseconds(self) -> float:
        """Nanoseconds per ray."""
        return self.seconds / max(self.rays, 1) * 1e9

    def share(self, other: Timing) -> Share:
        """The time relative to another's, whose passes alternated with these."""
        rounds = [own / theirs for own, theirs in zip(self.rounds, other.rounds, strict=False)]
        return Share.of(self.seconds / other.seconds, rounds)


@dataclass(frozen=True)
class Builds:
    """Median build seconds by configuration. count: number of builds each median is taken over."""

    seconds: Mapping[str, float]
    count: int

    def share(self, own: str, other: str) -> Share:
        """The time of a build relative to another's."""
        return Share.of(self.seconds[own] / self.seconds[other])

    @property
    def method(self) -> str:
        """The kind of these seconds, as text."""
        return "one build each" if self.count == 1 else f"medians of {self.count} builds"


ROOM = 3 << 30
"""Bytes of structures kept for the next measurement; beyond that the oldest are dropped and rebuilt when needed."""


class Lab:
    """Builds, checks and times structures on one thread, and caches every measurement."""

    def __init__(self, native: Native, *, quick: bool, say: Callable[[str], None], scenes: Path | None = None) -> None:
        self.native = native
        self.scenes = scenes
        self.quick = quick
        self.say = say
        self.repeats, self.builds = REPEATS[quick], BUILDS[quick]
        self._ids = {row["id"] for row in native.structures()}
        self._structures: dict[tuple[str, str], Any] = {}
        self._timings: dict[tuple[str, str, str], Timing] = {}
        self._right: dict[tuple[str, str], Answers] = {}
        self._rays: dict[tuple[str, str], RaySet] = {}
        self._errors: dict[tuple[str, str, str], Errors] = {}
        self._used: set[tuple[str, str, str]] = set()
        self._scenes: dict[str, tuple[Workload, Workload]] = {}
        self._fingerprints: dict[str, str] = {}
        self._builds: dict[tuple[str, tuple[str, ...]], Builds] = {}

    def begin(self) -> None:
        """Start a claim: `wrong` counts the answers used from here on."""
        self._used.clear()

    def lacks(self, *specs: str) -> str:
        """A sentence that lists those of the structures that this build lacks; empty if it has all."""
        missing = [spec for spec in specs if structure_of(spec) not in self._ids]
        return f"this build has no {', '.join(missing)}" if missing else ""

    def shared(self, name: str, *, published: bool = False) -> Workload | None:
        """A shared scene, or the published part of it; None if its file is missing."""
        both = self._loaded(name)
        if both is None:
            self.say(f"{name} is left out: there is no such file")
            return None
        found = both[published]
        # Rename the published part: the caches identify a scene by its name.
        return replace(found, name=f"{name} as published") if found.notes else found

    def fingerprints(self, names: Iterable[str]) -> dict[str, str]:
        """Fingerprints of those shared scenes that exist, by name. Raises WorkloadError."""
        names = list(names)
        # Free the scenes of earlier claims: a claim lists all scenes that it uses.
        self._scenes = {name: both for name, both in self._scenes.items() if name in names}
        there = {name: both for name in names if (both := self._loaded(name)) is not None}
        for name in there.keys() - self._fingerprints.keys():
            self._fingerprints[name] = " ".join(sorted({one.fingerprint() for one in there[name]}))
        return {name: self._fingerprints[name] for name in there}

    def _loaded(self, name: str) -> tuple[Workload, Workload] | None:
        """A shared scene, whole and as published, read once; None if its file is missing."""
        if name not in self._scenes:
            path = None if self.scenes is None else self.scenes / f"{name}.npz"
            if path is None or not path.is_file():
                return None
            self._scenes[name] = load_both(path)
        return self._scenes[name]

    def build(self, workload: Workload, spec: str) -> Any:
        """The structure of a configuration, from the cache or built; drops the oldest structures beyond ROOM."""
        key = (workload.name, spec)
        if key not in self._structures:
            held = sum(known.statistics["bytes"] for known in self._structures.values())
            while self._structures and held > ROOM:
                oldest = next(iter(self._structures))
                held -= self._structures.pop(oldest).statistics["bytes"]
            self._structures[key] = self.native.build(workload.vertices, workload.triangles, spec, threads=1)
        return self._structures[key]

    def statistics(self, workload: Workload, spec: str) -> Mapping[str, Any]:
        """The statistics of the build."""
        statistics: Mapping[str, Any] = self.build(workload, spec).statistics
        return statistics

    def rays(self, workload: Workload, name: str, make: Callable[[], RaySet]) -> RaySet:
        """The scene's rays of this name, made once."""
        key = (workload.name, name)
        if key not in self._rays:
            self._rays[key] = make()
        return self._rays[key]

    def seconds(self, workload: Workload, specs: Sequence[str], rays: RaySet) -> dict[str, Timing]:
        """Median seconds of each structure on the rays, interleaved; answers are checked first.

        Times are processor times, which on one thread are independent of other load on the machine.
        """
        wanted = [spec for spec in specs if (workload.name, spec, rays.name) not in self._timings]
        if wanted:
            self.say(f"{workload.name}: {rays.name}: {', '.join(wanted)}")
        for spec in wanted:
            self.check(workload, spec, rays)
        self._used.update((workload.name, spec, rays.name) for spec in specs)
        # Time the structures in turns; the first round only warms up. All are held, whatever the cache drops.
        held = {spec: self.build(workload, spec) for spec in wanted}
        taken: dict[str, list[float]] = {spec: [] for spec in wanted}
        begun = time.process_time()
        for repeat in range(self.repeats + 1):
            for spec, structure in held.items():
                seconds = self._ask(structure, rays)
                if repeat:
                    taken[spec].append(seconds)
            if repeat >= LEAST_PASSES and time.process_time() - begun > PASS_SECONDS[self.quick]:
                break
        for spec, structure in held.items():
            counters = self._count(structure, rays)
            key = (workload.name, spec, rays.name)
            self._timings[key] = Timing(len(rays), float(np.median(taken[spec])), counters, tuple(taken[spec]))
        return {spec: self._timings[workload.name, spec, rays.name] for spec in specs}

    def counts(self, workload: Workload, spec: str, rays: RaySet) -> Timing:
        """The mean counters of a structure on the rays, without a time; its answers are checked first."""
        key = (workload.name, spec, f"{rays.name}, counted")
        if key not in self._timings:
            self.check(workload, spec, rays)
            self._timings[key] = Timing(len(rays), 0.0, self._count(self.build(workload, spec), rays))
        self._used.add((workload.name, spec, rays.name))
        return self._timings[key]

    def walks(self, workload: Workload, specs: Sequence[str], rays: RaySet) -> dict[str, Timing]:
        """Seconds of each structure's traversal alone: recorded, then replayed without triangle tests.

        Traversals are timed in chunks of rays, in turns; the fastest pass of each chunk counts, because slower ones
        were interrupted.
        """
        kind = f"{rays.name}, walks"
        wanted = [spec for spec in specs if (workload.name, spec, kind) not in self._timings]
        if wanted:
            self.say(f"{workload.name}: {kind}: {', '.join(wanted)}")
        recordings, passes = {}, {}
        for spec in wanted:
            self.check(workload, spec, rays)
            structure = self.build(workload, spec)
            recordings[spec] = structure.record(rays.origins, rays.directions, t_max=rays.t_max, any_hit=rays.any_hit)
            passes[spec] = [recordings[spec].replay()]
        begun = time.process_time()
        for repeat in range(self.repeats):
            for spec in wanted:
                passes[spec].append(recordings[spec].replay())
            if repeat >= LEAST_PASSES and time.process_time() - begun > PASS_SECONDS[self.quick]:
                break
        self._used.update((workload.name, spec, rays.name) for spec in specs)
        for spec in wanted:
            counters = {name: float(np.mean(column)) for name, column in recordings[spec].counters.items()}
            # Each half of the passes is an estimate of its own; single passes contain all interruptions.
            parts = (passes[spec], passes[spec][::2], passes[spec][1::2])
            best, *rounds = (float(np.min(part, axis=0).sum()) for part in parts)
            timing = Timing(len(rays), best, counters, tuple(rounds))
            self._timings[workload.name, spec, kind] = timing
        return {spec: self._timings[workload.name, spec, kind] for spec in specs}

    def build_seconds(self, workload: Workload, specs: Sequence[str]) -> Builds:
        """Median processor seconds of each build, on one thread, interleaved."""
        key = (workload.name, tuple(specs))
        if key not in self._builds:
            self.say(f"{workload.name}: builds: {', '.join(specs)}")
            taken: dict[str, list[float]] = {spec: [] for spec in specs}
            begun, rounds = time.process_time(), 0
            while not rounds or (rounds < self.builds and time.process_time() - begun < BUILD_SECONDS[self.quick]):
                for spec in specs:
                    taken[spec].append(timed_build(self.native, workload, spec, 1)[1])
                rounds += 1
            self._builds[key] = Builds({spec: float(np.median(own)) for spec, own in taken.items()}, rounds)
        return self._builds[key]

    def error(self, workload: Workload, specs: Iterable[str]) -> Checked:
        """The checked rays of these structures on this scene."""
        return self.errors([workload.name], specs)

    def errors(self, places: Iterable[str], specs: Iterable[str]) -> Checked:
        """The checked rays of these structures on several scenes, or test cases, by their names."""
        where, chosen = set(places), list(dict.fromkeys(specs))
        own = (errors for (place, spec, _), errors in self._errors.items() if place in where and spec in chosen)
        return Checked.of(chosen, own)

    def compared(self, where: str, spec: str, rays: str, errors: Errors) -> None:
        """Record answers that were compared with brute force. where: name of a scene or a test case."""
        self._errors[where, spec, rays] = errors
        self._used.add((where, spec, rays))

    def wrong(self) -> int:
        """Number of answers used by this claim that differ from brute force, except those of traversals
        known to fail.
        """
        return sum(self._errors[key].wrong for key in self._used if not allowed_to_fail(key[1]))

    def _ask(self, structure: Structure, rays: RaySet) -> float:
        ask = structure.occluded if rays.any_hit else structure.closest
        start = time.process_time()
        ask(rays.origins, rays.directions, **rays.options(1))
        return time.process_time() - start

    def _count(self, structure: Structure, rays: RaySet) -> dict[str, float]:
        sums: dict[str, float] = {}
        # The counters of tens of millions of rays would not fit the memory.
        for first in range(0, len(rays), COUNTED):
            part = rays.take(slice(first, first + COUNTED))
            for name, column in counting.counters(structure, part, 1).items():
                sums[name] = sums.get(name, 0.0) + float(np.sum(column, dtype=np.float64))
        return {name: total / len(rays) for name, total in sums.items()}

    def right(self, workload: Workload, rays: RaySet) -> tuple[RaySet, Answers]:
        """A sample of rays, and brute force's answers to them."""
        count = min(CHECKED[self.quick], BRUTE_PAIRS // max(len(workload.triangles), 1))
        some = rays.take(blocks(len(rays), count, seed=1))
        key = (workload.name, rays.name)
        if key not in self._right:
            brute = self.build(workload, "brute")
            self._right[key] = Answers.of(brute.closest(some.origins, some.directions, t_max=some.t_max, threads=0))
        return some, self._right[key]

    def check(self, workload: Workload, spec: str, rays: RaySet) -> None:
        """Compare a sample of rays with brute force, bit for bit."""
        some, right = self.right(workload, rays)
        structure = self.build(workload, spec)
        errors = accuracy.compare(right, *accuracy.traced(structure, some, 1), self.native.ulp_distance, bitwise=True)
        self.compared(workload.name, spec, rays.name, errors)


def measure(lab: Lab, claims: Iterable[Claim]) -> Iterator[Result]:
    """Measure claim by claim."""
    for claim in claims:
        lab.say(f"{claim.paper}: {claim.id}")
        lab.begin()
        begun = time.process_time()
        outcomes = tuple(claim.measure(lab))
        yield Result(claim, outcomes, lab.wrong(), seconds=time.process_time() - begun)


def verdict(*verdicts: str, holds: bool = True) -> str:
    """The verdict on a claim of several parts: it fails where one fails, and is unclear where one is."""
    if not holds:
        return FAILS
    return next((one for one in (FAILS, UNTESTED, UNCLEAR) if one in verdicts), HOLDS)


def slope(points: Iterable[tuple[float, float]]) -> float:
    """Slope of the least-squares line through (x, y) points."""
    x, y = np.array(list(points), np.float64).T
    return float(np.polyfit(x, y, 1)[0])
