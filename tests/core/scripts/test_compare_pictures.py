# SPDX-License-Identifier: GPL-3.0-or-later
"""`halfspace compare A B`: two pictures, without Blender."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from addon.core.base import picture_files
from addon.core.base.picture_files import Picture
from addon.lab.commands import compare
from tests.one_line import told


def saved(path: Path, pixels: np.ndarray) -> str:
    picture_files.write(path, Picture(pixels.astype(np.float32), ("R", "G", "B")))
    return str(path)


def test_equal_pictures_have_no_error_and_others_theirs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    grey = np.full((8, 16, 3), 0.5)
    brighter = grey.copy()
    brighter[2, 5] = 0.75
    first, second = saved(tmp_path / "a.exr", grey), saved(tmp_path / "b.exr", brighter)
    assert compare.main([first, first, "--most", "0"]) == 0
    assert "RMSE       0, relMSE 0\n  FLIP       0\n" in capsys.readouterr().out
    assert compare.main([second, first]) == 0
    said = capsys.readouterr().out
    assert f"RMSE       {np.sqrt(0.25**2 / 128):.6g}" in said
    assert "largest    0.25 at pixel 5, 2 from" in said
    assert "different  1 pixels; 0 not finite" in said
    assert compare.main([second, first, "--most", "0.02"]) == 1
    assert compare.main([second, first, "--most", "0.03"]) == 0


def test_pictures_for_displays_are_compared_in_linear_light(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ramp = np.linspace(0, 1, 16 * 8 * 3).reshape(8, 16, 3)
    first, second = saved(tmp_path / "a.exr", ramp), saved(tmp_path / "a.png", ramp)
    # Bytes are at most half a step of 1/255 off, whose slope is largest at white.
    assert compare.main([second, first, "--most", "0.003"]) == 0


def test_rejects_pictures_that_cannot_be_compared(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = saved(tmp_path / "a.exr", np.zeros((8, 16, 3))), saved(tmp_path / "b.exr", np.zeros((8, 8, 3)))
    assert told(compare, [first, second], capsys).endswith("expected pictures of one size, got 16 × 8 and 8 × 8\n")
    assert "there is no such file" in told(compare, [first, str(tmp_path / "c.exr")], capsys)
    broken = tmp_path / "broken.exr"
    broken.write_bytes(Path(first).read_bytes()[:200])
    assert told(compare, [first, str(broken)], capsys).startswith(f"compare: {broken}: cannot be read: ")
    assert "--whole" in told(compare, [first, first, "--whole"], capsys)
    assert "--most" in told(compare, [first, first, "--most=-1"], capsys)
