# SPDX-License-Identifier: GPL-3.0-or-later
"""The measurement of boiling: variances from frame to frame, and their ratio."""

import numpy as np
import pytest

from scripts.dev import denoised_pictures


def test_the_variance_is_that_of_blocks_over_the_frames_of_a_group() -> None:
    rng = np.random.default_rng(3)
    noise = rng.normal(0.0, 1.0, (40, 64, 64, 1))
    shots = np.broadcast_to(0.2 + 0.01 * noise, (40, 64, 64, 3)).astype(np.float32)
    pixels, blocks = (denoised_pictures.variances(shots, side) for side in denoised_pictures.SIDES)
    assert pixels.shape == blocks.shape == (40 // denoised_pictures.GROUP,)
    # Means of 64 independent pixels have a variance of 1/64; the slope of the display's curve is the same for both.
    assert pixels.mean() / blocks.mean() == pytest.approx(64, rel=0.1)
    # A difference between pixels that stays in all frames is none.
    still = np.broadcast_to(rng.random((64, 64, 1)), (10, 64, 64, 3)).astype(np.float32)
    assert denoised_pictures.variances(still, 1) == pytest.approx(0.0)


def test_the_ratio_of_equal_noise_has_one_in_its_interval() -> None:
    rng = np.random.default_rng(5)
    ours, theirs = (rng.chisquare(40, 8) for _ in range(2))
    middle, low, high = denoised_pictures.against(ours, theirs)
    assert low < 1 < high
    assert low < middle < high
    assert denoised_pictures.against(2 * theirs, theirs) == pytest.approx((2.0, 2.0, 2.0))


@pytest.mark.parametrize("frames", ["0", "9"])
def test_too_few_frames_are_refused(frames: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert denoised_pictures.main(["--frames", frames]) == 2
    assert "--frames: expected at least 10" in capsys.readouterr().err
