# SPDX-License-Identifier: GPL-3.0-or-later
"""Comparing noisy pictures: equal ones pass, different ones do not, however small the difference next to the noise."""

from __future__ import annotations

import numpy as np
import pytest

from addon.lab.pictures.comparison import ComparisonError, Runs, compare, judge, side_by_side, stack

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
    assert same.tests == 4 * 6 * 3
    assert 4 < same.limit < 6
    assert same.noise == pytest.approx(1, rel=0.1)
    planted = noisy(6)
    planted[:, 16:32, 48:64] *= 0.85
    found = judge(Runs("a", planted), Runs("b", noisy(7)))
    assert not found.same
    assert found.beyond >= 1
    bright = judge(Runs("a", 1.015 * noisy(8, sigma=0.3)), Runs("b", noisy(9, sigma=0.3)))
    assert not bright.same
    assert any("NOT" in line for line in bright.lines())
