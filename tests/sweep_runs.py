# SPDX-License-Identifier: GPL-3.0-or-later
"""Small sweeps for tests: their scenes, their configurations, the rows of a report without times."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from addon.core.measure import rows

SPECS = "kd:triangle_cost=2|5,traversal=dir,kd-sah:traversal=dir,kd-median:leaf_size=2..4,traversal=dir"
ROWS = 6
OPTIONS = ["--structures", SPECS, "--size", "64x64", "--repeats", "2", "--check-rays", "512", "--curve", "none"]
OPTIONS += ["--only-rays", "--seconds", "2"]


def soups(folder: Path, count: int, triangles: int) -> list[str]:
    """So many files of random triangles."""
    found = []
    for seed in range(1, count + 1):
        rng = np.random.default_rng(seed)
        corners = rng.normal(size=(triangles, 1, 3)) + 0.3 * rng.normal(size=(triangles, 3, 3))
        path = folder / f"soup-{seed}.npz"
        np.savez(
            path,
            vertices=corners.reshape(-1, 3).astype(np.float32),
            triangles=np.arange(3 * triangles, dtype=np.int32).reshape(-1, 3),
            camera_eye=np.array([0.0, -5.0, 1.0]),
            camera_target=np.zeros(3),
            camera_up=np.array([0.0, 0.0, 1.0]),
            camera_vfov_deg=np.float64(45.0),
        )
        found.append(str(path))
    return found


def table(folder: Path) -> list[dict[str, Any]]:
    """The rows of a report without what the clock decides; Embree's values are not ours to promise."""
    found = json.loads((folder / "bench.json").read_text(encoding="utf-8"))["rows"]
    return [rows.without_times(row) for row in found if row["spec"] != "embree"]
