# SPDX-License-Identifier: GPL-3.0-or-later
"""The statistics of the field: shape of a tree, and the work of its rays as distributions instead of means."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ...base.interface import Structure

PERCENTS = (50, 90, 99)
"""Reported percentiles, in addition to mean and maximum."""

COUNTED = ("steps", "tests", "leaves")
"""Counters whose distribution over the rays is reported: nodes visited, triangles tested, leaves with triangles."""

CASE = "case_"
"""Prefix of the counters of the cases of ray and split plane."""


class Distribution(TypedDict):
    """Percentiles are measured values, not interpolated. histogram: numbers of 0, 1, 2–3, 4–7, 8–15, ..."""

    mean: float
    p50: int
    p90: int
    p99: int
    max: int
    histogram: list[int]


class Work(TypedDict, total=False):
    """The work of the rays of one set. A key is absent if the kernel does not count it, or if the set has no rays
    or nothing to take the share of.

    cases: shares of the cases of TA-B, which sum to 1. wasted_tests: share of triangle tests on leaf visits that found
    no nearer hit. empty_leaves: share of leaf visits without triangles. missing_work: share of steps and tests of rays
    that hit nothing.
    """

    steps: Distribution
    tests: Distribution
    leaves: Distribution
    cases: dict[str, float]
    wasted_tests: float
    empty_leaves: float
    missing_work: float


class Levels(TypedDict):
    """One entry per level: inner nodes, and distinct directions of their planes along axes and oblique."""

    nodes: list[int]
    directions_axis: list[int]
    directions_oblique: list[int]


class Shape(TypedDict):
    """Shape of a tree; costs in the thesis's units, beta and end-point overlap as in the module's stub."""

    nodes: int
    leaves: int
    depth: Distribution
    size: Distribution
    depths: list[int]
    levels: Levels
    sah: float
    epo: float
    epo_error: float
    beta: float | None
    beta_axis: float | None
    beta_oblique: float | None


class Field(TypedDict):
    """Statistics of a configuration. tree: None if the structure has none. rays: by ray set."""

    tree: Shape | None
    rays: dict[str, Work]


def distribution(values: NDArray[Any], counts: NDArray[Any] | None = None) -> Distribution | None:
    """The distribution of non-negative integers; None without values. counts: the number of occurrences of each, 1 if
    None.
    """
    counted = np.ones(len(values), np.int64) if counts is None else np.asarray(counts, np.int64)
    total = int(counted.sum())
    if not total:
        return None
    order = np.argsort(values, kind="stable")
    sorted_, below = np.asarray(values)[order], np.cumsum(counted[order])
    # A percentile is the smallest value that at least this percentage of all values does not exceed.
    at = {f"p{percent}": int(sorted_[np.searchsorted(below, total * percent / 100)]) for percent in PERCENTS}
    bins = np.zeros(int(sorted_[-1]).bit_length() + 1, np.int64)
    np.add.at(bins, [int(value).bit_length() for value in values], counted)
    return {
        "mean": float((np.asarray(values, np.float64) * counted).sum() / total),
        "p50": at["p50"],
        "p90": at["p90"],
        "p99": at["p99"],
        "max": int(np.asarray(values)[counted > 0].max()),
        "histogram": [int(count) for count in bins],
    }


def work(counters: Mapping[str, NDArray[np.uint32]], hit: NDArray[np.bool_]) -> Work:
    """The work of rays, from their counters and from which of them hit."""
    # Summarize the counters that the kernel has, then add shares of their sums.
    found: Work = {}
    known = {name: distribution(counters[name]) for name in COUNTED if name in counters}
    for name, spread in known.items():
        if spread is not None:
            found[name] = spread  # type: ignore[literal-required]
    sums = {name: int(values.sum(dtype=np.int64)) for name, values in counters.items()}
    cases = {name.removeprefix(CASE): total for name, total in sums.items() if name.startswith(CASE)}
    if sum(cases.values()):
        found["cases"] = {name: total / sum(cases.values()) for name, total in cases.items()}
    if sums.get("tests") and "tests_wasted" in sums:
        found["wasted_tests"] = sums["tests_wasted"] / sums["tests"]
    visited = sums.get("leaves", 0) + sums.get("leaves_empty", 0)
    if visited and "leaves_empty" in sums:
        found["empty_leaves"] = sums["leaves_empty"] / visited
    if {"steps", "tests"} <= set(counters):
        each = counters["steps"].astype(np.int64) + counters["tests"]
        if each.sum():
            found["missing_work"] = float(each[~hit].sum() / each.sum())
    return found


def value(row: Mapping[str, Any], *path: str) -> Any:
    """The value at a path within a row's statistics; None if any part is missing, as in rows of Embree."""
    found: Any = row.get("field")
    for key in path:
        if not isinstance(found, Mapping):
            return None
        found = found.get(key)
    return found


def shape(structure: Structure) -> Shape | None:
    """The shape of a structure's tree; None if it has none, or if the module cannot analyse it."""
    analysis = getattr(structure, "analysis", None)
    if analysis is None:
        return None
    found = analysis()
    depth = distribution(np.arange(len(found["leaf_depths"])), found["leaf_depths"])
    size = distribution(found["leaf_sizes"], found["leaf_size_counts"])
    if depth is None or size is None:
        return None
    return {
        "nodes": found["nodes"],
        "leaves": found["leaves"],
        "depth": depth,
        "size": size,
        "depths": found["leaf_depths"].tolist(),
        "levels": {
            "nodes": found["level_nodes"].tolist(),
            "directions_axis": found["level_directions_axis"].tolist(),
            "directions_oblique": found["level_directions_oblique"].tolist(),
        },
        "sah": found["sah_nodes"] + found["sah_leaves"],
        "epo": found["epo"],
        "epo_error": found["epo_error"],
        "beta": found["beta"],
        "beta_axis": found["beta_axis"],
        "beta_oblique": found["beta_oblique"],
    }
