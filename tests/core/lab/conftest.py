# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures of the laboratory's tests: small scenes and the rows of one uninterrupted sweep over them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from sweep_runs import OPTIONS, ROWS, soups, table

from addon.lab.commands import bench


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: Any) -> list[str]:
    """Two small files."""
    return soups(tmp_path_factory.mktemp("scenes"), 2, 300)


@pytest.fixture
def whole(scenes: list[str], tmp_path: Path) -> list[dict[str, Any]]:
    """The rows of one uninterrupted run in this process."""
    assert bench.main([*scenes, *OPTIONS, "--out", str(tmp_path / "whole")]) == 0
    found = table(tmp_path / "whole")
    assert len(found) == 2 * ROWS
    return found
