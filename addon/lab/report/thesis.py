# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables of Hoobergs 2019, measured again: times in percent of the kd-tree's, and the published numbers.

The published ones come from a file outside the project; without it the tables contain only ours.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ...core.measure import ranking, yardstick
from ...core.measure.benchmark import BASES
from ...core.measure.rows import Row, agrees
from ...core.scene import workload
from ...core.structures import specs
from ..base.usage import UsageError

SCENES = {"killeroo-feet": "killeroo_leg", "sponza-dabrovic": "sponza", "conference": "conference"}
"""Our scenes, and the most similar ones of the thesis by their names there."""

TABLES = {
    "bsp-random": "5.1",
    "bsp-random-plus": "5.2",
    "bsp-random-plus-kd": "5.3",
    "bsp-wn": "5.4",
    "bsp-wn-plus": "5.5",
    "bsp-wn-plus-kd": "5.6",
    "bsp-cn": "5.7",
    "bsp-cn-plus": "5.8",
    "bsp-cn-plus-kd": "5.9",
}
"""Structures whose times by k the thesis tabulates, and the number of the table."""

FILE = workload.SCENES.parent / "reference" / "thesis_results.json"
"""Where the published numbers are looked for by default; they are not part of the project."""

COLUMNS = {
    "time": "render_pct_of_kd",
    "build": "build_pct_of_kd",
    "nearest": "tri_tests_nearest_pct_of_kd",
    "any": "tri_tests_any_pct_of_kd",
    "steps": "inner_steps_nearest_pct_of_kd",
    "nodes_axis": "kd_nodes",
    "nodes_oblique": "bsp_nodes",
}
"""Our columns and their names in the file. Times, tests and steps: percent of the kd-tree's."""

COMPARED = {"render": "time", "build": "build", "tests": "nearest"}
"""Columns of the comparison of all structures, as keys of COLUMNS."""

Numbers = tuple[float, ...]

Place = tuple[str, str, int]
"""Structure by our id, scene by our name, and k: 0 for structures without one."""


@dataclass(frozen=True)
class Published:
    """Published numbers. medians: by place and column. spreads: smallest, median and largest time by place. compared:
    the k of the comparison, None without one, by structure and scene.
    """

    medians: dict[Place, dict[str, float]] = field(default_factory=dict)
    spreads: dict[Place, Numbers] = field(default_factory=dict)
    compared: dict[tuple[str, str], int | None] = field(default_factory=dict)

    def by_k(self, scene: str, structure: str) -> dict[int, float]:
        """K to percent of the kd-tree's time, empty if nothing was published for this scene and structure."""
        return {k: one["time"] for (tree, at, k), one in self.medians.items() if (tree, at) == (structure, scene) and k}


def published(path: Path | None) -> Published:
    """The published numbers of a file, of FILE if None; none if that is missing. Raises UsageError."""
    if path is None and not FILE.is_file():
        return Published()
    try:
        return read(path or FILE)
    except (OSError, ValueError) as error:
        raise UsageError(f"--published: {path or FILE}: {error}") from error


def read(path: Path) -> Published:
    """The published numbers in a file. Raises OSError, ValueError."""
    content = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(content, Mapping) or not isinstance(content.get("final_by_K"), list):
        raise ValueError("expected a list under 'final_by_K'")
    found = Published()
    # The comparison of all structures repeats some numbers of the tables by k; both agree.
    for name in ("final_comparison", "final_by_K", "draft_render_time"):
        try:
            for entry in content.get(name, []):
                _take(found, name, entry)
        except (KeyError, TypeError) as error:
            raise ValueError(f"an entry of {name!r} lacks {error}") from error
    return found


def _take(found: Published, name: str, entry: Mapping[str, Any]) -> None:
    """Add an entry of the file; scenes that are not here are passed over. Raises KeyError and TypeError."""
    scene = {theirs: ours for ours, theirs in SCENES.items()}.get(entry["scene"])
    structure, k = our_id(entry["structure"]), entry["K"]
    if scene is None:
        return
    place = place_of(structure, scene, k)
    if name == "draft_render_time":
        found.spreads[place] = tuple(float(entry[key]) for key in ("min", "med", "max"))
        return
    found.medians[place] = {ours: float(entry[key]) for ours, key in COLUMNS.items() if entry.get(key) is not None}
    if name == "final_comparison":
        found.compared[structure, scene] = k


def place_of(structure: str, scene: str, k: int | None) -> Place:
    """The place of published numbers; of the other structures there is one k only."""
    return structure, scene, k if k and structure.startswith("bsp-") else 0


def our_id(name: str) -> str:
    """Our id for a name of the thesis, for example bsp-wn-plus-kd for wn+^kd."""
    text = name.lower().replace("+", "-plus").replace("^kd", "-kd")
    return text if text.startswith(("kd", "rbsp")) else f"bsp-{text}"


def time_of(row: Row) -> float | None:
    """Time of one ray of each set together, in microseconds or relative to the anchor; None if not measured."""
    total = 0.0
    for one in (row["rays"] or {}).values():
        if not one["rounds"]:
            continue
        rates = np.array(one["rounds"])
        total += float(np.median(np.array(one["anchor_rounds"]) / rates if one["anchor_rounds"] else 1.0 / rates))
    return total or None


def percent(row: Row, base: Row) -> float | None:
    """A row's time in percent of the base's; None if they are not comparable or of different tables, or an answer is
    wrong.

    If the base is the row's anchor, it is the mean over the ray sets; otherwise the ratio of the sums of `time_of` of
    rows with the same anchor or the same rounds. Other rows may come from different machines.
    """
    time, unit = time_of(row), time_of(base)
    if time is None or unit is None or not agrees(row) or not set(row["tables"]) & set(base["tables"]):
        return None
    if row["anchor"] == base["spec"]:
        sets = sum(bool(one["rounds"]) for one in row["rays"].values())
        return 100 * time / sets
    same = row["anchor"] == base["anchor"] if row["anchor"] is not None else ranking.together(row, base)
    return 100 * time / unit if same and row["threads"] == base["threads"] else None


def base_of(rows: Iterable[Row]) -> Row | None:
    """The row of a scene that its times are relative to: the first of BASES whose answers are correct."""
    known = {row["spec"]: row for row in rows if agrees(row) and time_of(row)}
    return next((known[spec] for spec in BASES if spec in known), None)


SWEPT = ("k", "seed")
"""Parameters that sweeps vary; medians are over seeds."""


def configuration(row: Row) -> str:
    """A row's configuration without the swept parameters."""
    return _without_swept(row["spec"])


@lru_cache(1 << 17)
def _without_swept(spec: str) -> str:
    return specs.without(spec, SWEPT)


def labels(rows: Iterable[Row]) -> dict[str, str]:
    """By configuration its label: the structure, and the parameters that distinguish it from its other
    configurations.
    """
    alike: dict[str, list[str]] = {}
    for one in dict.fromkeys(map(configuration, rows)):
        alike.setdefault(specs.structure_of(one), []).append(one)
    found = {}
    for name, some in alike.items():
        shared = set.intersection(*(set(specs.pairs(one)) for one in some))
        for one in some:
            own = (f"{key}={value}" for key, value in specs.pairs(one) if (key, value) not in shared)
            found[one] = specs.joined(name, *own)
    return found


def spread(values: Sequence[float]) -> Numbers:
    """Smallest, median and largest; empty without values."""
    return (min(values), float(np.median(values)), max(values)) if values else ()


@dataclass(frozen=True)
class Line:
    """One configuration of a sweep: smallest, median and largest time over the seeds for each k, in percent of the
    base.

    label: its name in the plot's legend.
    """

    structure: str
    k: tuple[int, ...]
    low: tuple[float, ...]
    median: tuple[float, ...]
    high: tuple[float, ...]
    label: str


def sweeps(rows: Sequence[Row]) -> tuple[str, list[Line]]:
    """The base's configuration, and a line for each configuration of one scene that was measured with two or more k.

    Times are relative to the anchor's in the same round, so that rows of different hours and machines are comparable.
    Returns an empty name and no lines when no row can serve as the base.
    """
    base = base_of(rows)
    if base is None:
        return "", []
    # Group the times by configuration and k.
    found: dict[str, dict[int, list[float]]] = {}
    for row in rows:
        time = percent(row, base)
        if row["k"] is not None and time is not None:
            found.setdefault(configuration(row), {}).setdefault(row["k"], []).append(time)
    # Make a line of each configuration with several k.
    names = labels(rows)
    made = []
    for one, by_k in found.items():
        if len(by_k) > 1:
            ks = sorted(by_k)
            low, median, high = zip(*(spread(by_k[k]) for k in ks), strict=True)
            made.append(Line(specs.structure_of(one), tuple(ks), low, median, high, names[one]))
    return base["spec"], made


@dataclass(frozen=True)
class Table:
    """One table. lines: the row's label, and per scene the measured and the published numbers."""

    title: str
    scenes: tuple[str, ...]
    columns: tuple[str, ...]
    lines: tuple[tuple[str, tuple[tuple[Numbers, Numbers], ...]], ...]


def tables(scenes: Mapping[str, Sequence[Row]], published: Published | None) -> list[Table]:
    """The tables of times by k, and the comparison, from correct rows with a base. scenes: all rows."""
    named = {
        scene: [r for r in rows if not yardstick.is_foreign(r["spec"]) and agrees(r)] for scene, rows in scenes.items()
    }
    named = {scene: rows for scene, rows in named.items() if base_of(rows) is not None}
    known = published or Published()
    called = labels(row for rows in named.values() for row in rows)
    found = []
    for structure, number in TABLES.items():
        for one in (one for one in called if specs.structure_of(one) == structure):
            ks = sorted({row["k"] for rows in named.values() for row in rows if configuration(row) == one})
            if len(ks) > 1:
                lines = tuple((f"K = {k}", tuple(_by_k(named, known, one, k))) for k in ks)
                title = f"Table {number}: time of {called[one]} by K"
                found.append(Table(title, tuple(named), ("min", "median", "max"), lines))
    if found:
        found.append(_comparison(named, known, called))
    return found


def _by_k(scenes: Mapping[str, Sequence[Row]], known: Published, one: str, k: int) -> Iterable[tuple[Numbers, Numbers]]:
    structure = specs.structure_of(one)
    for scene, rows in scenes.items():
        own = [row for row in rows if (configuration(row), row["k"]) == (one, k)]
        yield spread(_percent(rows, own, "render")), known.spreads.get((structure, scene, k), ())


def _comparison(scenes: Mapping[str, Sequence[Row]], known: Published, called: Mapping[str, str]) -> Table:
    """Each configuration with the k of the thesis's comparison, or else its fastest k."""
    lines = []
    for one, label in called.items():
        cells = []
        for scene, rows in scenes.items():
            structure = specs.structure_of(one)
            k = known.compared.get((structure, scene))
            theirs = known.medians.get(place_of(structure, scene, k), {})
            base = base_of(rows)
            times = [(percent(row, base), row) for row in rows if configuration(row) == one and base is not None]
            own = [(time, row) for time, row in times if time is not None]
            if k is None or all(row["k"] != k for _, row in own):
                _, fastest = min(own, key=lambda item: item[0], default=(0.0, None))
                k = None if fastest is None else fastest["k"]
            kept = [row for _, row in own if row["k"] == k]
            medians = [(*spread(_percent(rows, kept, column))[1:2], math.nan)[0] for column in COMPARED]
            numbers = tuple(theirs[key] for key in COMPARED.values() if key in theirs)
            cells.append((tuple(medians) if kept else (), numbers))
        if any(ours for ours, _ in cells):
            lines.append((label, tuple(cells)))
    title = "The comparison of all structures, each at the K of the thesis or, where that is not here, at its best"
    return Table(title, tuple(scenes), tuple(COMPARED), tuple(lines))


def _percent(rows: Sequence[Row], own: Sequence[Row], column: str) -> list[float]:
    """A column of each row in percent of the base's. Builds, which have no anchor, are compared on one machine only."""
    base = base_of(rows)
    if base is not None and column == "render":
        return [value for value in (percent(row, base) for row in own) if value is not None]
    unit = None if base is None else _number(base, column)
    if base is None or not unit:
        return []
    if column == "build":
        own = [row for row in own if row["machine"] == base["machine"]]
    return [100 * value / unit for value in (_number(row, column) for row in own) if value is not None]


def _number(row: Row, column: str) -> float | None:
    if column == "build":
        return row["build_s"] and float(row["build_s"]["med"])
    primary = (row["rays"] or {}).get("primary") or {}
    return primary.get("tests")
