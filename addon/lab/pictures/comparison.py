# SPDX-License-Identifier: GPL-3.0-or-later
"""Statistical comparison of two renderers' pictures of one scene: do they differ by more than their noise?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from ...core.base.arrays import F32, F64
from ...core.measure import inference

BLOCK = 8
"""Side of the compared squares, in pixels."""

LIMIT = 4.0
"""Difference in standard errors above which two squares count as different; 6 in 100,000 exceed it by chance."""


class ComparisonError(ValueError):
    """The pictures cannot be compared. The message gives the reason."""


@dataclass(frozen=True, eq=False)
class Runs:
    """Independent pictures of one scene by one renderer, which differ only in their random numbers.

    pictures: (runs, height, width, 3) float32, scene linear, rows from the bottom; at least two runs. Raises
    ComparisonError.
    """

    name: str
    pictures: F32

    def __post_init__(self) -> None:
        if self.pictures.ndim != 4 or self.pictures.shape[3] != 3 or len(self.pictures) < 2:
            raise ComparisonError(f"{self.name}: expected at least 2 pictures of 3 channels, got {self.pictures.shape}")
        if bad := int(np.count_nonzero(~np.isfinite(self.pictures))):
            raise ComparisonError(f"{self.name}: {bad} values are not finite")

    @property
    def mean(self) -> F64:
        """The mean of all runs: (height, width, 3)."""
        return self.pictures.mean(axis=0, dtype=np.float64)

    @property
    def variance(self) -> F64:
        """The variance of `mean` for each value, estimated from the differences between the runs."""
        return self.pictures.var(axis=0, ddof=1, dtype=np.float64) / len(self.pictures)


@dataclass(frozen=True, eq=False)
class Comparison:
    """Differences between two renderers' pictures.

    ratio: mean of the first over mean of the second, per channel; nan if the second is black. ratio_median: median of
    that ratio over the squares' brightness, which no single bright pixel can move. rmse: over all values, scene linear;
    rmse_noise: the part of it that the noise of both explains. blocks: number of squares compared; differing: the share
    of them that differ by more than LIMIT standard errors in brightness. scores: (rows, columns), the difference of
    each square in standard errors, from the bottom.
    """

    ratio: tuple[float, float, float]
    ratio_median: float
    rmse: float
    rmse_noise: float
    blocks: int
    differing: float
    scores: F64

    def lines(self) -> list[str]:
        """The numbers as lines of text."""
        red, green, blue = self.ratio
        share = f"{100 * self.differing:.3f} % of {self.blocks:,}"
        return [
            f"mean ratio, red green blue: {red:.4f} {green:.4f} {blue:.4f}; median square: {self.ratio_median:.4f}",
            f"root mean square difference: {self.rmse:.5f}, of which noise explains {self.rmse_noise:.5f}",
            f"{BLOCK} × {BLOCK} pixel squares beyond {LIMIT:g} standard errors: {share} (by chance 0.006 %)",
        ]


def compare(first: Runs, second: Runs) -> Comparison:
    """Compare two renderers relative to the noise between their own runs.

    The standard error of a square is computed from those of its pixels under the assumption that they are independent;
    blue noise, which anti-correlates errors, only makes the test more lenient. Where neither picture has noise, any
    difference beyond rounding (1e-4 of the brightness) counts. Raises ComparisonError.
    """
    if first.pictures.shape[1:] != second.pictures.shape[1:]:
        raise ComparisonError(f"the pictures have sizes {first.pictures.shape[1:3]} and {second.pictures.shape[1:3]}")
    a, b = first.mean, second.mean
    variance = first.variance + second.variance
    # Compare the means of the whole pictures.
    totals = b.sum(axis=(0, 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        red, green, blue = np.where(totals > 0, a.sum(axis=(0, 1)) / totals, np.nan)
    # Compare the brightness of squares.
    difference = _blocks(a - b).mean(axis=(1, 3)).mean(axis=-1)
    # The channels of a pixel share their random numbers, so the standard errors add up, not the variances.
    error = np.sqrt(_blocks(variance)).mean(axis=-1)
    error = np.sqrt((error**2).sum(axis=(1, 3))) / BLOCK**2
    brightness = _blocks(b).mean(axis=(1, 3, 4))
    lit = brightness > 0
    scores = difference / np.maximum(error, 1e-4 * brightness / LIMIT + 1e-9)
    return Comparison(
        ratio=(float(red), float(green), float(blue)),
        ratio_median=float(np.median(1 + difference[lit] / brightness[lit])) if lit.any() else math.nan,
        rmse=float(np.sqrt(((a - b) ** 2).mean())),
        rmse_noise=float(np.sqrt(variance.mean())),
        blocks=scores.size,
        differing=float((np.abs(scores) > LIMIT).mean()),
        scores=scores,
    )


def _blocks(picture: F64, side: int = BLOCK) -> F64:
    """(rows, side, columns, side, channels) view of the picture's whole squares; incomplete ones at the border are
    dropped.
    """
    height, width = (size // side for size in picture.shape[:2])
    if not height or not width:
        raise ComparisonError(f"the pictures are smaller than {side} × {side} pixels")
    return picture[: height * side, : width * side].reshape(height, side, width, side, -1)


VERDICT_BLOCK = 16
"""Side of the squares of a verdict, in pixels."""

MOST_MEAN = 0.01
"""Allowed relative difference of a channel's mean between two engines, whose models differ."""

ROUNDING = 2e-3
"""Share of a square's brightness allowed for rounding in tables and filters."""

ALARM = 0.01
"""Probability of a verdict against pictures that differ by noise only."""

BINS = 10
"""Bins of the histogram of p."""


@dataclass(frozen=True)
class Verdict:
    """Whether two renderers' pictures are equal up to noise, by Welch's test of each square (Jung, Hanika, Dachsbacher
    2020, "Detecting bias in Monte Carlo renderers using Welch's t-test").

    means: relative difference of each channel's mean. tests: number of squares. alarms: probabilities of what was found
    if only noise differed, the least of all channels for each test: of the mean, of the square with the least p (Šidák
    1967), and of the distribution of p over all squares (one-sided Kolmogorov and Smirnov). histogram: number of
    squares in equal bins of p, of the channel with the least probability of the last test; level without a difference.
    worst: the largest difference of a square, in standard errors of noise and rounding. noise: ratio of the variances
    of the two renderers' pictures.
    """

    means: tuple[float, ...]
    tests: int
    alarms: dict[str, float]
    histogram: tuple[int, ...]
    worst: float
    noise: float

    @property
    def limit(self) -> float:
        """The probability below which a test raises the alarm: ALARM divided by the number of tests and channels."""
        return ALARM / (len(self.alarms) * len(self.means))

    @property
    def same(self) -> bool:
        """Whether no test raises the alarm."""
        return all(probability >= self.limit for probability in self.alarms.values())

    def lines(self) -> list[str]:
        """The numbers as lines of text."""
        means = " ".join(f"{100 * mean:+.3f}" for mean in self.means)
        found = ", ".join(f"{name} {probability:.2g}" for name, probability in self.alarms.items())
        return [
            f"means differ by {means} %",
            f"p of {self.tests:,} squares of {VERDICT_BLOCK} × {VERDICT_BLOCK} pixels from 0 to 1: "
            + " ".join(map(str, self.histogram)),
            f"worst square: {self.worst:.2f} standard errors",
            f"probability by noise alone: {found} (at least {self.limit:.2g})",
            "the same up to noise" if self.same else "NOT the same",
        ]


def judge(first: Runs, second: Runs, *, tolerance: float = ROUNDING, of_mean: float = MOST_MEAN) -> Verdict:
    """Decide whether two renderers' pictures are equal up to noise. Raises ComparisonError.

    tolerance, of_mean: share of a square's brightness and of the mean by which pictures may differ apart from noise,
    for rounding in tables and filters. With both 0, any bias raises the alarm once it exceeds its noise.
    """
    if first.pictures.shape[1:] != second.pictures.shape[1:]:
        raise ComparisonError(f"the pictures have sizes {first.pictures.shape[1:3]} and {second.pictures.shape[1:3]}")
    a, b = first.mean, second.mean
    totals = b.sum(axis=(0, 1))
    means = tuple(float(x) for x in np.where(totals > 0, a.sum(axis=(0, 1)) / np.maximum(totals, 1e-30) - 1, 0.0))
    # Test each square and channel, and each channel of the whole picture.
    side = VERDICT_BLOCK
    brightness = np.maximum(_blocks(b, side).mean(axis=(1, 3)), 1e-3 * b.mean())
    squares, scores = _welch(first, second, side, tolerance * brightness)
    wholes = _welch_of_means(first, second, of_mean)
    least = -np.expm1(len(squares) * np.log1p(-np.minimum(squares.min(axis=0), 1 - 1e-16)))
    surplus = np.array([_surplus(squares[:, channel]) for channel in range(a.shape[2])])
    shown = int(surplus.argmin())
    counts, _ = np.histogram(squares[:, shown], BINS, (0.0, 1.0))
    noise = float(first.variance.mean() * len(first.pictures)) / max(
        float(second.variance.mean() * len(second.pictures)), 1e-30
    )
    alarms = {"mean": float(wholes.min()), "one square": float(least.min()), "all squares": float(surplus.min())}
    return Verdict(means, len(squares), alarms, tuple(int(n) for n in counts), float(scores.max()), noise)


def _welch(first: Runs, second: Runs, side: int, allowed: F64) -> tuple[F64, F64]:
    """(squares, channels) p of Welch's test of each square, and its difference in standard errors of noise and
    rounding.

    The variance of a square is the sum of those of its pixels, which have independent random numbers, and its degrees
    of freedom follow from theirs (Satterthwaite 1946). allowed: difference that needs no noise to explain it.
    """
    difference = np.abs(_blocks(first.mean - second.mean, side).mean(axis=(1, 3)))
    square, fourth = np.zeros_like(difference), np.zeros_like(difference)
    for one in (first, second):
        square += _blocks(one.variance, side).sum(axis=(1, 3))
        fourth += _blocks(one.variance**2, side).sum(axis=(1, 3)) / (len(one.pictures) - 1)
    found = _probability(np.maximum(difference - allowed, 0.0) * side**2, square, fourth)
    scores = difference / np.hypot(np.sqrt(square) / side**2, allowed / LIMIT + 1e-12)
    return found.reshape(-1, 3), scores.reshape(-1, 3)


def _welch_of_means(first: Runs, second: Runs, tolerance: float) -> F64:
    """(channels,) p of Welch's test of the means of the whole pictures, by the variances of their pixels."""
    square, fourth = np.zeros(3), np.zeros(3)
    for one in (first, second):
        square += one.variance.sum(axis=(0, 1))
        fourth += (one.variance**2).sum(axis=(0, 1)) / (len(one.pictures) - 1)
    expected = second.mean.sum(axis=(0, 1))
    difference = np.abs(first.mean.sum(axis=(0, 1)) - expected) - tolerance * np.abs(expected)
    return _probability(np.maximum(difference, 0.0), square, fourth)


def _probability(difference: F64, square: F64, fourth: F64) -> F64:
    """Two-sided p of differences whose variances are `square`, and the sums of their parts squared over their degrees
    of freedom `fourth`. Without noise any difference beyond rounding is impossible.
    """
    noisy = square > 1e-24
    safe = np.where(noisy, square, 1.0)
    freedom = np.where(noisy, safe**2 / np.maximum(fourth, 1e-300), 1.0)
    found = inference.two_sided(difference / np.sqrt(safe), freedom)
    return np.where(noisy, found, np.where(difference > 1e-6, 0.0, 1.0))


def _surplus(p: F64) -> float:
    """The p-value of the one-sided test of Kolmogorov and Smirnov against a uniform distribution: the asymptotic
    probability of the largest excess of the empirical distribution over it.
    """
    ordered = np.sort(p)
    excess = float((np.arange(1, len(p) + 1) / len(p) - ordered).max())
    return math.exp(-2 * len(p) * max(excess, 0.0) ** 2)


@dataclass(frozen=True)
class Noise:
    """Noise of a renderer's pictures, of which several were rendered, in units of their squared mean brightness.

    variance: expectation of the mean squared error of a picture; spread: its standard deviation over the pictures
    (Celarek et al. 2019). spectrum: power of the error from low to high frequencies, 1 for white noise. seconds: to
    render pictures until their variance is 1 (inverse of the efficiency); low, high: its 95 % interval.
    """

    variance: float
    spread: float
    spectrum: tuple[float, ...]
    seconds: float
    low: float
    high: float

    def lines(self, name: str) -> list[str]:
        """The numbers as lines of text."""
        spectrum = " ".join(f"{power:.2f}" for power in self.spectrum)
        share = 100 * inference.half_width(self.low, self.high)
        return [
            f"{name}: time to unit variance {self.seconds:.4g} s ± {share:.1f} % ({self.low:.4g} to {self.high:.4g})",
            f"{name}: mean squared error of a picture {self.variance:.4g} ± {self.spread:.2g}, spectrum {spectrum}",
        ]


LEAST_RUNS = 3
"""Smallest number of pictures whose variance has an interval."""

BANDS = 4
"""Bands of frequencies of an error spectrum, of equal width."""


def noise_of(runs: Runs, seconds: Sequence[float]) -> Noise:
    """The noise and efficiency of pictures. seconds: that renders took which were made with the same settings.

    The interval is that of the logarithms, by the jackknife over the pictures and the variance of the seconds. Raises
    ComparisonError for fewer than LEAST_RUNS pictures.
    """
    if len(runs.pictures) < LEAST_RUNS:
        raise ComparisonError(f"{runs.name}: expected at least {LEAST_RUNS} pictures, got {len(runs.pictures)}")
    count, mean = len(runs.pictures), runs.mean
    scale = max(float(mean.mean()) ** 2, 1e-30)
    squares = np.array([float(((picture - mean) ** 2).mean()) for picture in runs.pictures]) / scale
    # The mean contains the picture itself, which makes its square smaller.
    errors = squares * count / (count - 1)
    variance = float(errors.mean())
    # Leave out each picture in turn: its share of the sum of squares about the mean goes with it.
    left = (squares.sum() - squares * count / (count - 1)) / (count - 2)
    logs = np.log(np.maximum(left, 1e-300))
    of_variance = math.sqrt((count - 1) / count * float(((logs - logs.mean()) ** 2).sum()))
    taken = np.asarray(seconds, np.float64)
    time, of_time = float(taken.mean()), float(taken.std(ddof=1) / taken.mean() / math.sqrt(len(taken)))
    reach = inference.student_quantile(inference.CONFIDENCE, min(count, len(taken)) - 1)
    half = math.exp(reach * math.hypot(of_variance, of_time))
    product = time * variance
    return Noise(variance, float(errors.std(ddof=1)), _spectrum(runs), product, product / half, product * half)


def _spectrum(runs: Runs) -> tuple[float, ...]:
    """Mean power of the errors of the brightness in bands of frequencies, relative to that of all."""
    mean = runs.mean.mean(axis=2)
    power = np.zeros(mean.shape)
    for picture in runs.pictures:
        power += np.abs(np.fft.fft2(picture.mean(axis=2) - mean)) ** 2
    power[0, 0] = 0.0
    vertical, horizontal = (np.abs(np.fft.fftfreq(size)) for size in mean.shape)
    frequency = np.hypot(vertical[:, None], horizontal[None])
    # Frequencies beyond half a cycle per pixel exist along diagonals only, and count to the last band.
    band = np.minimum((2 * BANDS * frequency).astype(int), BANDS - 1)
    whole = max(float(power.mean()), 1e-300)
    return tuple(float(power[band == number].mean()) / whole for number in range(BANDS))


def against(first: Noise, second: Noise) -> str:
    """The ratio of two times to unit variance with its interval, in a sentence; no verdict where it contains 1."""
    if not (first.seconds > 0 and second.seconds > 0):
        return "time to unit variance: a picture without noise has none"
    ratio = first.seconds / second.seconds
    half = math.exp(math.hypot(math.log(first.high / first.seconds), math.log(second.high / second.seconds)))
    verdict = "" if ratio / half > 1 or ratio * half < 1 else ": no difference beyond noise"
    return f"time to unit variance × {ratio:.3f} (95 %: {ratio / half:.3f} to {ratio * half:.3f}){verdict}"


def bias(first: Runs, second: Runs) -> tuple[float, float, float]:
    """Root mean square of the difference between two renderers' expectations, √(MSE - variance), relative to the mean
    of the second, between the ends of its 95 % interval over the pixels; the lower end is 0 where noise explains it.
    """
    scale = max(float(second.mean.mean()), 1e-30)
    square = ((first.mean - second.mean) ** 2 - first.variance - second.variance).mean(axis=2) / scale**2
    middle = float(square.mean())
    half = NormalDist().inv_cdf(0.5 + inference.CONFIDENCE / 2) * float(square.std()) / math.sqrt(square.size)
    low, found, high = (math.sqrt(max(value, 0.0)) for value in (middle - half, middle, middle + half))
    return low, found, high


def side_by_side(first: F32, second: F32, *, gain: float = 8.0) -> F32:
    """Two pictures of (height, width, 3) display values, and right of them |first - second| × gain."""
    return np.concatenate([first, second, np.clip(gain * np.abs(first - second), 0, 1)], axis=1).astype(np.float32)


def stack(pictures: list[F32]) -> F32:
    """Pictures of (height, width, 3 or more) as the array of Runs; further channels are dropped."""
    return np.stack([picture[..., :3] for picture in pictures])
