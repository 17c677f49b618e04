# SPDX-License-Identifier: GPL-3.0-or-later
"""Kaplan 1985: halved cells make the time of a ray constant. MacDonald and Booth 1990: where the best plane lies.

Kaplan locates each leaf from the root, without a stack, which is the faithful configuration. The expected cost of
MacDonald and Booth is that of a plane alone: the surface of each side times its number of objects.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from ...core.base.arrays import F64
from ...core.scene.workload import Workload
from . import kd, paper_scenes
from .claims import Chart, Claim, Lab, Outcome, slope, verdict

KAPLAN = "Kaplan, Space-tracing: a constant time ray-tracer (1985)"
BOOTH = "MacDonald and Booth, Heuristics for ray tracing using space subdivision (1990)"

HALVES = {"faithful": "kd-median:traversal=seq,leaves=scalar", "best": "kd-median"}
"""Trees of halved cells, with Kaplan's traversal and with ours."""

COUNTS = {True: (500, 2000, 8000), False: (500, 2000, 8000, 32000)}
"""Numbers of objects over which times are measured: in a quick run (True) and a full one."""

CONSTANT = 0.1
"""Largest exponent of a time that counts as constant (chosen): four times the objects take at most 15 % longer."""

MEDIANS = {
    "faithful": ("kd-median:traversal=dir,leaves=scalar", "kd-object:traversal=dir,leaves=scalar"),
    "best": ("kd-median", "kd-object"),
}
SURFACE = {"faithful": "kd-sah:traversal=dir,leaves=scalar", "best": "kd"}
"""Trees whose planes have the least expected cost."""

LEAST = 16
"""Least number of triangles of a cell whose planes are searched for the best one."""


def constant(lab: Lab) -> Iterator[Outcome]:
    """The exponent of the time of a ray in the number of objects."""
    made = [paper_scenes.many(count) for count in COUNTS[lab.quick]]
    for configuration, spec in HALVES.items():
        found = {len(one.triangles): kd.times(lab, one, [spec], alone=False)[spec] for one in made}
        points = [(float(count), one.nanoseconds) for count, one in found.items()]
        exponent = slope(tuple(np.log(point)) for point in points)
        yield Outcome(
            configuration,
            verdict(holds=exponent <= CONSTANT),
            f"the time of a ray grows as the number of objects to the power of {exponent:.2f} (limit: {CONSTANT:g}): "
            + ", ".join(f"{count:,.0f} objects {time:.0f} ns" for count, time in points),
            "per ray: "
            + "; ".join(
                f"{count:,} objects {one.counters['steps']:.1f} nodes and {one.counters['tests']:.1f} tests"
                for count, one in found.items()
            ),
            lab.errors([one.name for one in made], [spec]),
            {"exponent": exponent},
            (Chart(f"{configuration}: time of a ray", "objects", "ns a ray", {spec: points}),),
        )


def beyond(low: F64, high: F64, extent: F64, axis: int) -> float | None:
    """How far the best plane of a cell lies beyond its middle and the median of its objects, 0 for between.

    low, high: (3,) corners of the cell. extent: (n, 2) ends of its objects along the axis, within the cell. The best
    plane is the one of least expected cost at an end of an object. At the medians the sides hold as equally many
    objects as they can. The result is a share of the cell's extent; None if the cell is flat, or no plane inside costs
    less than the whole cell.
    """
    size = high - low
    if size[axis] <= 0:
        return None
    planes = np.unique(extent)
    share = (planes - low[axis]) / size[axis]
    left = np.searchsorted(np.sort(extent[:, 0]), planes, "left")
    right = len(extent) - np.searchsorted(np.sort(extent[:, 1]), planes, "right")
    other = np.delete(size, axis)
    end, side = other[0] * other[1], size[axis] * other.sum()
    cost = (end + side * share) * left + (end + side * (1 - share)) * right
    best = int(cost.argmin())
    if not 0 < share[best] < 1 or cost[best] >= (end + side) * len(extent):
        return None
    uneven = np.abs(left - right)
    ends = [0.5, *share[uneven == uneven.min()]]
    return float(max(min(ends) - share[best], share[best] - max(ends), 0.0))


def cells(tree: Mapping[str, F64], workload: Workload) -> Iterator[tuple[F64, F64, F64]]:
    """The inner nodes of an exported kd-tree with LEAST triangles and more.

    Each as low, high, (3,) corners, and (n, 2, 3) corners of the boxes of its triangles, cut at the cell.
    """
    corners = workload.vertices[workload.triangles].astype(np.float64)
    boxes = np.stack([corners.min(1), corners.max(1)], axis=1)
    for node in np.flatnonzero(tree["node_kind"] < 3):
        low, high = tree["node_bounds"][node].reshape(2, 3)
        inside = np.all((boxes[:, 1] >= low) & (boxes[:, 0] <= high), axis=1)
        if np.count_nonzero(inside) >= LEAST:
            yield low, high, np.clip(boxes[inside], low, high)


def between(lab: Lab) -> Iterator[Outcome]:
    """How often the best plane of a cell lies between its middle and the median of its objects."""
    for workload in (paper_scenes.scattered(), paper_scenes.concentrated(), paper_scenes.needles()):
        tree = lab.build(workload, "kd-object").export()
        far: dict[str, list[float]] = {"whole": [], "points": []}
        for low, high, boxes in cells(tree, workload):
            middles = np.repeat(boxes.mean(axis=1, keepdims=True), 2, axis=1)
            for name, objects in (("whole", boxes), ("points", middles)):
                places = (beyond(low, high, objects[:, :, axis], axis) for axis in range(3))
                far[name] += [place for place in places if place is not None]
        share = {name: float(np.mean(np.array(places) == 0)) if places else 1.0 for name, places in far.items()}
        spec = MEDIANS["faithful"][1]
        kd.times(lab, workload, [spec], alone=False)
        yield Outcome(
            "faithful",
            verdict(holds=share["whole"] == 1),
            f"{workload.name}: in {share['whole']:.0%} of {len(far['whole']):,} cells and axes the plane of least cost "
            "lies between the middle of the cell and the median of its objects; elsewhere up to "
            f"{max(far['whole'], default=0):.2f} of the cell's extent beyond",
            f"with every object as a point, which no plane cuts, in {share['points']:.0%} of {len(far['points']):,}: "
            "a plane beyond the two may cut fewer objects",
            lab.error(workload, [spec]),
            share,
        )


def surface(lab: Lab) -> Iterator[Outcome]:
    """Trees of planes of least expected cost against those of both medians."""
    for workload in kd.scenes(lab):
        if not kd.ray_sets(lab, workload):
            continue
        for configuration, own in SURFACE.items():
            others = MEDIANS[configuration]
            found = kd.times(lab, workload, [own, *others], alone=False)
            shares = {name: found[own].share(found[name]) for name in others}
            work = (
                f"{name} {one.counters['steps']:.1f} nodes and {one.counters['tests']:.1f} tests"
                for name, one in found.items()
            )
            yield Outcome(
                configuration,
                verdict(*(share.below() for share in shares.values())),
                f"{workload.name}: {own} takes "
                + ", ".join(f"{share.value:.2f} of the time of {name}" for name, share in shares.items()),
                f"per ray: {'; '.join(work)}",
                lab.error(workload, [own, *others]),
                {name: share.value for name, share in shares.items()},
            )


CLAIMS = (
    Claim(
        "halved-cells-constant",
        KAPLAN,
        "The time of a ray through halved cells does not depend on the number of objects.",
        constant,
    ),
    Claim(
        "medians-between",
        BOOTH,
        "The best plane of a cell lies between the middle of the cell and the median of its objects.",
        between,
    ),
    Claim(
        "medians-surface",
        BOOTH,
        "Planes chosen by surface area make rays quicker than planes at the middle or at the median.",
        surface,
        kd.SCENES,
    ),
)
