# SPDX-License-Identifier: GPL-3.0-or-later
"""Time to equal error, of renderers whose noise and speed are given."""

from __future__ import annotations

import time

import numpy as np
import pytest

from addon.lab.pictures import equal_error
from addon.lab.pictures.equal_error import Point, fit, measure

SHAPE = (16, 24, 3)


def renderer(sigma: dict[str, float], mean: dict[str, float]):
    """A renderer with independent samples of this standard deviation and mean per engine, which records its calls."""
    calls: list[tuple[str, int, int]] = []

    def render(engine: str, samples: int, seed: int) -> np.ndarray:
        calls.append((engine, samples, seed))
        random = np.random.default_rng([seed, samples, len(engine)])
        return random.normal(mean[engine], sigma[engine] / np.sqrt(samples), SHAPE)

    return render, calls


def points(each: float, error: float, fixed: float = 0.0) -> list[Point]:
    return [Point(n, fixed + each * n, 2 * (fixed + each * n), error / n, 0.0) for n in (2, 8, 32)]


def test_times_and_errors_are_fitted() -> None:
    found = fit(points(0.5, 3.0, fixed=1.0))
    assert (found.fixed, found.each) == pytest.approx((1.0, 0.5))
    assert (found.scale, found.power) == pytest.approx((3.0, 1.0))
    assert found.samples(0.3) == pytest.approx(10)
    # Faster with more samples: no negative time remains for none.
    assert fit([Point(n, n**1.2, 1.0, 1 / n, 0.0) for n in (2, 8, 32)]).fixed == 0
    # Slower with fewer samples: nothing is known of a sample's time.
    flat = [Point(n, 5.0 - n / 32, 1.0, 1 / n, 0.0) for n in (2, 8, 32)]
    assert (fit(flat).each, fit(flat).fixed) == (0, pytest.approx(4.5, rel=0.1))
    unknown = equal_error.Result("scene", {"HALFSPACE": flat, "CYCLES": flat}, (1.0, 1.0, 1.0))
    assert np.isnan(unknown.ratios()[1])
    assert unknown.ratios()[0] == pytest.approx(1)


def test_half_the_variance_at_equal_speed_halves_the_time() -> None:
    means = (1.0, 1.0, 1.0)
    result = equal_error.Result("scene", {"HALFSPACE": points(1.0, 0.5), "CYCLES": points(1.0, 1.0)}, means)
    assert result.ratios() == pytest.approx((0.5, 0.5, 0.5))
    # A constant part counts for whole renders only.
    slow = equal_error.Result("scene", {"HALFSPACE": points(1.0, 0.5, 16.0), "CYCLES": points(1.0, 1.0)}, means)
    assert slow.ratios("processor") == pytest.approx((1.0, 0.5, 0.5))
    assert slow.same
    # Halfspace takes half a sample's variance in the same time, or has the same error after half as many samples.
    assert result.equal_samples() == (32, 16)
    assert slow.equal_samples() == (16, 16)
    assert "| scene | 1.00 | 1.00 | 0.50 | 0.50 |" in slow.row()


def test_errors_and_means_are_those_of_the_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time, "perf_counter", iter(np.arange(0, 1000, 0.5)).__next__)
    render, calls = renderer({"HALFSPACE": 0.1, "CYCLES": 0.2}, {"HALFSPACE": 1.02, "CYCLES": 1.0})
    result = measure("scene", render, (1, 4), 3, 4096)
    assert calls[:2] == [("HALFSPACE", 4096, 1000), ("CYCLES", 4096, 1001)]
    assert [engine for engine, _, _ in calls[2:6]] == ["HALFSPACE", "CYCLES"] * 2
    assert len(set(calls)) == 14
    ours, theirs = result.points["HALFSPACE"], result.points["CYCLES"]
    assert [p.clock for p in ours] == [0.5, 0.5]
    assert ours[0].error == pytest.approx(0.1**2 + 0.01**2, rel=0.15)
    assert theirs[1].error == pytest.approx(0.2**2 / 4 + 0.01**2, rel=0.15)
    assert result.means == pytest.approx((1.02,) * 3, abs=1e-3)
    assert not result.same
    assert any("NOT the same" in line for line in result.lines())


def test_fireflies_are_counted_in_pixels() -> None:
    def render(engine: str, samples: int, seed: int) -> np.ndarray:
        picture = np.ones(SHAPE)
        if engine == "CYCLES" and samples == 2:
            picture[3, 4] = (50.0, 90.0, 1.0)
        return picture

    result = measure("scene", render, (2, 8), 1, 64)
    found = {engine: [p.fireflies for p in of] for engine, of in result.points.items()}
    assert found == {"HALFSPACE": [0, 0], "CYCLES": [pytest.approx(1e6 / (16 * 24)), 0]}


def test_the_crop_is_where_the_errors_are() -> None:
    reference = np.ones((16, 24, 3))
    noisy = reference.copy()
    noisy[8:12, 17:21] += 0.5
    assert equal_error.crop(reference, [reference, noisy]) == (slice(8, 12), slice(17, 21))
    # One outlier does not decide.
    noisy[2, 3] = 1e4
    assert equal_error.crop(reference, [noisy]) == (slice(8, 12), slice(17, 21))
