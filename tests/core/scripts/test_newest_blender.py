# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of the newest Blender, and what is said of pictures that differ."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scripts.dev import environment, newest_blender
from tests.one_line import told


def test_a_row_replaces_that_of_the_same_blender() -> None:
    page = f"before\n{newest_blender.BEGIN}{newest_blender.HEAD}{newest_blender.END}after\n"
    for row, blender in (
        ("| 5.3.0 | old |\n", "5.3.0"),
        ("| 5.4.0 | one |\n", "5.4.0"),
        ("| 5.3.0 | new |\n", "5.3.0"),
    ):
        page = newest_blender.replaced(page, row, blender)
    rows = "| 5.4.0 | one |\n| 5.3.0 | new |\n"
    assert page == f"before\n{newest_blender.BEGIN}{newest_blender.HEAD}{rows}{newest_blender.END}after\n"
    shipped = newest_blender.PAGE.read_text(encoding="utf-8")
    assert f"{newest_blender.BEGIN}{newest_blender.HEAD}| 5." in shipped


def test_pictures_that_differ_are_named(tmp_path: Path) -> None:
    one, other = {"a": np.ones((2, 2)), "b": np.ones((2, 2))}, {"a": np.ones((2, 2)), "b": np.full((2, 2), 1.25)}
    for name, pictures in (("one", one), ("other", other)):
        np.savez(tmp_path / f"{name}.npz", **pictures)
    assert newest_blender.compared(tmp_path / "one.npz", tmp_path / "one.npz") == "2"
    assert newest_blender.compared(tmp_path / "one.npz", tmp_path / "other.npz") == "1; mean difference: b 20 %"


def test_an_environment_that_cannot_be_made_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object) -> None:
        raise environment.SetupError("the newest Blender could not be installed: no network")

    monkeypatch.setattr(environment, "make", fail)
    assert told(newest_blender, [], capsys).startswith("newest_blender: the newest Blender could not be installed")
