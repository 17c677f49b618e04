# SPDX-License-Identifier: GPL-3.0-or-later
"""A row of `bench.json`: the measurements of one configuration on one scene, and which of them depend on the clock."""

from __future__ import annotations

import platform
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, NotRequired, TypedDict, cast

import numpy as np
from numpy.typing import NDArray

from ..base.native import FAILURES, first_line
from ..scene.workload import Workload
from ..structures import catalogue, specs, ways
from . import inference, yardstick

if TYPE_CHECKING:
    from ..base.interface import Native
    from .analysis.field import Field
    from .analysis.tradeoff import Point
    from .curve import Converged


class Spread(TypedDict):
    """Smallest, median and largest of several measurements. low, high: the 95 % interval of the median, absent where
    too few were made (`inference.LEAST_ROUNDS`).
    """

    min: float
    med: float
    max: float
    low: NotRequired[float]
    high: NotRequired[float]


class RayColumns(TypedDict):
    """Columns of a row for one ray set: those of `OF_RAYS`, and the last three where they are known.

    n: rays that were timed. mrays_s: million rays per second, None without rays. times_embree: median over the rounds;
    times_embree_95: its 95 % interval. rounds, anchor_rounds: million rays per second of the configuration and of the
    anchor, one per round. noise: relative. steps, steps_axis, steps_oblique, steps_boxes,
    tests: means per ray. hits: share of rays that hit. cases: mean counts of the cases of TA-B.
    events: means per ray of `processor.NAMES`, absent where the system does not count them.
    """

    n: int
    mrays_s: Spread | Any
    times_embree: float | None
    rounds: list[float]
    anchor_rounds: list[float]
    noise: float | None
    steps: float | Any
    steps_axis: float | Any
    steps_oblique: float | Any
    steps_boxes: float | Any
    tests: float | Any
    hits: float
    cases: NotRequired[dict[str, float]]
    times_embree_95: NotRequired[list[float]]
    counts_timed_walk: NotRequired[bool]
    events: NotRequired[dict[str, float]]


class Way(TypedDict):
    """Nodes that the rays of a set meet, and how the rays go: `single`, `flight`, `packet`, `tile`, `beam` or
    `stream`.
    """

    nodes: str
    rays: str


class ImageColumns(TypedDict):
    """Rounds of the timed picture: samples per pixel, pixels, the anchor, and seconds per round."""

    samples: int
    pixels: int
    anchor: str | None
    rounds_s: list[float]
    anchor_rounds_s: list[float]
    noise: float | None


class Row(TypedDict):
    """A row of `bench.json`. Seconds and bytes; what was not measured is None, and then all of it where `error` is set.

    Columns that only the row of a failure lacks are `... | Any`: readers filter rows by `error` first. table, tables:
    of `structures.ways`, the first and all that show the row. tree: the configuration without nodes and traversal.
    label: the name in tables with columns of nodes and rays. nodes: kinds that rays meet. ways: per ray set, the nodes
    and rays of the kernel that answers it. layout: only in two levels.
    """

    scene: str
    triangles: int
    spec: str
    structure: str
    table: str | None
    tables: list[str]
    tree: str
    label: str
    nodes: str | None
    ways: dict[str, Way] | None
    k: Any
    alpha: Any
    seed: Any
    threads: int
    machine: str
    round_id: str | None
    anchor: str | None
    build_s: Spread | Any
    first_s: Spread | Any
    bytes: int | Any
    peak_bytes: int | None
    statistics: dict[str, Any] | Any
    rays: dict[str, RayColumns] | Any
    errors: dict[str, Any] | Any
    image_s: Spread | Any
    image: ImageColumns | None
    map: dict[str, Any] | Any
    curve: list[dict[str, Any]] | Any
    independent: list[dict[str, float]] | Any
    scaling: list[dict[str, float]] | Any
    offsets: list[dict[str, float]] | Any
    render_s: float | Any
    left_out: list[str]
    too_slow: list[str]
    error: str | None
    tradeoff: NotRequired[list[Point]]
    field: NotRequired[Field]
    converged: NotRequired[Converged | None]
    peer: NotRequired[list[dict[str, Any]]]
    portrait: NotRequired[str]
    layout: NotRequired[str]


Bound = Literal["min", "med", "max"]
"""A key of `Spread`."""

OF_THE_CLOCK = {
    *("build_s", "peak_bytes", "build_seconds", "n", "mrays_s", "times_embree", "times_embree_95"),
    *("rounds", "anchor_rounds", "noise", "events"),
    *("seconds", "seconds_with_build", "first_s", "render_s", "image_s", "image", "map", "machine", "round_id"),
    # How many pictures there are depends on the time that they take.
    *("anchor", "scaling", "too_slow", "ns", "peer", "portrait", "curve", "independent", "converged"),
}
"""Keys whose values vary between runs. All others are equal on every machine."""


LAZY = ("lazy", "1")
"""The parameter of lazily built trees."""


NOT_OF_ALL = {"tradeoff", "field", "converged", "peer", "portrait", "layout"}
"""Columns that only complete rows have."""

OF_RAYS = tuple(
    name
    for name in RayColumns.__annotations__
    if name not in ("cases", "counts_timed_walk", "events", "times_embree_95")
)
"""Columns of every row for each ray set."""

OF_ERRORS = (
    *("reference", "rays", "false_miss", "false_hit", "wrong_triangle", "wrong_values", "wrong_any_hit", "wrong"),
    *("t_ulp_max", "t_ulp_p999", "on_boundary", "sets", "differing_pixels"),
)
"""Columns of a row's errors."""


def blank() -> Row:
    """A row with every key and no values."""
    nothing = dict.fromkeys(name for name in Row.__annotations__ if name not in NOT_OF_ALL)
    texts = dict.fromkeys(("scene", "spec", "structure", "tree", "label"), "") | {"machine": platform.node()}
    lists: dict[str, Any] = {name: [] for name in ("tables", "left_out", "too_slow")}
    return cast("Row", {**nothing, **texts, **lists, "triangles": 0, "threads": 0})


def empty(native: Native, workload: Workload, spec: str, threads: int) -> Row:
    """A row with every key; unknown values are None."""
    structures = native.structures()
    foreign = yardstick.is_foreign(spec)
    known = {} if foreign else specs.values(spec, structures)
    structure = catalogue.of(structures).get(specs.structure_of(spec))
    shown = list(tables(native, spec))
    return {
        **blank(),
        "scene": workload.name,
        "triangles": len(workload.triangles),
        "spec": spec,
        "structure": specs.structure_of(spec),
        "table": shown[0],
        "tables": shown,
        "tree": ways.tree_of(spec),
        "label": spec if structure is None else ways.label(structure, spec),
        "k": known.get("k"),
        "alpha": known.get("alpha"),
        "seed": known.get("seed"),
        "threads": 1 if foreign else threads,
    }


FOREIGN_TABLES = ("single", "fastest", "chosen")
"""Embree is the unit of all tables, and peers are compared with all; their names say where rays go in packets."""


def tables(native: Native, spec: str) -> tuple[str, ...]:
    """The tables that show a configuration; the last one if the native module refuses it."""
    if yardstick.is_foreign(spec):
        return FOREIGN_TABLES
    structure = catalogue.of(native.structures()).get(specs.structure_of(spec))
    try:
        return ("chosen",) if structure is None else ways.tables(structure, specs.canonical(native, spec))
    except FAILURES:
        return ("chosen",)


def is_quickest(native: Native, spec: str) -> bool:
    """Whether a configuration is the one of its tree that is usually the quickest."""
    structure = catalogue.of(native.structures()).get(specs.structure_of(spec))
    try:
        return structure is not None and ways.is_quickest(structure, specs.canonical(native, spec))
    except FAILURES:
        return False


def add_ways(row: Row, found: dict[str, Way]) -> None:
    """Record how each ray set of a row was answered. A row with rays that went together leaves the table of single
    rays.
    """
    row["ways"] = found
    row["nodes"] = "+".join(dict.fromkeys(way["nodes"] for way in found.values())) or None
    if any(way["rays"] != "single" for way in found.values()):
        row["tables"] = [table for table in row["tables"] if table != "single"] or ["chosen"]
        row["table"] = row["tables"][0]


def lacks(row: Mapping[str, Any]) -> str | None:
    """The first column that a report needs and this row of a journal lacks; None if it is complete.

    Rows of another version of the program may lack columns.
    """
    for name in ("errors", "rays"):
        if not isinstance(row.get(name) or {}, dict):
            return name
    inner: list[tuple[str, Mapping[str, Any] | None, tuple[str, ...]]] = [("errors", row.get("errors"), OF_ERRORS)]
    inner += [(f"rays, {name}", one, OF_RAYS) for name, one in (row.get("rays") or {}).items()]
    missing = [name for name in blank() if name not in row]
    missing += [f"{where}, {name}" for where, found, names in inner if found for name in names if name not in found]
    return missing[0] if missing else None


def failed(native: Native, workload: Workload, spec: str, threads: int, error: BaseException) -> Row:
    """The row of a configuration that could not be measured."""
    row = empty(native, workload, spec, threads)
    row["error"] = first_line(error)
    return row


def failed_scene(name: str, error: BaseException) -> Row:
    """The row of a scene that could not be read: no configuration, only the reason."""
    return blank() | {"scene": name, "error": first_line(error)}


def spread(numbers: Sequence[float] | NDArray[np.float64]) -> Spread:
    """Smallest, median and largest, and the 95 % interval of the median."""
    found: Spread = {"min": float(min(numbers)), "med": float(np.median(numbers)), "max": float(max(numbers))}
    if (between := inference.interval(numbers)) is not None:
        found["low"], found["high"] = between
    return found


def is_lazy(spec: str) -> bool:
    """Whether this configuration's tree is completed while tracing."""
    return LAZY in specs.pairs(spec)


def eager(spec: str) -> str:
    """The same configuration, built at once."""
    return specs.without(spec, LAZY[:1])


def building(row: Row, which: Bound = "med") -> float:
    """Seconds of a row's build; for a lazily built tree including its first pass over the camera rays.

    which: "min", "med" or "max" of its repeats.
    """
    first = row.get("first_s")
    return float((first if first and is_lazy(row["spec"]) else row["build_s"])[which])


def agrees(row: Row) -> bool:
    """Whether a row's answers equal those of its reference: against brute force bit for bit, but for foreign tracers,
    whose arithmetic differs.
    """
    errors = row["errors"]
    if errors is None:
        return False
    wrong = ("false_miss", "false_hit", "wrong_triangle", "wrong_any_hit", "differing_pixels")
    exact = errors["reference"] == "brute" and not yardstick.is_foreign(row["spec"])
    bits = ("wrong_values", "t_ulp_max") if exact else ()
    return not any(errors[key] for key in wrong + bits)


def agrees_moved(row: Row) -> bool:
    """Whether its answers on the moved grids, if compared, equal those of brute force."""
    return not any(point["wrong"] for point in row["offsets"] or ())


def without_times(value: Any) -> Any:
    """A row, or a part of one, without everything that depends on clock and machine: the rest must be reproducible."""
    if isinstance(value, Mapping):
        return {key: without_times(inner) for key, inner in value.items() if key not in OF_THE_CLOCK}
    if isinstance(value, list):
        return [without_times(inner) for inner in value]
    return value


def by_scene(rows: Iterable[Row]) -> dict[str, list[Row]]:
    """The rows of each scene, in order of appearance."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(row["scene"], []).append(row)
    return found


def set_names(rows: Iterable[Row]) -> list[str]:
    """The ray sets that occur, in order."""
    return list(dict.fromkeys(name for row in rows for name in row["rays"] or {}))
