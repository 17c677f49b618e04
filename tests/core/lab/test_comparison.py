# SPDX-License-Identifier: GPL-3.0-or-later
"""Comparing noisy pictures: equal ones pass, different ones do not, however small the difference next to the noise."""

from __future__ import annotations

import numpy as np
import pytest

from addon.lab.pictures.comparison import (
    ComparisonError,
    Runs,
    against,
    bias,
    compare,
    judge,
    noise_of,
    side_by_side,
    stack,
)

SHAPE = (4, 64, 96, 3)


def noisy(seed: int, *, mean: float = 0.5, sigma: float = 0.2) -> np.ndarray:
    """Runs of a flat picture whose pixels are as noisy as a path tracer's: the channels share their random numbers."""
    random = np.random.default_rng(seed).normal(1.0, sigma / mean, SHAPE[:3])
    return (mean * random[..., None] * np.array([1.0, 0.8, 0.6])).astype(np.float32)


def test_two_renderers_of_the_same_scene_agree() -> None:
    found = compare(Runs("a", noisy(1)), Runs("b", noisy(2)))
    assert found.differing == 0
    assert found.blocks == 96
    assert found.ratio == pytest.approx((1, 1, 1), abs=0.01)
    assert found.ratio_median == pytest.approx(1, abs=0.01)
    assert found.rmse == pytest.approx(found.rmse_noise, rel=0.05)
    assert np.abs(found.scores).mean() == pytest.approx(np.sqrt(2 / np.pi), rel=0.2)


def test_a_shadow_hidden_in_the_noise_is_found_where_it_is() -> None:
    shaded = noisy(2)
    shaded[:, 16:24, 40:48] -= 0.1  # half the noise of one pixel
    found = compare(Runs("a", shaded), Runs("b", noisy(3)))
    assert np.argwhere(np.abs(found.scores) > 4).tolist() == [[2, 5]]
    assert found.scores[2, 5] < 0
    assert found.differing == pytest.approx(1 / 96)


def test_a_picture_two_percent_too_bright_is_told_by_its_ratio() -> None:
    found = compare(Runs("a", 1.02 * noisy(4, sigma=0.02)), Runs("b", noisy(5, sigma=0.02)))
    assert found.ratio == pytest.approx((1.02, 1.02, 1.02), abs=0.001)
    assert found.differing > 0.8
    assert f"{found.ratio[0]:.4f}" in found.lines()[0]


def test_pictures_without_noise_must_be_equal() -> None:
    flat = np.full(SHAPE, 0.5, np.float32)
    assert compare(Runs("a", flat), Runs("b", flat)).differing == 0
    other = flat.copy()
    other[:, :8, :8] += 0.001
    assert compare(Runs("a", other), Runs("b", flat)).differing == pytest.approx(1 / 96)


def test_black_pictures_have_no_ratio() -> None:
    black = np.zeros(SHAPE, np.float32)
    found = compare(Runs("a", black), Runs("b", black))
    assert np.isnan(found.ratio).all()
    assert np.isnan(found.ratio_median)
    assert found.differing == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p: p[:1], "at least 2 pictures"),
        (lambda p: p[..., :2], "3 channels"),
        (lambda p: np.where(p == p.max(), np.nan, p), "1 values are not finite"),
    ],
)
def test_rejects_pictures_that_cannot_be_compared(change, message: str) -> None:
    with pytest.raises(ComparisonError, match=message):
        Runs("a", change(noisy(1)))


def test_sizes_must_be_equal_and_large_enough() -> None:
    with pytest.raises(ComparisonError, match="sizes"):
        compare(Runs("a", noisy(1)), Runs("b", noisy(1)[:, :32]))
    with pytest.raises(ComparisonError, match="smaller"):
        compare(Runs("a", noisy(1)[:, :7]), Runs("b", noisy(1)[:, :7]))


def test_the_pictures_stand_side_by_side() -> None:
    a, b = np.full((2, 3, 3), 0.5, np.float32), np.full((2, 3, 3), 0.45, np.float32)
    beside = side_by_side(a, b)
    assert beside.shape == (2, 9, 3)
    assert beside[0, 7] == pytest.approx([0.4] * 3, abs=1e-6)
    assert stack([np.ones((2, 3, 4), np.float32)] * 2).shape == (2, 2, 3, 3)


def test_a_verdict_passes_equal_scenes_and_falls_for_a_planted_error() -> None:
    same = judge(Runs("a", noisy(6)), Runs("b", noisy(7)))
    assert same.same
    assert (same.tests, sum(same.histogram)) == (4 * 6, 4 * 6)
    assert same.noise == pytest.approx(1, rel=0.1)
    planted = noisy(6)
    planted[:, 16:32, 48:64] *= 0.85
    found = judge(Runs("a", planted), Runs("b", noisy(7)))
    assert not found.same
    assert found.alarms["one square"] < found.limit < found.alarms["mean"]
    bright = judge(Runs("a", 1.03 * noisy(8)), Runs("b", noisy(9)))
    assert bright.alarms["mean"] < bright.limit
    assert any("NOT" in line for line in bright.lines())


def rendered(random: np.random.Generator, sigma: float, bias: float = 0.0) -> Runs:
    """Pictures of a bright and a dark half, whose noise is that of their brightness and has a long tail."""
    exact = np.where(np.arange(64)[None, :, None] < 32, 0.8, 0.1) * np.array([1.0, 0.8, 0.6])
    shape = (12, 96, 64, 1)
    noise = random.gamma(1 / sigma**2, sigma**2, shape)
    return Runs("a", (exact * noise * (1 + bias)).astype(np.float32))


def test_a_bias_of_a_thousandth_is_found_and_noise_raises_the_alarm_in_one_percent() -> None:
    """Both engines have one expectation in a hundred comparisons; the most alarms of 1 % that chance explains are 3."""
    random = np.random.default_rng(20)
    verdicts = [judge(rendered(random, 0.02), rendered(random, 0.03), tolerance=0.0, of_mean=0.0) for _ in range(100)]
    assert sum(not verdict.same for verdict in verdicts) <= 3
    # Without a difference, p of all squares are spread evenly.
    counts = np.sum([verdict.histogram for verdict in verdicts], axis=0)
    assert (counts / counts.mean()).tolist() == pytest.approx([1.0] * len(counts), abs=0.25)
    for _ in range(5):
        found = judge(rendered(random, 0.02, bias=0.001), rendered(random, 0.03), tolerance=0.0, of_mean=0.0)
        assert not found.same
        assert found.histogram[0] > found.histogram[-1]


def test_the_noise_is_that_of_the_samples_and_its_interval_holds_it() -> None:
    random = np.random.default_rng(4)
    inside, exact = 0, 2.0 * 0.3**2
    for _ in range(60):
        pictures = random.normal(1.0, 0.3, (7, 16, 24, 3)).astype(np.float32)
        found = noise_of(Runs("a", pictures), random.normal(2.0, 0.1, 7))
        inside += found.low <= exact <= found.high
    assert inside >= 52
    assert found.variance == pytest.approx(0.09, rel=0.1)
    assert found.spectrum == pytest.approx((1.0, 1.0, 1.0, 1.0), abs=0.3)
    assert "time to unit variance" in found.lines("a")[0]
    # Neighbouring pixels that err alike have low frequencies.
    smooth = np.repeat(np.repeat(random.normal(1.0, 0.3, (7, 4, 6, 3)), 4, axis=1), 4, axis=2).astype(np.float32)
    spectrum = noise_of(Runs("a", smooth), [1.0] * 7).spectrum
    assert spectrum[0] > 3 * spectrum[-1]
    with pytest.raises(ComparisonError, match="at least 3"):
        noise_of(Runs("a", smooth[:2]), [1.0] * 2)


def test_the_bias_is_what_is_left_of_the_error_without_the_variance() -> None:
    random = np.random.default_rng(5)
    first, second = (Runs("a", random.normal(mean, 0.1, (8, 64, 64, 3)).astype(np.float32)) for mean in (1.02, 1.0))
    low, found, high = bias(first, second)
    assert found == pytest.approx(0.02, rel=0.05)
    assert 0.018 < low < 0.02 < high < 0.023
    low, _, high = bias(Runs("a", random.normal(1.0, 0.1, (8, 64, 64, 3)).astype(np.float32)), second)
    assert low == 0.0 < high < 0.01
    flat = noise_of(Runs("a", np.ones((3, 8, 8, 3), np.float32)), [1.0, 1.1, 0.9])
    assert against(flat, flat).endswith("without noise has none")
    assert "no difference beyond noise" in against(noise_of(second, [1.0] * 8), noise_of(second, [1.0] * 8))
