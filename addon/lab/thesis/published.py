# SPDX-License-Identifier: GPL-3.0-or-later
"""The published numbers, from a file outside the project; without it the tables contain only ours."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...core.scene import workload
from ..report.thesis import SCENES, our_id

FILE = workload.SCENES.parent / "reference" / "thesis_results.json"
"""Where the file is looked for by default."""

COLUMNS = {
    "time": "render_pct_of_kd",
    "nearest": "tri_tests_nearest_pct_of_kd",
    "any": "tri_tests_any_pct_of_kd",
    "steps": "inner_steps_nearest_pct_of_kd",
    "nodes_axis": "kd_nodes",
    "nodes_oblique": "bsp_nodes",
}
"""Our columns and their names in the file. Times, tests and steps: percent of the kd-tree's."""

Place = tuple[str, str, int]
"""Structure by our id, scene by our name, and k: 0 for structures without one."""


@dataclass(frozen=True)
class Published:
    """Published numbers. medians: by place and column. spreads: smallest, median and largest time by place."""

    medians: Mapping[Place, Mapping[str, float]] = field(default_factory=dict)
    spreads: Mapping[Place, tuple[float, float, float]] = field(default_factory=dict)


def read(path: Path) -> Published:
    """The published numbers in a file. Raises OSError, ValueError."""
    content = json.loads(path.read_text(encoding="utf-8"))
    ours = {theirs: scene for scene, theirs in SCENES.items()}
    medians: dict[Place, dict[str, float]] = {}
    spreads: dict[Place, tuple[float, float, float]] = {}
    try:
        # The comparison of all structures repeats some numbers of the tables by k; both agree.
        for entry in [*content["final_comparison"], *content["final_by_K"]]:
            place = _place(entry, ours)
            if place is not None:
                medians[place] = {
                    name: float(entry[key]) for name, key in COLUMNS.items() if entry.get(key) is not None
                }
        for entry in content["draft_render_time"]:
            place = _place(entry, ours)
            if place is not None:
                spreads[place] = (float(entry["min"]), float(entry["med"]), float(entry["max"]))
    except (KeyError, TypeError) as error:
        raise ValueError(f"an entry lacks {error}") from error
    return Published(medians, spreads)


def _place(entry: Mapping[str, Any], ours: Mapping[str, str]) -> Place | None:
    """The place of an entry; None for a scene that is not here."""
    scene = ours.get(entry["scene"])
    structure = our_id(entry["structure"])
    k = entry["K"] if structure.startswith("bsp-") and entry["K"] else 0
    return None if scene is None else (structure, scene, int(k))
