# SPDX-License-Identifier: GPL-3.0-or-later
"""Cost of each pixel of a view in a structure: steps, tests, time and more, as numbers and as false colours."""

from __future__ import annotations

import base64
import math
import time
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base import colours
from ..base.arrays import F32, F64
from ..scene import rays
from ..scene.workload import Workload
from . import counting, pixel_costs

if TYPE_CHECKING:
    from ..base.interface import Structure

TIMINGS = 3
"""Number of timed passes per tile; the shortest counts."""

CALLS = 64
"""Number of empty calls timed to find the cost of a call, which is subtracted."""

TYPES = ("<u2", "<u4", "<f4", "<f8")
"""NumPy's names of the types in which maps are packed, the smallest first; the last holds every number."""

HIGHEST = 4
"""Largest ratio of height to width; taller views are made narrower."""


@dataclass(frozen=True)
class Quantity:
    """A measurable quantity. key: in settings. code: of the key in `.blend` files, never reused. label: on pictures.
    unit: of the numbers. doc: for tooltips.
    """

    key: str
    code: int
    label: str
    unit: str
    doc: str


QUANTITIES = (
    Quantity(
        "STEPS",
        0,
        "Traversal steps",
        "per ray",
        "Nodes that the ray of each pixel visits, alone or together with others, leaves included",
    ),
    Quantity(
        "TESTS",
        1,
        "Triangle tests",
        "per ray",
        "Triangles that the ray of each pixel is tested against; rays of a tile that is traced as a whole share its "
        "tests",
    ),
    Quantity(
        "TIME", 2, "Time", "ns per ray", "Nanoseconds that a ray takes, the mean of each 8 × 8 pixels, on one thread"
    ),
    Quantity(
        "SINGLE_TESTS",
        7,
        "Triangle tests, single rays",
        "per ray",
        "Triangles that the ray of each pixel is tested against where it is traced alone; the wasted tests are a part "
        "of these",
    ),
    Quantity(
        "WASTED",
        3,
        "Wasted tests, single rays",
        "per ray",
        "Triangles tested on visits of leaves that found no nearer hit than the one known: leaves that hold what lies "
        "elsewhere, or that are visited too early. Each ray is traced alone: the rays of a tile share their visits",
    ),
    Quantity(
        "OVERLAP",
        4,
        "End-point overlap",
        "axis steps",
        "Cost of the nodes around the hit whose leaves do not hold the triangle hit, 80 for a test: work that any "
        "ray to this point does in vain. 0 in structures that divide space",
    ),
    Quantity(
        "ANY_HIT",
        5,
        "Any-hit cost",
        "per shadow ray",
        "Nodes visited and triangles tested by the shadow ray from the hit of each pixel to one light",
    ),
    Quantity("DEPTH", 6, "Leaf depth", "levels", "Depth of the leaf that holds the hit; the root has depth 0"),
)


def quantity(key: str) -> Quantity:
    """The quantity with this key, which must exist."""
    return next(found for found in QUANTITIES if found.key == key)


def rounded(size: tuple[float, float]) -> tuple[int, int]:
    """The nearest size in whole tiles, at least one tile per side."""
    width, height = (max(round(side / rays.TILE), 1) * rays.TILE for side in size)
    return width, height


def shaped(width: int, picture: tuple[int, int]) -> tuple[int, int]:
    """A view of this width in whole tiles, with the shape of a picture given as width by height in pixels.

    It has at most HIGHEST * width * width pixels, or one tile: it is narrower if it would be more than HIGHEST times as
    high as wide, and cropped in height if it cannot be narrow enough. Pictures may be 4 pixels wide and 65,536 high.
    """
    height = width * picture[1] / max(picture[0], 1)
    share = min(math.sqrt(HIGHEST * width / max(height, 1.0)), 1.0)
    wide, high = rounded((width * share, height * share))
    # Rounding up to a tile can multiply a small side.
    most = HIGHEST * width * width // wide // rays.TILE * rays.TILE
    return wide, max(min(high, most), rays.TILE)


def measure(structure: Structure, workload: Workload, size: tuple[int, int], key: str) -> F64:
    """(height, width) float64 of a quantity at each pixel of the workload's view, rows from the bottom.

    structure: native, over the workload's triangles. size: width and height, multiples of 8. key: of QUANTITIES.
    Raises table.TreeError for quantities that need the nodes of a tree.
    """
    width, height = size
    (primary,) = rays.make(workload, structure, size=size, seed=0, names=("primary",))[:1]
    tiles = rays.tile_order(width, height)
    values: dict[str, Callable[[], NDArray[Any]]] = {
        "STEPS": lambda: counting.counters(structure, primary, 0)["visits"],
        "TESTS": lambda: pixel_costs.shared(structure, primary, "tests"),
        "TIME": lambda: np.repeat(nanoseconds(structure, primary), rays.TILE**2),
        # Tiles cannot count which of their tests are wasted.
        "SINGLE_TESTS": lambda: counting.alone(structure, primary)["tests"],
        "WASTED": lambda: counting.alone(structure, primary)["tests_wasted"],
        "OVERLAP": lambda: pixel_costs.overlap(structure, workload, primary),
        "ANY_HIT": lambda: pixel_costs.any_hit(structure, workload, size),
        "DEPTH": lambda: pixel_costs.leaf_depths(structure, workload, primary),
    }
    picture = np.empty(width * height)
    picture[tiles] = values[key]()
    return picture.reshape(height, width)[::-1].copy()


def work(structure: Structure, view: rays.RaySet, size: tuple[int, int]) -> F64:
    """(height, width) float64, nodes visited plus triangles tested by the ray of each pixel, rows from the bottom.

    view: the primary rays of `size` pixels in tiles. If a tile is traversed as a whole, its rays share the sum evenly.
    """
    width, height = size
    # Count once in tiles and once as single rays; different counts mean that tiles are traversed as a whole.
    counted, alone = (_steps_and_tests(structure, one) for one in (view, replace(view, order="none")))
    if not np.array_equal(counted, alone):
        side = rays.TILE**2
        counted = np.repeat(counted.reshape(-1, side).mean(axis=1), side)
    picture = np.empty(width * height)
    picture[rays.tile_order(width, height)] = counted
    return picture.reshape(height, width)[::-1].copy()


def _steps_and_tests(structure: Structure, view: rays.RaySet) -> F64:
    """(n,) nodes visited and triangles tested by each ray together."""
    counters = counting.counters(structure, view, 0)
    return counters["steps"].astype(np.float64) + counters["tests"]


def packed(values: F64) -> dict[str, Any]:
    """A map as a JSON object, compressed, rows from the bottom. type: the first of TYPES that holds all its numbers."""
    with np.errstate(invalid="ignore", over="ignore"):
        kind = next(kind for kind in TYPES if np.array_equal(values.astype(kind), values, equal_nan=True))
    height, width = values.shape
    data = base64.b64encode(zlib.compress(values.astype(kind).tobytes(), 9)).decode()
    return {"width": width, "height": height, "type": kind, "data": data}


def unpacked(stored: Mapping[str, Any]) -> F64:
    """The inverse of `packed`."""
    flat = np.frombuffer(zlib.decompress(base64.b64decode(stored["data"])), stored["type"])
    return flat.reshape(stored["height"], stored["width"]).astype(np.float64)


def nanoseconds(structure: Structure, primary: rays.RaySet) -> F64:
    """(tiles,) mean nanoseconds per ray of each 64 consecutive rays, on one thread."""
    side = rays.TILE**2
    count = len(primary) // side
    parts = [
        (primary.origins[i * side : (i + 1) * side], primary.directions[i * side : (i + 1) * side])
        for i in range(count)
    ]
    best = np.full(count, np.inf)
    call = np.inf  # cost of a call without work: rays with a zero direction visit nothing
    # Time empty calls and tiles in turns, and keep the shortest time of each.
    for _ in range(TIMINGS):
        for origins, _ in parts[:CALLS]:
            start = time.perf_counter_ns()
            structure.closest(origins, np.zeros_like(origins), order=primary.order, threads=1)
            call = min(call, time.perf_counter_ns() - start)
        for i, (origins, directions) in enumerate(parts):
            start = time.perf_counter_ns()
            structure.closest(origins, directions, order=primary.order, threads=1)
            best[i] = min(best[i], time.perf_counter_ns() - start)
    measured: F64 = np.maximum(best - call, 0) / side
    return measured


def scale_end(maps: Sequence[F64]) -> float:
    """Upper end of a common scale for several maps: a round number that only the brightest 0.1 % of the
    pixels exceed.
    """
    most = max((float(np.percentile(values, 99.9)) for values in maps if values.size), default=0.0)
    if most <= 0:
        return 1.0
    step = 10.0 ** math.floor(math.log10(most))
    return next(m * step for m in (1, 1.5, 2, 3, 4, 5, 6, 8, 10) if m * step >= most * (1 - 1e-9))


def ticks(end: float) -> list[float]:
    """Five evenly spaced numbers on a scale from 0 to `end`, both included."""
    return [end * i / 4 for i in range(5)]


def number(value: float) -> str:
    """A number of a scale as short text."""
    return f"{value:,.0f}" if value >= 10 or value == int(value) else f"{value:.3g}"


def coloured(values: F64, end: float) -> F32:
    """(h, w, 3) false colours of (h, w) numbers on a scale from 0 to `end`."""
    return colours.false_colour(values / end)


def summary(values: F64) -> str:
    """Mean and largest value as text."""
    return f"mean {number(float(values.mean()))}, most {number(float(values.max()))}"
