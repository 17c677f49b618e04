# SPDX-License-Identifier: GPL-3.0-or-later
"""The best structure for a planned picture, by its build time and the time of all rays at the measured speeds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..base.notes import few
from ..measure import benchmark, yardstick
from ..measure.curve import Curve
from ..measure.rows import Bound, building
from ..scene.workload import Workload
from ..structures import ways

if TYPE_CHECKING:
    from ..base.interface import Native, Structure

SETS = ("primary", "shadow", "diffuse")
"""The ray sets whose speeds represent camera rays, shadow rays, and all other rays."""

NOT_COMPARED = "answers not compared"
"""Text next to a speed whose structure's answers were not checked."""

BOUNDS: tuple[Bound, ...] = ("med", "max", "min")
"""Keys of speeds, in the order of the times they give: predicted, smallest, largest."""

MIX_SAMPLES = 2
"""Samples per pixel of the small picture whose rays are counted."""


@dataclass(frozen=True)
class Plan:
    """A planned picture: number of pixels, samples per pixel, and largest number of bounces."""

    pixels: int
    samples: int
    max_bounces: int = 4


@dataclass(frozen=True)
class Mix:
    """Mean number of rays of each kind per camera sample. It depends on the scene alone, not on the structure."""

    primary: float
    shadow: float
    secondary: float

    def seconds(self, mrays_s: Mapping[str, float], plan: Plan) -> float:
        """Seconds for all rays of a picture at these speeds, keyed as in SETS; a missing set gets the
        speed of primary.
        """
        primary = mrays_s["primary"]
        shadow, diffuse = (mrays_s.get(name, primary) for name in ("shadow", "diffuse"))
        each = self.primary / primary + self.shadow / shadow + self.secondary / diffuse
        return plan.pixels * plan.samples * each / 1e6

    def bounds(self, rates: Mapping[str, Sequence[float]], plan: Plan, threads: int) -> tuple[float, float]:
        """Smallest and largest seconds of all rays of a picture on `threads` threads; 0 without rates.

        rates: million rays per second of repeated passes on one thread, by ray set.
        """
        if not rates:
            return 0.0, 0.0
        fast, slow = ({name: pick(some) for name, some in rates.items()} for pick in (max, min))
        return self.seconds(fast, plan) / threads, self.seconds(slow, plan) / threads


def mix(native: Native, structure: Structure, workload: Workload, size: tuple[int, int], max_bounces: int) -> Mix:
    """Count the rays of a small picture of the scene."""
    pictures = Curve(native, workload, size, (MIX_SAMPLES,), seed=1, max_bounces=max_bounces)
    return Mix(**pictures.rays_per_sample(structure, MIX_SAMPLES))


@dataclass(frozen=True)
class Line:
    """One configuration of a comparison. problem: the reason why it cannot be chosen, or "".

    build, trace: seconds for the planned picture. least, most: smallest and largest trace of the repeats; None if there
    was one. wrong: number of the `checked` answers that differ from the reference.
    """

    spec: str
    build: float = 0.0
    trace: float = 0.0
    wrong: int = 0
    checked: int = 0
    problem: str = ""
    least: float | None = None
    most: float | None = None

    @property
    def total(self) -> float:
        """Build plus render, in seconds."""
        return self.build + self.trace

    @property
    def times(self) -> str:
        """Build and render as text."""
        return f"{self.build:.2f} s to build and {self.trace:.2f} s to trace"

    @property
    def spread(self) -> tuple[float, float]:
        """Smallest and largest total of the repeats."""
        low, high = (self.trace if value is None else value for value in (self.least, self.most))
        return self.build + low, self.build + high

    @property
    def answers(self) -> str:
        """The number of wrong answers as text."""
        return f"{self.wrong:,} of {self.checked:,} answers wrong" if self.checked else NOT_COMPARED


@dataclass(frozen=True)
class Comparison:
    """Configurations for one plan, best first, those that cannot be chosen last."""

    plan: Plan
    lines: tuple[Line, ...]

    @property
    def sound(self) -> tuple[Line, ...]:
        """The configurations whose answers are correct."""
        return tuple(line for line in self.lines if not line.problem)

    @property
    def best(self) -> Line | None:
        """The sound configuration with the smallest build plus render time."""
        return min(self.sound, key=lambda line: line.total, default=None)

    @property
    def fastest(self) -> Line | None:
        """The sound configuration with the smallest render time, regardless of its build."""
        return min(self.sound, key=lambda line: line.trace, default=None)

    @property
    def equal(self) -> tuple[Line, ...]:
        """The sound configurations that the repeats do not separate from the best: their spreads overlap its own."""
        best = self.best
        return tuple(line for line in self.sound if best is not line and best and line.spread[0] <= best.spread[1])

    def of_trees(self, kept: str = "") -> Comparison:
        """The same with the best configuration of each tree only, and `kept` in any case."""
        found: dict[str, Line] = {}
        for line in self.lines:
            found.setdefault(line.spec if line.spec == kept else ways.tree_of(line.spec), line)
        return Comparison(self.plan, tuple(line for line in self.lines if line in found.values()))

    def reason(self) -> str:
        """The reason for the best configuration, in one sentence, and whether the repeats separate it from others."""
        return f"{self._reason()}{self._doubt()}"

    def answer(self, name: Callable[[str], str]) -> tuple[str, ...]:
        """The best configuration, its times beside those of the second, and the reason, as three lines; one line
        without a sound configuration. name: of a specification, for readers.
        """
        best = self.best
        if best is None:
            return (self._reason(),)
        others = sorted((line for line in self.sound if line is not best), key=lambda line: line.total)
        times = f"{_seconds(best.build)} to build and {_seconds(best.trace)} to trace"
        if not others:
            why = "Nothing else gave right answers." if len(self.lines) > 1 else "No other could have saved time."
            return f"{name(best.spec)}.", f"{times}.", why
        second = others[0]
        more = second.total / max(best.total, 1e-9) - 1
        by = f"{times}; {name(second.spec)} takes {more:.0%} longer."
        doubt = " Not certain: repeats overlap." if self.equal else ""
        return f"{name(best.spec)}.", by, f"{self._advantage(best)}{doubt}"

    def _advantage(self, best: Line) -> str:
        """Why the best is better than the others, in one sentence."""
        shortest = min(self.sound, key=lambda line: line.build) is best
        if best is self.fastest:
            return f"Its {'build is the shortest and its ' * shortest}rays are the fastest."
        if shortest:
            return "Its build is the shortest; faster rays would save less than they cost to build."
        return "Others have faster rays or a shorter build, but take longer for both together."

    def beside(self, other: Comparison, name: str) -> str:
        """Whether another comparison for the same plan agrees, in one sentence; "" for another plan.

        name: of the other comparison, for the sentence. Where the two contradict each other, neither best is certain.
        """
        best, theirs = self.best, other.best
        if other.plan != self.plan or best is None or theirs is None:
            return ""
        if theirs.spec == best.spec:
            return f"{name} found the same."
        if theirs.spec not in {line.spec for line in self.lines}:
            return f"{name} found {theirs.spec}, which was not measured here."
        separate = theirs.spec not in {line.spec for line in self.equal}
        if not separate or best.spec in {line.spec for line in other.equal}:
            return f"{name} found {theirs.spec}: the repeats do not tell which of the two is better."
        return f"{name} found {theirs.spec}: the two measurements contradict each other, so neither is certain."

    def _doubt(self) -> str:
        """A sentence on configurations that may be as good as the best; "" if there are none."""
        if not self.equal:
            return ""
        low, high = self.best.spread if self.best is not None else (0.0, 0.0)
        others = few([line.spec for line in self.equal])
        return f" This is not certain: its repeats took {low:.2f} to {high:.2f} s, and those of {others} overlap them."

    def _reason(self) -> str:
        best, samples = self.best, self.plan.samples
        picture = f"{self.plan.pixels:,} pixels of {samples:,} sample{'s' * (samples != 1)}"
        if best is None:
            return "No configuration gives right answers."
        if len(self.sound) == 1:
            others = "gave right answers" if len(self.lines) > 1 else "was tried over the whole scene"
            return f"{best.spec}: {best.times} for {picture}; nothing else {others}."
        second = min((line for line in self.sound if line is not best), key=lambda line: line.total)
        return f"{best.spec} finishes {picture} first: {best.times}. Then {second.spec}: {second.times}."


def _seconds(value: float) -> str:
    """A duration with two or three digits."""
    return f"{value:.2f} s" if value < 10 else f"{value:,.0f} s"


def compare(rows: Sequence[benchmark.Row], counted: Mix, plan: Plan) -> Comparison:
    """Order the rows of a benchmark by the predicted time of a planned picture."""
    lines = []
    for row in rows:
        if yardstick.is_foreign(row["spec"]):
            continue
        if row["error"] is not None:
            lines.append(Line(row["spec"], problem=row["error"]))
            continue
        # Predict the picture's time from the median speeds; a row without them cannot be chosen.
        speeds = {name: rays["mrays_s"] for name, rays in row["rays"].items() if rays["mrays_s"] is not None}
        if "primary" not in speeds:
            lines.append(Line(row["spec"], problem="no ray hits the scene"))
            continue
        errors = row["errors"]
        wrong = int(errors["wrong"])
        problem = ""
        if not benchmark.agrees(row):
            least = "" if wrong else "at least "  # wrong pixels have no number of rays
            wrong = max(wrong, 1)
            problem = f"{least}{wrong:,} of {errors['rays']:,} answers are wrong"
        trace, low, high = (
            counted.seconds({name: speed[key] for name, speed in speeds.items()}, plan) for key in BOUNDS
        )
        lines.append(Line(row["spec"], building(row), trace, wrong, errors["rays"], problem, low, high))
    lines.sort(key=lambda line: (bool(line.problem), line.total))
    return Comparison(plan, tuple(lines))


def subset(workload: Workload, count: int, seed: int) -> Workload:
    """The same scene with `count` of its triangles, chosen at random; the whole scene if it has no more."""
    if count >= len(workload.triangles):
        return workload
    rng = np.random.default_rng(seed)
    chosen = np.sort(rng.choice(len(workload.triangles), size=count, replace=False))
    return Workload(workload.name, workload.vertices, workload.triangles[chosen], workload.view)
