# SPDX-License-Identifier: GPL-3.0-or-later
"""Time to equal error: whole renders of both engines at several sample counts, against a converged picture.

The converged picture is the mean of one by each engine, so that neither is favoured where their means differ. An
engine's time is fitted as a constant, for reading the scene and building, and a part proportional to the samples; its
error as a power of the samples. The time to equal error is that of the number of samples at which the fits meet.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...core.base.arrays import F64

ENGINES = ("HALFSPACE", "CYCLES")

FIREFLY = 10.0
"""Multiple of the converged value, plus the mean of the picture, above which the excess of a pixel is a firefly."""


CONVERGED = 16
"""Samples of a converged picture of an engine, in multiples of the largest number that is timed."""


@dataclass(frozen=True)
class Point:
    """Renders with one number of samples: medians of seconds by the clock and of the processor; mean squared error;
    number of fireflies per million pixels.
    """

    samples: int
    clock: float
    processor: float
    error: float
    fireflies: float


@dataclass(frozen=True)
class Fit:
    """Seconds: `fixed` + `each` × samples. Mean squared error: `scale` / samples^`power`."""

    fixed: float
    each: float
    scale: float
    power: float

    def samples(self, error: float) -> float:
        """The number of samples with this mean squared error."""
        return float((self.scale / error) ** (1 / self.power))

    def seconds(self, samples: float) -> float:
        """The seconds that these samples take."""
        return self.fixed + self.each * samples


def fit(points: Sequence[Point], clock: str = "clock") -> Fit:
    """Fit times and errors of at least two numbers of samples. clock: "clock" or "processor".

    The times by least squares of relative residuals, the errors by least squares of logarithms. The constant and the
    part of a sample are at least 0, and the power at least 0.5, which is slower than any unbiased estimate converges.
    """
    n = np.array([point.samples for point in points], np.float64)
    seconds = np.array([getattr(point, clock) for point in points])
    weights = 1 / np.maximum(seconds, 1e-9)
    system = np.stack([np.ones_like(n), n], axis=1) * weights[:, None]
    fixed, each = np.linalg.lstsq(system, seconds * weights, rcond=None)[0]
    if fixed < 0:
        fixed, each = 0.0, float(np.mean(seconds / n))
    elif each < 0:
        fixed, each = weights.sum() / (weights**2).sum(), 0.0
    power, scale = np.polyfit(np.log(n), np.log([max(point.error, 1e-30) for point in points]), 1)
    power = max(-float(power), 0.5)
    scale = float(np.exp(np.mean(np.log([max(p.error, 1e-30) for p in points]) + power * np.log(n))))
    return Fit(float(fixed), float(each), scale, power)


@dataclass(frozen=True, eq=False)
class Result:
    """The measurements of one scene. means: of Halfspace's converged picture over those of Cycles, per channel.
    reference: the converged picture, (height, width, 3).
    """

    name: str
    points: dict[str, list[Point]]
    means: tuple[float, ...]
    reference: F64 = field(default_factory=lambda: np.zeros((0, 0, 3)))

    def equal_samples(self, clock: str = "processor") -> tuple[int, int]:
        """The numbers of samples with which Halfspace takes the time of Cycles' last point, and with which it reaches
        its error; at least 1, at most CONVERGED times Cycles' number.
        """
        ours, theirs = (fit(self.points[engine], clock) for engine in ENGINES)
        last = self.points["CYCLES"][-1].samples
        left = theirs.seconds(last) - ours.fixed
        in_time = left / ours.each if ours.each > 0 else math.inf
        in_error = ours.samples(theirs.scale / last**theirs.power)
        in_time, in_error = (min(max(count, 1.0), float(CONVERGED * last)) for count in (in_time, in_error))
        return round(in_time), round(in_error)

    def ratios(self, clock: str = "clock") -> tuple[float, float, float]:
        """Ratio of the times to the error of Cycles' last point: whole renders, and without their constant parts;
        ratio of the numbers of samples.
        """
        ours, theirs = (fit(self.points[engine], clock) for engine in ENGINES)
        # Both errors come from the fits, so that chance at a single point counts less.
        target = theirs.scale / self.points["CYCLES"][-1].samples ** theirs.power
        a, b = ours.samples(target), theirs.samples(target)
        whole = ours.seconds(a) / theirs.seconds(b)
        # Other work on the machine can hide what a sample takes.
        traced = ours.each * a / (theirs.each * b) if ours.each > 0 and theirs.each > 0 else math.nan
        return whole, traced, a / b

    @property
    def same(self) -> bool:
        """Whether the means agree within 1 %."""
        return all(abs(mean - 1) <= 0.01 for mean in self.means)

    def lines(self) -> list[str]:
        """The numbers as lines of text."""
        found = [
            f"{engine}: {p.samples} samples, {p.clock:.3f} s by the clock, {p.processor:.3f} s of the processor, "
            f"RMSE {math.sqrt(p.error):.5f}, {p.fireflies:.0f} fireflies per million pixels"
            for engine in ENGINES
            for p in self.points[engine]
        ]
        means = " ".join(f"{100 * (mean - 1):+.2f}" for mean in self.means)
        found.append(f"means differ by {means} %" + ("" if self.same else ": NOT the same"))
        for clock in ("clock", "processor"):
            whole, traced, samples = self.ratios(clock)
            found.append(
                f"time to equal error by the {clock}: whole × {whole:.2f}, without the constant part × {traced:.2f}, "
                f"samples × {samples:.2f}"
            )
        return found

    def row(self) -> str:
        """A row of the table of all scenes."""
        whole, traced, samples = self.ratios("processor")
        clock = self.ratios("clock")[0]
        fireflies = " / ".join(f"{self.points[engine][-1].fireflies:.0f}" for engine in ENGINES)
        means = max((abs(mean - 1) for mean in self.means), default=0.0)
        numbers = " | ".join(f"{ratio:.2f}" for ratio in (clock, whole, traced, samples))
        return f"| {self.name} | {numbers} | {fireflies} | {100 * means:.2f} |"


HEAD = (
    "| scene | by the clock | by the processor | without the constant part | samples | fireflies per million | "
    "means % |\n| --- | ---: | ---: | ---: | ---: | ---: | ---: |"
)
"""Head of the table of all scenes: ratios of Halfspace to Cycles, but for the last two columns."""


@dataclass
class _Runs:
    """Renders of one engine with one number of samples."""

    clock: list[float] = field(default_factory=list)
    processor: list[float] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    fireflies: list[float] = field(default_factory=list)


def measure(
    name: str, render: Callable[[str, int, int], F64], counts: Sequence[int], runs: int, converged: int
) -> Result:
    """Render and measure a scene.

    render: returns an engine's picture, (height, width, 3), of a number of samples and a seed, and is timed. counts:
    ascending numbers of samples. runs: renders of each. converged: samples of each engine's converged picture.
    """
    # Render the converged pictures with seeds of their own; they also warm both engines up.
    exact = {engine: render(engine, converged, 1000 + number) for number, engine in enumerate(ENGINES)}
    reference: F64 = np.mean(list(exact.values()), axis=0)
    limit = FIREFLY * (reference + reference.mean())
    ratio = exact["HALFSPACE"].mean(axis=(0, 1)) / np.maximum(exact["CYCLES"].mean(axis=(0, 1)), 1e-30)
    points: dict[str, list[Point]] = {engine: [] for engine in ENGINES}
    for samples in counts:
        found = {engine: _Runs() for engine in ENGINES}
        # Alternate the engines, so that other work on the machine slows down both.
        for seed in range(runs):
            for engine in ENGINES:
                worked, begun = time.process_time(), time.perf_counter()
                picture = render(engine, samples, seed + 1)
                of = found[engine]
                of.clock.append(time.perf_counter() - begun)
                of.processor.append(time.process_time() - worked)
                of.errors.append(float(((picture - reference) ** 2).mean()))
                of.fireflies.append(1e6 * float((picture > limit).any(axis=2).mean()))
        for engine, of in found.items():
            median: Any = np.median
            points[engine].append(
                Point(
                    samples,
                    float(median(of.clock)),
                    float(median(of.processor)),
                    float(np.mean(of.errors)),
                    float(np.mean(of.fireflies)),
                )
            )
    return Result(name, points, tuple(float(x) for x in ratio), reference)


def crop(reference: F64, pictures: Sequence[F64]) -> tuple[slice, slice]:
    """Rows and columns of the square, a quarter of the picture's height, where the relative squared errors of all
    pictures together are largest. Pictures are (height, width, 3).
    """
    error = sum(((one - reference) ** 2).mean(axis=2) for one in pictures)
    relative = error / (reference.mean(axis=2) ** 2 + 1e-4 * reference.mean() ** 2 + 1e-30)
    # Let no single pixel decide.
    relative = np.minimum(relative, np.percentile(relative, 99))
    side = max(min(reference.shape[:2]) // 4, 1)
    # Sum over all squares by differences of a summed-area table.
    table = np.pad(relative.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    sums = table[side:, side:] - table[:-side, side:] - table[side:, :-side] + table[:-side, :-side]
    row, column = np.unravel_index(int(sums.argmax()), sums.shape)
    return slice(int(row), int(row) + side), slice(int(column), int(column) + side)
