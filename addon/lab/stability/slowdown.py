# SPDX-License-Identifier: GPL-3.0-or-later
"""Time, work and answers of structures on extreme coordinates and shapes, relative to ordinary ones.

Error bounds that grow with the size of coordinates keep answers right and make them slow. Each case therefore has a
twin: the same rounded vertices at the origin, at scale 1 or without the huge triangle, triangles of good shape instead
of slivers, half as many coincident ones.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...core.base.arrays import F32, I32
from ...core.measure import accuracy
from ...core.measure.accuracy import Answers, Mask

if TYPE_CHECKING:
    from ...core.base.interface import Native, Structure

Row = dict[str, Any]
Order = Literal["none", "tile8"]

OFFSETS = (0.0, 1e3, 1e5, 1e7)
"""Distances of the sphere from the origin, in its sizes."""

DIRECTION = np.array([0.741880, 0.006170, -1.117115])
"""Direction of the offsets; the sphere of radius 1 at 10⁵ times this has the size 2."""

EXPONENTS = (-20, -10, 10, 20)
"""Scales of the sphere, as powers of ten; rounded to powers of two, which change no bit of a mantissa."""

LIMITS = {1e3: 1.2, 1e5: 1.2, 1e7: 1.5}
"""By offset in sizes: the largest ratio of work to that at the origin that counts as none."""

HUGE = 3.0
"""The largest ratio of work with one huge triangle to that without it."""

SIZES = {"small": (24, 1600, 1000), "large": (71, 20_000, 1_000_000)}
"""By size: rings of the sphere, rays of each kind, and coincident triangles."""

VERSION = 1
"""Version of the rows: increment when a row's content changes; rows of earlier runs are then not reused."""

FEW = 64
"""Number of rays at coincident triangles."""

TILE = 8
"""Width of the tiles of camera rays."""


@dataclass(frozen=True)
class Scene:
    """Triangles, and rays by name: (origins, directions). Rays named `outside` are in tile order."""

    vertices: F32
    triangles: I32
    rays: dict[str, tuple[F32, F32]] = field(default_factory=dict)


@dataclass(frozen=True)
class Case:
    """An extreme scene and its twin. group: the case's axis in the plot, and its place there."""

    group: str
    at: float
    name: str
    scene: Scene
    twin: Scene


def sphere(rings: int) -> tuple[NDArray[np.float64], I32]:
    """A closed unit sphere of 4 rings (rings - 1) triangles, between parallels and meridians."""
    slices = 2 * rings
    polar = np.linspace(0, np.pi, rings + 1)[1:-1, None]
    around = np.linspace(0, 2 * np.pi, slices, endpoint=False)
    grid = np.stack(
        [np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar) * np.ones(slices)], axis=-1
    )
    vertices = np.concatenate([[[0, 0, 1]], grid.reshape(-1, 3), [[0, 0, -1]]])
    # Connect each vertex with the next one around, and with the next ring.
    at = 1 + np.arange((rings - 1) * slices).reshape(rings - 1, slices)
    after = np.roll(at, -1, axis=1)
    first, last = np.zeros(slices, np.int64), np.full(slices, len(vertices) - 1)
    parts = [
        np.stack([first, at[0], after[0]], axis=1),
        np.stack([at[-1], last, after[-1]], axis=1),
        np.stack([at[:-1], at[1:], after[1:]], axis=-1).reshape(-1, 3),
        np.stack([at[:-1], after[1:], after[:-1]], axis=-1).reshape(-1, 3),
    ]
    return vertices, np.concatenate(parts).astype(np.int32)


def rays(count: int, seed: int) -> dict[str, tuple[NDArray[np.float64], F32]]:
    """About `count` rays from the centre of the unit sphere in all directions, and of a camera outside that sees it."""
    random = np.random.default_rng(seed)
    directions = random.normal(size=(count, 3)).astype(np.float32)
    inside = np.zeros((count, 3)), directions
    # Look at the sphere from three radii; the order is that of tiles.
    tiles = max(1, round(count**0.5 / TILE))
    i, j, y, x = np.indices((tiles, tiles, TILE, TILE))
    width = TILE * tiles
    across = ((TILE * j + x).ravel() + 0.5) / width - 0.5
    up = ((TILE * i + y).ravel() + 0.5) / width - 0.5
    view = np.stack([np.ones(width**2), 0.75 * across, 0.75 * up], axis=1)
    outside = np.broadcast_to([-3.0, 0.0, 0.0], view.shape), view.astype(np.float32)
    return {"inside": inside, "outside": outside}


def moved(vertices: NDArray[np.float64], triangles: I32, sent: dict[str, Any], offset: float) -> tuple[Scene, Scene]:
    """The scene at an offset in sizes, rounded there, and the same rounded vertices and rays moved back exactly."""
    centre = np.round(offset * DIRECTION * 2).astype(np.float32)

    def pair(points: NDArray[np.float64]) -> tuple[F32, F32]:
        far = (points + centre).astype(np.float32)
        near = far.astype(np.float64) - centre
        assert (near.astype(np.float32) == near).all(), "the differences are exact"
        return far, near.astype(np.float32)

    far, near = pair(vertices)
    starts = {name: pair(origins) for name, (origins, _) in sent.items()}
    of = {name: directions for name, (_, directions) in sent.items()}
    return (
        Scene(far, triangles, {name: (starts[name][0], of[name]) for name in sent}),
        Scene(near, triangles, {name: (starts[name][1], of[name]) for name in sent}),
    )


def cases(rings: int, count: int, copies: int, seed: int) -> Iterator[Case]:
    """All cases. rings: of the sphere; count: rays of each kind; copies: number of coincident triangles."""
    vertices, triangles = sphere(rings)
    sent = rays(count, seed)
    for offset in OFFSETS:
        yield Case("offset", offset, f"offset {offset:g}", *moved(vertices, triangles, sent, offset))
    here, _ = moved(vertices, triangles, sent, 0.0)
    for exponent in EXPONENTS:
        factor = np.float32(2.0 ** round(exponent * np.log2(10)))
        started = {name: (origins * factor, directions) for name, (origins, directions) in here.rays.items()}
        scaled = Scene(here.vertices * factor, triangles, started)
        yield Case("scale", exponent, f"scale 1e{exponent}", scaled, here)
    # Put one triangle around the sphere, so large that its coordinates are 10^5 sizes.
    huge = np.float32(2e5) * np.array([[-1, -1, -1], [1, -1, -1], [0, 2, -1]], np.float32)
    more = np.array([[len(vertices), len(vertices) + 1, len(vertices) + 2]], np.int32)
    mixed = Scene(np.concatenate([here.vertices, huge]), np.concatenate([triangles, more]), here.rays)
    yield Case("shape", 0, "one huge, many tiny", mixed, here)
    # Stretch triangles over the length of a tube; the twin has as many in bands.
    number = len(triangles)
    yield Case("shape", 1, "slivers", _tube(number, 1, sent), _tube(number, rings, sent))
    yield Case("shape", 2, "coincident", _coincident(copies, sent), _coincident(max(1, copies // 2), sent))


def _tube(count: int, bands: int, sent: dict[str, Any]) -> Scene:
    """A tube around the y axis of about `count` triangles in this number of bands."""
    around = max(3, count // (2 * bands))
    angle = np.linspace(0, 2 * np.pi, around, endpoint=False)
    height = np.linspace(-2, 2, bands + 1)[:, None]
    ring = np.stack([np.cos(angle) + 0 * height, height + 0 * angle, np.sin(angle) + 0 * height], axis=-1)
    at = np.arange((bands + 1) * around).reshape(bands + 1, around)
    after = np.roll(at, -1, axis=1)
    parts = [np.stack([at[:-1], at[1:], after[1:]], axis=-1), np.stack([at[:-1], after[1:], after[:-1]], axis=-1)]
    triangles = np.concatenate([part.reshape(-1, 3) for part in parts]).astype(np.int32)
    started = {name: (origins.astype(np.float32), directions) for name, (origins, directions) in sent.items()}
    return Scene(ring.reshape(-1, 3).astype(np.float32), triangles, started)


def _coincident(copies: int, sent: dict[str, Any]) -> Scene:
    """Copies of one triangle in front of some camera rays: each must test all copies, since distances are equal."""
    vertices = np.array([[4, -5, -5], [4, 5, -5], [4, 0, 9]], np.float32)
    triangles = np.tile(np.array([[0, 1, 2]], np.int32), (copies, 1))
    origins, directions = (part[:FEW] for part in sent["outside"])
    return Scene(vertices, triangles, {"outside": (origins.astype(np.float32), directions)})


COUNTS = ("steps", "leaves", "leaves_empty", "tests")
"""Counters of a traversal's work."""


@dataclass
class Traced:
    """A structure over a scene: its answers, its work and the least processor time of its rays, in seconds."""

    structure: Structure
    answers: dict[str, Answers] = field(default_factory=dict)
    occluded: dict[str, Mask] = field(default_factory=dict)
    work: dict[str, int] = field(default_factory=dict)
    seconds: float = np.inf


def trace(native: Native, scene: Scene, spec: str) -> Traced:
    """Build a structure on one thread, and trace all rays for the answers and for the counters."""
    traced = Traced(native.build(scene.vertices, scene.triangles, spec, threads=1))
    work = dict.fromkeys(COUNTS, 0)
    for name, (origins, directions) in scene.rays.items():
        order: Order = "tile8" if name == "outside" else "none"
        traced.answers[name] = Answers.of(traced.structure.closest(origins, directions, order=order, threads=1))
        traced.occluded[name] = traced.structure.occluded(origins, directions, order=order, threads=1)
        hits = traced.structure.closest(origins, directions, order=order, threads=1, counters=True)
        _, counters = traced.structure.occluded(origins, directions, order=order, threads=1, counters=True)
        assert hits.counters is not None, "they were requested"
        for counter in COUNTS:
            work[counter] += int(hits.counters[counter].sum(dtype=np.int64) + counters[counter].sum(dtype=np.int64))
    traced.work = {"steps": sum(work[name] for name in COUNTS[:-1]), "tests": work["tests"]}
    return traced


def time_once(scene: Scene, traced: Traced) -> None:
    """Trace all rays once more, and keep the time if it is the least so far."""
    began = time.process_time()
    for name, (origins, directions) in scene.rays.items():
        order: Order = "tile8" if name == "outside" else "none"
        traced.structure.closest(origins, directions, order=order, threads=1)
        traced.structure.occluded(origins, directions, order=order, threads=1)
    traced.seconds = min(traced.seconds, time.process_time() - began)


def measure(native: Native, case: Case, specs: Sequence[str], *, repeats: int) -> Iterator[Row]:
    """One row per configuration on one case. repeats: timings of case and twin, which alternate; 0 for none."""
    brute = [trace(native, scene, "brute").answers for scene in (case.scene, case.twin)]
    for spec in specs:
        pair = [trace(native, scene, spec) for scene in (case.scene, case.twin)]
        for _ in range(repeats):
            for scene, traced in zip((case.scene, case.twin), pair, strict=True):
                time_once(scene, traced)
        # Compare the answers on both scenes, and the work on them.
        wrong = 0
        for right, traced in zip(brute, pair, strict=True):
            for name, answers in right.items():
                differ = accuracy.differing(answers, traced.answers[name], traced.occluded[name])
                wrong += int(differ.sum())
        here, there = pair
        count = sum(len(origins) for origins, _ in case.scene.rays.values())
        steps, tests = (ratio(here.work[name], there.work[name]) for name in ("steps", "tests"))
        yield {
            "case": case.name,
            "group": case.group,
            "at": case.at,
            "spec": spec,
            "triangles": len(case.scene.triangles),
            "rays": count,
            "wrong": wrong,
            "steps": here.work["steps"] / count,
            "tests": here.work["tests"] / count,
            "steps_ratio": steps,
            "tests_ratio": tests,
            "work": max(steps, tests),
            "seconds": here.seconds if repeats else None,
            "time_ratio": here.seconds / there.seconds if repeats else None,
        }


def ratio(here: int, there: int) -> float:
    """The ratio of two counts; 1 if both are 0."""
    return (here or 1) / (there or 1)


def slowed(row: Row) -> bool:
    """Whether a case far from the origin, or with one huge triangle, takes more work than its limit allows."""
    known: dict[str, dict[Any, float]] = {"offset": {**LIMITS}, "shape": {0: HUGE}}
    limits = known.get(row["group"], {})
    return bool(row["work"] > limits.get(row["at"], 1.0 if row["group"] == "offset" else float("inf")))
