# SPDX-License-Identifier: GPL-3.0-or-later
"""Sweeps over k: times relative to the kd-tree's, medians over seeds, and published ones to lay over them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .rows import Row

BASE = "kd-sah"
"""What the times are related to: the kd-tree built as in the thesis; where it was not measured, `kd`."""


@dataclass(frozen=True)
class Line:
    """Per k the smallest, median and largest time over the seeds, in percent of the base."""

    structure: str
    k: tuple[int, ...]
    low: tuple[float, ...]
    median: tuple[float, ...]
    high: tuple[float, ...]


def lines(rows: Sequence[Row]) -> tuple[str, list[Line]]:
    """The base, and a line for each structure of one scene that was measured with two or more k.

    The time of a row is that of one ray of each set together, in units of the anchor's, so that rows of different
    hours and machines can be put in one line.
    """
    base = next((row for name in (BASE, "kd") for row in rows if row["spec"] == name and time_of(row)), None)
    if base is None:
        return "", []
    unit = time_of(base)
    assert unit is not None
    found: dict[str, dict[int, list[float]]] = {}
    for row in rows:
        time = time_of(row)
        if row["k"] is not None and time is not None:
            found.setdefault(row["structure"], {}).setdefault(row["k"], []).append(100 * time / unit)
    made = []
    for structure, by_k in found.items():
        if len(by_k) > 1:
            ks = sorted(by_k)
            numbers = [(min(by_k[k]), float(np.median(by_k[k])), max(by_k[k])) for k in ks]
            low, median, high = zip(*numbers, strict=True)
            made.append(Line(structure, tuple(ks), low, median, high))
    return base["spec"], made


def time_of(row: Row) -> float | None:
    """Time of one ray of each set together, relative to the anchor where there is one; None where not measured."""
    total = 0.0
    for one in (row["rays"] or {}).values():
        if not one["rounds"]:
            continue
        rates = np.array(one["rounds"])
        total += float(np.median(np.array(one["anchor_rounds"]) / rates if one["anchor_rounds"] else 1.0 / rates))
    return total or None


def read_published(path: Path) -> dict[str, dict[str, dict[int, float]]]:
    """Scene to structure to k to render time in percent of the kd-tree's. Raises OSError, ValueError."""
    found: dict[str, dict[str, dict[int, float]]] = {}
    content = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(content, Mapping) or not isinstance(content.get("final_by_K"), list):
        raise ValueError("expected a list under 'final_by_K'")
    for entry in content["final_by_K"]:
        try:
            by_k = found.setdefault(entry["scene"], {}).setdefault(published_id(entry["structure"]), {})
            by_k[int(entry["K"])] = float(entry["render_pct_of_kd"])
        except (KeyError, TypeError) as error:
            raise ValueError(f"an entry of 'final_by_K' lacks {error}") from error
    return found


def published_id(name: str) -> str:
    """The id of what the thesis calls, for example, wn+^kd: bsp-wn-plus-kd."""
    return "bsp-" + name.lower().replace("+", "-plus").replace("^kd", "-kd")


SCENES = {"killeroo-feet": "killeroo_leg", "sponza-dabrovic": "sponza", "conference": "conference"}
"""Our scenes, and what the publication calls its own that they come nearest to."""


def published_for(scene: str, structure: str, published: Any) -> dict[int, float]:
    """K to percent, empty where nothing was published for this scene and structure."""
    found: dict[int, float] = (published or {}).get(SCENES.get(scene, ""), {}).get(structure, {})
    return found
