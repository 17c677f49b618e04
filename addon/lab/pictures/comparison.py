# SPDX-License-Identifier: GPL-3.0-or-later
"""Statistical comparison of two renderers' pictures of one scene: do they differ by more than their noise?"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from ...core.base.arrays import F32, F64

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
"""Largest relative difference of a channel's mean."""


@dataclass(frozen=True)
class Verdict:
    """Whether two renderers' pictures are equal up to noise.

    means: relative difference of each channel's mean. worst: the largest difference of a square in a channel, in
    standard errors. limit: the value that the largest of `tests` differences exceeds by chance as rarely as a single
    one exceeds LIMIT (Šidák 1967). beyond: number of differences above it. noise: ratio of the variances of the two
    renderers' pictures.
    """

    means: tuple[float, ...]
    worst: float
    limit: float
    tests: int
    beyond: int
    noise: float

    @property
    def same(self) -> bool:
        """Whether every mean and every square agrees."""
        return self.beyond == 0 and all(abs(mean) <= MOST_MEAN for mean in self.means)

    def lines(self) -> list[str]:
        """The numbers as lines of text."""
        means = " ".join(f"{100 * mean:+.3f}" for mean in self.means)
        size = f"{VERDICT_BLOCK} × {VERDICT_BLOCK}"
        limits = f"(at most {self.limit:.2f}); beyond: {self.beyond}"
        return [
            f"means differ by {means} % (at most {100 * MOST_MEAN:g} %)",
            f"worst of {self.tests:,} squares of {size} pixels: {self.worst:.2f} standard errors {limits}",
            "the same up to noise" if self.same else "NOT the same",
        ]


ROUNDING = 2e-3
"""Share of a square's brightness allowed for rounding in tables and filters."""


def judge(first: Runs, second: Runs, *, tolerance: float = ROUNDING) -> Verdict:
    """Decide whether two renderers' pictures are equal up to noise. Raises ComparisonError.

    tolerance: share of a square's brightness allowed for rounding in tables and filters; it counts as LIMIT standard
    errors and is added to those of the noise. Without it pictures free of noise could never agree.
    """
    if first.pictures.shape[1:] != second.pictures.shape[1:]:
        raise ComparisonError(f"the pictures have sizes {first.pictures.shape[1:3]} and {second.pictures.shape[1:3]}")
    a, b = first.mean, second.mean
    totals = b.sum(axis=(0, 1))
    means = tuple(float(x) for x in np.where(totals > 0, a.sum(axis=(0, 1)) / np.maximum(totals, 1e-30) - 1, 0.0))
    # Score each square and channel in standard errors of noise and rounding.
    side = VERDICT_BLOCK
    difference = _blocks(a - b, side).mean(axis=(1, 3))
    error = np.sqrt(_blocks(first.variance + second.variance, side).sum(axis=(1, 3))) / side**2
    rounding = tolerance / LIMIT * np.maximum(_blocks(b, side).mean(axis=(1, 3)), 1e-3 * b.mean())
    scores = np.abs(difference) / np.hypot(error, rounding + 1e-12)
    # Correct the limit for the number of tests (Šidák 1967).
    single = 2 * NormalDist().cdf(-LIMIT)
    limit = -NormalDist().inv_cdf(-math.expm1(math.log1p(-single) / scores.size) / 2)
    noise = float(first.variance.mean() * len(first.pictures)) / max(
        float(second.variance.mean() * len(second.pictures)), 1e-30
    )
    return Verdict(means, float(scores.max()), limit, scores.size, int((scores > limit).sum()), noise)


def side_by_side(first: F32, second: F32, *, gain: float = 8.0) -> F32:
    """Two pictures of (height, width, 3) display values, and right of them |first - second| × gain."""
    return np.concatenate([first, second, np.clip(gain * np.abs(first - second), 0, 1)], axis=1).astype(np.float32)


def stack(pictures: list[F32]) -> F32:
    """Pictures of (height, width, 3 or more) as the array of Runs; further channels are dropped."""
    return np.stack([picture[..., :3] for picture in pictures])
